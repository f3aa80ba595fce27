//! mbm: a Modbus stack for firmware.
//!
//! Data flows one way, and a module uses only what stands to its left:
//!
//! ```text
//! bytes -> frame -> pdu -> packet -> explain -> {sniffer, transaction} -> engine -> {master, client, server}
//! ```
//!
//! `atomic`, `error`, `time`, `port`, `ring` and `data` stand beside that line and may be used
//! anywhere on it. `make check` holds every module to this rule.
//!
//! The core allocates nothing, keeps no globals, never blocks and does not
//! panic. Time is an argument; input and output are a [`port::Port`].

#![no_std]
#![forbid(unsafe_code)]
#![warn(missing_docs, clippy::indexing_slicing, clippy::unwrap_used)]
#![cfg_attr(test, allow(clippy::indexing_slicing, clippy::unwrap_used))]

#[cfg(test)]
extern crate std;

mod atomic;
pub mod error;
pub mod port;
pub mod ring;
pub mod time;

pub mod bytes;
pub mod data;
pub mod engine;
pub mod explain;
pub mod frame;
pub mod packet;
pub mod pdu;
pub mod sniffer;
pub mod transaction;

pub mod client;
pub mod master;
pub mod server;

/// True where the code for firmware runs, which is shorter and slower. Everywhere
/// else, this is false: hosts have room for a second way to do what is done most.
///
/// Every branch on the target reads this constant, or has the same condition as a
/// `cfg` attribute. `--cfg mbm_firmware` selects the code for firmware on a host,
/// so that tests run it there.
pub const FIRMWARE: bool = cfg!(any(target_os = "none", mbm_firmware));
