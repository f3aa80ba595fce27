//! The C ABI of mbm, and its only unsafe code.
//!
//! Rules of every function here:
//! - A pointer is NULL, or points to what the function's comment names, which nothing else uses
//!   meanwhile. For NULL, and for an object that was never begun, the function returns a status.
//! - Objects are the caller's storage, zeroed before first use.
//! - Arguments and results are integers and pointers only: no enum, no bool, no float by
//!   value.
//! - No function is re-entrant on one object. A program may use any number of objects
//!   side by side.
//!
//! cbindgen copies the comments into `include/mbm/*.h`, so they are written for C programmers.

#![no_std]
#![warn(
    missing_docs,
    clippy::indexing_slicing,
    clippy::unwrap_used,
    clippy::undocumented_unsafe_blocks
)]
#![allow(non_camel_case_types, non_snake_case)]
// What every unsafe function demands of its arguments; `# Safety` stands where one demands more:
// - A pointer to a type of the header is one of C, as the rules above say. The type `In` or `Out` says
//   so of a value, and gives it without unsafe code.
// - An `Object` is begun. Neither a reference into it nor one into the object that it uses, its client
//   or line, lives, so that hooks may run.
// - An argument with the name and type of one of an earlier function of the file is as that demands.
// The body of an unsafe function relies on these rules. A block with a SAFETY line stands where more is
// to be shown, and in every function that is safe.
#![allow(clippy::missing_safety_doc)]

#[cfg(feature = "capi")]
extern crate std;

/// A table of exported functions, one of C in each row: its comment, its name, its arguments after
/// `$objects`, and the function that it calls with `$objects` and the arguments that follow. All
/// return a status. A table of functions that need no unsafe code begins with `safe`.
///
/// cbindgen sees no macros: `rows` in `scripts/build/header` expands the tables for it.
macro_rules! functions {
    (@ [$($safety:tt)?] ($($object:ident: $kind:ty),*) $(#[$comment:meta])* $name:ident
        ($($given:ident: $type:ty),*) $call:ident ($($passed:expr),* $(,)?)) => {
        $(#[$comment])*
        #[no_mangle]
        pub $($safety)? extern "C" fn $name($($object: $kind,)* $($given: $type),*) -> u8 {
            $call($($object,)* $($passed),*)
        }
    };
    (safe $objects:tt $($(#[$comment:meta])* fn $name:ident $given:tt = $call:ident $passed:tt;)*) => {
        $(functions! { @ [] $objects $(#[$comment])* $name $given $call $passed })*
    };
    ($objects:tt $($(#[$comment:meta])* fn $name:ident $given:tt = $call:ident $passed:tt;)*) => {
        $(functions! { @ [unsafe] $objects $(#[$comment])* $name $given $call $passed })*
    };
}

mod bits;
mod client;
mod dma_ring;
mod frame;
mod framing;
mod functions;
mod gateway;
mod limits;
mod line;
mod link;
mod node;
mod packet;
mod plan;
mod pointers;
mod port;
mod registers;
mod ring;
mod server;
mod sniffer;
mod status;
mod storage;
mod text;
mod trace;
mod version;

pub use bits::*;
pub use client::*;
pub use dma_ring::*;
pub use frame::*;
pub use framing::*;
pub use functions::*;
pub use gateway::*;
pub use limits::*;
pub use line::*;
pub use link::*;
pub use node::*;
pub use packet::*;
pub use plan::*;
pub use pointers::{In, Out};
pub use port::*;
pub use registers::*;
pub use ring::*;
pub use server::*;
pub use sniffer::*;
pub use status::*;
pub use storage::*;
pub use text::*;
pub use trace::*;
pub use version::*;
