//! mbm: a Modbus stack for firmware.
//!
//! Data flows one way, and a module uses only what stands to its left:
//!
//! ```text
//! bytes -> frame -> pdu -> packet -> explain -> {sniffer, transaction} -> engine -> {master, client, server} -> capi
//! ```
//!
//! `atomic`, `error`, `time`, `port`, `ring` and `data` stand beside that line and may be used
//! anywhere on it. `make check` holds every module to this rule.
//!
//! The core allocates nothing, keeps no globals, never blocks and does not
//! panic. Time is an argument; input and output are a [`port::Port`].

#![no_std]
#![deny(unsafe_code)]
#![warn(missing_docs, clippy::indexing_slicing, clippy::unwrap_used)]
#![cfg_attr(test, allow(clippy::indexing_slicing, clippy::unwrap_used))]

#[cfg(test)]
extern crate std;

/// cbindgen:ignore
mod atomic;
/// cbindgen:ignore
pub mod error;
/// cbindgen:ignore
pub mod port;
/// cbindgen:ignore
pub mod ring;
/// cbindgen:ignore
pub mod time;

/// cbindgen:ignore
pub mod bytes;
/// cbindgen:ignore
pub mod data;
/// cbindgen:ignore
pub mod engine;
/// cbindgen:ignore
pub mod explain;
/// cbindgen:ignore
pub mod frame;
/// cbindgen:ignore
pub mod packet;
/// cbindgen:ignore
pub mod pdu;
/// cbindgen:ignore
pub mod sniffer;

/// cbindgen:ignore
pub mod client;
/// cbindgen:ignore
pub mod master;
/// cbindgen:ignore
pub mod server;

#[allow(unsafe_code)]
pub mod capi;

/// True where the code for firmware runs, which is shorter and slower. Everywhere
/// else, this is false: hosts have room for a second way to do what is done most.
///
/// Every branch on the target reads this constant, or has the same condition as a
/// `cfg` attribute. `--cfg mbm_firmware` selects the code for firmware on a host,
/// so that tests run it there.
const FIRMWARE: bool = cfg!(any(target_os = "none", mbm_firmware));
