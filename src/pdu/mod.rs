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
mod message;
mod objects;
pub mod outline;
pub mod query;
mod records;
pub mod registers;
pub mod reply;
pub mod request;
pub mod response;

/// True for the functions of the standard that this module knows (clause 6).
pub const fn is_public(function: u8) -> bool {
    matches!(function, 0x01..=0x08 | 0x0B | 0x0C | 0x0F..=0x11 | 0x14..=0x18 | 0x2B)
}

/// Set in the function code of an exception response (clause 7).
pub const EXCEPTION: u8 = 0x80;
