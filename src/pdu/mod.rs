//! Protocol data units (PDUs): a function code and its data, without framing (application
//! protocol V1.1b3, clause 6).
//!
//! [`functions`] is the table of the functions. [`request`] and [`response`] take PDUs apart
//! and write them, from [`fields`]. A client keeps a [`header`] of each request that it sends,
//! a master a [`master_request`].

pub mod custom;
pub mod diagnostics;
pub mod fields;
pub mod files;
pub mod functions;
pub mod header;
pub mod identification;
pub mod identification_stream;
pub mod length;
pub mod limits;
pub mod master_request;
pub mod request;
pub mod response;

pub use functions::is_public;

/// The bit that is set in the function code of an exception response (clause 7).
pub const EXCEPTION: u8 = 0x80;
