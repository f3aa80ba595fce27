//! The C functions and Rust's standard library, in one archive.

extern crate mbm_c;
