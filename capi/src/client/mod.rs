//! `mbm_client_*`: the client, whose functions never wait.

mod begin;
mod identification;
mod kind;
mod link;
pub(crate) mod object;
pub(crate) mod poll;
mod repeat;
mod reply;
pub(crate) mod request;
mod requests;
mod settings;
mod storage;
mod tolerance;
mod units;

pub use begin::*;
pub use identification::*;
pub use link::*;
pub use object::mbm_client;
pub use poll::*;
pub(crate) use poll::{clock, rest};
pub(crate) use repeat::set_backoff;
pub use repeat::*;
pub use reply::*;
pub use request::mbm_clientRequest;
pub(crate) use requests::read_table;
pub use requests::*;
pub use settings::*;
pub use tolerance::*;
pub use units::*;

/// The maximum number of requests that are pending in one client.
pub const MBM_CLIENT_DEPTH: u8 = 16;
