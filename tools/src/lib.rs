//! What the checks of the makefile share.

pub mod circles;
pub mod paths;
