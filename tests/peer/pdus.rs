//! PDUs in both directions: pymodbus reads those of mbm, and mbm reads those of pymodbus.

#[path = "../common/vectors.rs"]
mod vectors;

use crate::process::query;
use crate::{frame, from_hex, hex, open, read_as, FRAMINGS};
use mbm::error::Error;
use vectors::{parse_and_emit, Direction};

/// A line of the table `pdus.txt`.
struct Row {
    direction: Direction,
    pdu: Vec<u8>,
    /// What builds the PDU in pymodbus.
    built_by: &'static str,
    /// What pymodbus reads.
    fields: &'static str,
    /// pymodbus reads nothing in RTU framing.
    not_over_rtu: bool,
}

fn rows(direction: Direction) -> Vec<Row> {
    let lines = include_str!("pdus.txt").lines();
    let rows = lines
        .filter(|line| !line.is_empty() && !line.starts_with('#'))
        .map(|line| match line.split(" | ").collect::<Vec<_>>()[..] {
            [kind, pdu, built_by, fields, ref over_rtu @ ..] => Row {
                direction: match kind {
                    "request" => Direction::Request,
                    "response" => Direction::Response,
                    _ => panic!("not a row: {line}"),
                },
                pdu: from_hex(&pdu.replace(' ', "")),
                built_by,
                fields,
                not_over_rtu: over_rtu == ["not over rtu"],
            },
            _ => panic!("not a row: {line}"),
        })
        .filter(|row| row.direction == direction)
        .collect::<Vec<_>>();
    assert!(rows.len() > 35, "the table has lines missing");
    rows
}

/// The PDU as mbm reads it and writes it again.
fn written_by_mbm(direction: Direction, pdu: &[u8]) -> Vec<u8> {
    parse_and_emit(direction, pdu).unwrap_or_else(|why| panic!("{}: {why:?}", hex(pdu)))
}

fn frame_of(framing: mbm::frame::Framing, bytes: &[u8]) -> Vec<u8> {
    frame(framing, |pdu| {
        pdu[..bytes.len()].copy_from_slice(bytes);
        Ok(bytes.len())
    })
}

fn check_pymodbus_reads_mbm(direction: Direction, verb: &str) {
    for row in rows(direction) {
        let written = written_by_mbm(direction, &row.pdu);
        assert_eq!(written, row.pdu);
        for (framing, name) in FRAMINGS {
            let sent = hex(&frame_of(framing, &written));
            let read = query(&format!("{verb} {name} {sent}"));
            if row.not_over_rtu && name == "rtu" {
                assert_eq!(read, "nothing", "{}", row.built_by);
            } else {
                assert_eq!(read, read_as(name, row.fields), "{name}");
            }
        }
    }
}

fn check_mbm_reads_pymodbus(direction: Direction, verb: &str) {
    for row in rows(direction) {
        for (framing, name) in FRAMINGS {
            let mut sent = from_hex(&query(&format!("{verb} {name} {}", row.built_by)));
            assert_eq!(sent, frame_of(framing, &row.pdu), "{name} {}", row.built_by);
            let adu = open(framing, &mut sent);
            assert_eq!(written_by_mbm(direction, adu.pdu), row.pdu);
        }
    }
}

#[test]
fn request_is_read_by_pymodbus() {
    check_pymodbus_reads_mbm(Direction::Request, "request");
}

#[test]
fn request_of_pymodbus_is_read() {
    check_mbm_reads_pymodbus(Direction::Request, "call");
}

#[test]
fn response_is_read_by_pymodbus() {
    check_pymodbus_reads_mbm(Direction::Response, "response");
}

#[test]
fn response_of_pymodbus_is_read() {
    check_mbm_reads_pymodbus(Direction::Response, "reply");
}

/// What mbm makes of a PDU that pymodbus builds.
fn check_refused(direction: Direction, built_by: &str, why: Error) {
    for (framing, name) in FRAMINGS {
        let mut sent = from_hex(&query(&format!(
            "{} {name} {built_by}",
            match direction {
                Direction::Request => "call",
                Direction::Response => "reply",
            }
        )));
        let adu = open(framing, &mut sent);
        assert_eq!(parse_and_emit(direction, adu.pdu), Err(why), "{built_by}");
    }
}

#[test]
fn reserved_sub_functions_are_refused_though_pymodbus_has_them() {
    for call in [
        "diag_read_iop_overrun_count()",
        "diag_getclear_modbus_response(data=3)",
    ] {
        check_refused(Direction::Request, call, Error::IllegalFunction);
    }
}

#[test]
fn a_delimiter_in_the_low_byte_is_refused_though_pymodbus_sends_it_there() {
    let call = "diag_change_ascii_input_delimeter(delimiter=0x21)";
    check_refused(Direction::Request, call, Error::IllegalDataValue);
}

#[test]
fn a_response_to_force_listen_only_is_malformed_though_pymodbus_sends_one() {
    let response = "ForceListenOnlyModeResponse()";
    check_refused(Direction::Response, response, Error::MalformedReply);
}
