//! The gateway: takes requests from Modbus TCP connections, passes each to the line of its
//! unit, and sends the reply back.
//!
//! A connection may have several pending requests. The replies go back in the order in
//! which they are known, each with the transaction identifier of its request. The requests
//! for one line wait in a queue. When the line is free, the connections take turns, and the
//! oldest request of a connection goes first. So one client that floods the gateway does not
//! delay the others.
//!
//! The gateway knows neither sockets nor clients of serial lines: [`GatewayStorage`] has
//! them. It never waits.

mod connections;
mod lines;
mod object;
mod poll;
mod route;
mod state;
mod storage;

pub use object::Gateway;
pub use route::{Destination, Route, ALL_LINES, LOCAL, UNIT_0};
pub use state::{ConnectionState, LineState, Transaction};
pub use storage::{GatewayStorage, RequestResult, NO_RESPONSE};
