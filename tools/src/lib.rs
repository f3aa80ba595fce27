//! Shared by the checks `layers` and `circles` of `make check`.

pub mod circles;
pub mod paths;
