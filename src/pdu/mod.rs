//! Protocol data units (PDUs): a function code and its data, without framing (application
//! protocol V1.1b3, clause 6).
//!
//! [`functions`] is the table of the functions. [`request`] and [`response`] take PDUs apart
//! and write them. Master and client make their requests from the same table.

pub mod custom;
pub mod diagnostics;
// For the packets of the C API; it may change in any version.
#[doc(hidden)]
pub mod fields;
pub mod files;
pub mod functions;
pub mod identification;
pub mod identification_stream;
pub mod length;
pub mod request;
pub mod response;

pub use functions::is_public;
pub(crate) use functions::{check_range, quantity};

/// The bit that is set in the function code of an exception response (clause 7).
pub const EXCEPTION: u8 = 0x80;

// The limits of the standard (application protocol V1.1b3, clauses 4.1 and 6).

/// Greatest length of a PDU in bytes (clause 4.1).
pub const MAX_PDU: usize = 253;

/// Greatest number of bits that 01 and 02 read (6.1, 6.2).
pub const MAX_READ_BITS: u16 = 2000;
/// Greatest number of coils that 0F writes (6.11).
pub const MAX_WRITE_BITS: u16 = 1968;
/// Greatest number of registers that 03, 04 and 17 read (6.3, 6.4, 6.17).
pub const MAX_READ_REGISTERS: u16 = 125;
/// Greatest number of registers that 10 writes (6.12).
pub const MAX_WRITE_REGISTERS: u16 = 123;
/// Greatest number of registers that 17 writes (6.17).
pub const MAX_READ_WRITE_REGISTERS: u16 = 121;
/// Greatest number of events that 0C returns (6.10).
pub const MAX_EVENTS: usize = 64;
/// Greatest number of registers that 18 returns (6.18).
pub const MAX_FIFO: u16 = 31;
/// The last record number of a file (6.14).
pub const MAX_RECORD: u16 = 9999;
/// Least and greatest byte count of a request of 14 (6.14).
pub const READ_FILE_BYTES: (usize, usize) = (0x07, 0xF5);
/// Least and greatest byte count of a response of 14 (6.14).
pub const FILE_DATA_BYTES: (usize, usize) = (0x07, 0xF5);
/// Least and greatest byte count of 15 (6.15).
pub const WRITE_FILE_BYTES: (usize, usize) = (0x09, 0xFB);

/// The value of the field "more follows" in a response to 2B/0E if more objects follow; else it is 0
/// (6.21).
const MORE: u8 = 0xFF;
