//! Protocol data units (PDUs): a function code and its data, without framing (application
//! protocol V1.1b3, clause 6).
//!
//! Each family of functions has its own file. Each function code has its own small function
//! that builds the request, so that firmware contains only the ones that it calls.

pub mod bits;
pub mod custom;
pub mod diagnostics;
mod fields;
pub mod files;
pub mod function_spec;
pub mod functions;
pub mod header;
pub mod identification;
pub mod identification_stream;
pub mod length;
pub mod limits;
pub mod master_request;
mod message;
mod objects;
mod records;
pub mod registers;
pub mod request;
pub mod response;

pub use functions::is_public;

/// The bit that is set in the function code of an exception response (clause 7).
pub const EXCEPTION: u8 = 0x80;
