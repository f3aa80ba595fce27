//! The server: receives requests and sends responses.
//!
//! A request takes three steps. First a `Server` finds it on a line or connection, or
//! `respond` takes it from a buffer. Then the unit with the request's id is looked up. Then
//! the services of that unit get the PDU one after the other, until one of them serves the
//! function and writes the response over the request.
//!
//! A program has a [`Device`]: a struct that reads and writes its values, or [`Tables`] of arrays. A
//! [`Unit`] gives it an id. Below that, a [`Service`] is one family of functions, and a
//! [`ServiceUnit`] a list of them: firmware carries only the services that it names.
//!
//! Checks come in the order of the standard (V1.1b3, clause 7): function, quantity, address,
//! execution. A write is carried out completely or not at all.

#[cfg(feature = "embedded-io-async")]
mod asynchronous;
pub mod custom;
mod device;
pub mod diagnostics;
pub mod files;
mod framing;
pub mod identity;
mod indication;
mod line;
mod reply;
mod serve_device;
#[cfg(feature = "std")]
mod shared;
mod simulated;
pub mod storage;
pub mod table;
mod tables;
mod unit;
mod units;

#[cfg(feature = "embedded-io-async")]
pub use asynchronous::{AsyncServer, AsyncUnits};
pub use device::{Bits, BitsMut, Device};
pub use framing::{respond, DELIMITER};
pub use indication::{Addressing, Indication};
// For the C API; it may change in any version.
#[doc(hidden)]
pub use indication::{only_writes, ANY};
pub use line::{Server, ServerStorage};
// For the C API; it may change in any version.
#[doc(hidden)]
pub use reply::Refusal;
pub use reply::Reply;
pub use simulated::SimulatedPort;
pub use tables::{Table, Tables};
pub use unit::Unit;
// For the C API; it may change in any version.
#[doc(hidden)]
pub use units::{dispatch, Dispatch};
pub use units::{Service, ServiceUnit, Units};
