//! `mbm_gateway_*`: from Modbus TCP connections to the lines of clients.

mod begin;
mod connection;
mod object;
mod parts;
mod poll;
mod settings;
mod storage;

pub use begin::*;
pub use connection::*;
pub use object::mbm_gateway;
pub use parts::*;
pub use poll::*;
pub use settings::*;
