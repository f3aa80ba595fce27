//! Requests and responses compared with those of pymodbus, in both directions and in every
//! framing. Functions that libmodbus lacks are included.
//!
//! `make test` builds the Python environment and mbm's server first, and enables the feature
//! `pymodbus`. To run these tests alone: `make venv build/plain/serve`, then
//! `cargo test --features pymodbus`.
#![cfg_attr(not(feature = "pymodbus"), allow(dead_code))]

#[cfg(feature = "pymodbus")]
mod blocking;
#[cfg(feature = "pymodbus")]
mod client;
#[cfg(feature = "pymodbus")]
mod live_server;
#[cfg(feature = "pymodbus")]
mod pdus;
#[cfg(feature = "pymodbus")]
mod process;
#[cfg(feature = "pymodbus")]
mod server;

/// Shows in the output of `cargo test` that the tests of this folder did not run.
#[cfg(not(feature = "pymodbus"))]
#[test]
#[ignore = "run `make test`, or `make venv build/plain/serve` and `cargo test --features pymodbus`"]
fn the_tests_against_pymodbus_are_off() {}

use mbm::error::Error;
use mbm::frame::{ascii, Adu, Framing};

/// The unit and the transaction identifier of every frame.
const UNIT: u8 = 17;
const TRANSACTION: u16 = 0x1234;

/// The framings and their names in the Python scripts.
const FRAMINGS: [(Framing, &str); 3] = [
    (Framing::Rtu, "rtu"),
    (Framing::Ascii, "ascii"),
    (Framing::Tcp, "tcp"),
];

/// The frame of the PDU that `pdu` writes.
fn frame(framing: Framing, pdu: impl FnOnce(&mut [u8]) -> Result<usize, Error>) -> Vec<u8> {
    let mut buffer = [0; 600];
    let length = framing
        .emit(&mut buffer, TRANSACTION, UNIT, ascii::END, pdu)
        .expect("the frame fits");
    buffer[..length].to_vec()
}

/// Decodes a frame, and checks its unit and transaction identifier.
fn open(framing: Framing, frame: &mut [u8]) -> Adu<'_> {
    let adu = framing.parse(frame, ascii::END).expect("a frame");
    assert_eq!(adu.unit, UNIT);
    let transaction = if framing == Framing::Tcp {
        TRANSACTION
    } else {
        0
    };
    assert_eq!(adu.transaction, transaction);
    adu
}

/// The line with which pymodbus_peer.py describes a frame that it has read.
fn read_as(framing: &str, fields: &str) -> String {
    let transaction = if framing == "tcp" { TRANSACTION } else { 0 };
    format!("{UNIT} {transaction} {fields}")
}

fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

fn from_hex(digits: &str) -> Vec<u8> {
    let pairs = digits.as_bytes().chunks(2);
    pairs
        .map(|pair| {
            let pair = std::str::from_utf8(pair).expect("digits");
            u8::from_str_radix(pair, 16).unwrap_or_else(|_| panic!("not a frame: {digits}"))
        })
        .collect()
}
