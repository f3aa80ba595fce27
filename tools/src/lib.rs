//! Shared by the checks `layers` and `circles` of `make check`, and by `members`, which builds the archive.

pub mod circles;
pub mod members;
pub mod paths;
