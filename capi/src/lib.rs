//! The C ABI of mbm, and its only unsafe code.
//!
//! Rules of every function here:
//! - a pointer is NULL, or points to what its comment says; NULL, and an
//!   object that was never begun, is answered with a status;
//! - objects are the caller's storage, zeroed before first use;
//! - integers and pointers only: no enum, no bool, no float by value;
//! - nothing is re-entrant on one object; any number of objects may be used
//!   side by side.
//!
//! The comments become those of `include/mbm.h`, so they speak to C.

#![no_std]
#![warn(missing_docs, clippy::indexing_slicing, clippy::unwrap_used)]
#![allow(non_camel_case_types, non_snake_case)]
// What a caller must hold is the same for every function, and stands above.
#![allow(clippy::missing_safety_doc)]

mod bits;
mod client;
mod frame;
mod framing;
mod functions;
mod limits;
mod master;
mod packet;
mod pointers;
mod port;
mod registers;
mod ring;
mod server;
mod sniffer;
mod status;
mod storage;
mod text;
mod version;

pub use bits::*;
pub use client::*;
pub use frame::*;
pub use framing::*;
pub use functions::*;
pub use limits::*;
pub use master::*;
pub use packet::*;
pub use port::*;
pub use registers::*;
pub use ring::*;
pub use server::*;
pub use sniffer::*;
pub use status::*;
pub use storage::*;
pub use text::*;
pub use version::*;
