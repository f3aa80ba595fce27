//! The targets: each makes calls of an input, and fails if a property does not hold.

use crate::api;

mod division;
mod engine;
mod frames;
mod libmodbus;
mod plan;
mod replies;
mod request_pdu;
mod response_pdu;
mod server;
mod sniffer;
mod tables;
mod trace;

/// The name of a target, what it does with an input, and how many inputs `make test` tries.
pub type Target = (&'static str, fn(&[u8]), u32);

pub const TARGETS: &[Target] = &[
    ("rtu", frames::rtu, 50_000),
    ("ascii", frames::ascii, 50_000),
    ("tcp", frames::tcp, 50_000),
    ("request_pdu", request_pdu::run, 40_000),
    ("response_pdu", response_pdu::run, 40_000),
    ("engine", engine::run, 20_000),
    ("libmodbus", libmodbus::run, 20_000),
    ("sniffer", sniffer::run, 10_000),
    ("c_api", api::run, 5_000),
    ("lives", api::life::run, 2_500),
    ("plan", plan::run, 100_000),
    ("division", division::run, 80),
    ("trace", trace::run, 50_000),
    ("replies", replies::run, 200_000),
    ("server", server::run, 10_000),
    ("tables", tables::run, 20_000),
];
