//! Protocol data units: a function code and its data, free of any framing
//! (application protocol V1.1b3, clause 6).
//!
//! One family of functions is one file. A request is built by one small
//! function per function code, so that firmware carries what it calls.

pub mod bits;
pub mod custom;
pub mod diagnostics;
mod fields;
pub mod files;
pub mod identification;
pub mod length;
pub mod limits;
pub mod outline;
pub mod query;
pub mod registers;
pub mod reply;
pub mod request;
pub mod response;

/// Set in the function code of an exception response (clause 7).
pub const EXCEPTION: u8 = 0x80;
