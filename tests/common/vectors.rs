//! The table `tests/vectors.txt`. The C tests read it too.

// Each test file uses only a part of this module.
#![allow(dead_code)]

use mbm::error::{Error, Status};
use mbm::frame::{ascii, Framing};
use mbm::pdu::request::Request;
use mbm::pdu::response::Response;

/// Whether a PDU is a request or a response.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Direction {
    Request,
    Response,
}

/// A line of the table.
pub struct Vector {
    pub name: &'static str,
    pub direction: Direction,
    /// `None`: a PDU without framing.
    pub framing: Option<Framing>,
    /// The status of reading the whole line.
    pub status: Status,
    pub bytes: Vec<u8>,
}

/// Every line.
pub fn all() -> Vec<Vector> {
    let lines = include_str!("../vectors.txt").lines();
    let vectors: Vec<_> = lines
        .filter(|line| !line.is_empty() && !line.starts_with('#'))
        .map(|line| read(line).unwrap_or_else(|| panic!("not a vector: {line}")))
        .collect();
    assert!(vectors.len() > 300, "the table has lines missing");
    vectors
}

fn read(line: &'static str) -> Option<Vector> {
    let mut fields = line.split(" | ");
    let mut field = || fields.next();
    Some(Vector {
        name: field()?,
        direction: match field()? {
            "request" => Direction::Request,
            "response" => Direction::Response,
            _ => return None,
        },
        framing: match field()? {
            "pdu" => None,
            "rtu" => Some(Framing::Rtu),
            "tcp" => Some(Framing::Tcp),
            "ascii" => Some(Framing::Ascii),
            _ => return None,
        },
        status: Status::from_code(hexadecimal(field()?)?),
        bytes: field()?
            .split(' ')
            .map(hexadecimal)
            .collect::<Option<_>>()?,
    })
}

fn hexadecimal(digits: &str) -> Option<u8> {
    u8::from_str_radix(digits, 16).ok()
}

/// The bytes of the PDU with that name.
pub fn pdu(name: &str) -> Vec<u8> {
    let found = all().into_iter().find(|vector| vector.name == name);
    let vector = found.unwrap_or_else(|| panic!("no vector has the name {name}"));
    assert_eq!(vector.framing, None, "{name} is a frame, not a PDU");
    vector.bytes
}

/// Every valid PDU, including those in frames.
pub fn right_pdus() -> Vec<Vector> {
    let right = all()
        .into_iter()
        .filter(|vector| vector.status == Status::OK);
    right
        .map(|mut vector| {
            if let Some(framing) = vector.framing.take() {
                let adu = framing.parse(&mut vector.bytes, ascii::END);
                vector.bytes = adu.expect(vector.name).pdu.to_vec();
            }
            vector
        })
        .collect()
}

/// Reads a PDU and writes it again. Returns the written bytes, or the status that refuses
/// the PDU.
pub fn parse_and_emit(direction: Direction, pdu: &[u8]) -> Result<Vec<u8>, Error> {
    let mut buffer = [0; 253];
    let length = match direction {
        Direction::Request => Request::parse(pdu)?.emit(&mut buffer),
        Direction::Response => Response::parse(pdu)?.emit(&mut buffer),
    };
    Ok(buffer[..length.expect("a PDU that was read can be written")].to_vec())
}
