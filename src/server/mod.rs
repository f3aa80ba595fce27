//! The server: requests in, responses out.
//!
//! A request passes through three hands. A `Server` finds it on a line or
//! connection, or `respond` takes it from a buffer. The
//! `Units` see whether it is for one of them. The services of that unit look
//! at its PDU one after the other, until one serves the function, and write the
//! response over it.
//!
//! A service is one family of functions. Firmware carries those that it names.
//!
//! Checks come in the standard's order (clause 7): the function, the quantity,
//! the address, and what happens while the request is carried out. A write is
//! carried out whole or not at all.

pub mod custom;
pub mod diagnostics;
pub mod files;
mod framing;
mod heading;
pub mod identity;
mod line;
mod reply;
pub mod respond;
pub mod storage;
pub mod table;
mod units;

pub use heading::{only_writes, Concern, Heading, ANY};
pub use line::{Lent, Server, MOST_REQUESTS};
pub use reply::Reply;
pub use units::{dispatch, first_reply, Dispatch, Service, Unit, Units};
