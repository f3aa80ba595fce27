//! Frames of the specification and of other implementations' documents, byte
//! for byte: what we emit, and what we make of a reply.

mod common;

use common::{frame, Wanting};
use mbm::error::Status;
use mbm::frame::rtu::{self, Window};
use mbm::pdu::query::Query;
use mbm::pdu::request::Request;
use mbm::pdu::{bits, registers, reply};

fn build(build: impl FnOnce(&mut Query) -> Status) -> Query {
    Query::build(build).unwrap()
}

/// The PDU of a request.
fn pdu(request: &Query, words: &[u16]) -> Vec<u8> {
    let frame = frame(1, request, words);
    frame[1..frame.len() - 2].to_vec()
}

/// The status and the data bytes of a reply frame to a request.
fn reply(unit: u8, request: &Query, frame: &[u8]) -> (Status, Vec<u8>) {
    let buffer = frame.to_vec();
    let mut window = Window::EMPTY;
    window.arrived(frame.len() as u16);
    assert!(window.search(&buffer, &mut Wanting(unit, request)));
    let pdu = &buffer[rtu::PDU..buffer.len() - 2];
    let status = reply::judge(request, pdu);
    let read = status == Status::OK && request.is_read();
    (status, if read { pdu[2..].to_vec() } else { vec![] })
}

#[test]
fn requests_of_the_specification() {
    let coils = build(|r| bits::read_coils(r, 0x13, 0x13));
    assert_eq!(pdu(&coils, &[]), [1, 0, 0x13, 0, 0x13]);
    let inputs = build(|r| bits::read_discrete_inputs(r, 0xC4, 0x16));
    assert_eq!(pdu(&inputs, &[]), [2, 0, 0xC4, 0, 0x16]);
    let holding = build(|r| registers::read_holding(r, 0x6B, 3));
    assert_eq!(pdu(&holding, &[]), [3, 0, 0x6B, 0, 3]);
    let input = build(|r| registers::read_input(r, 8, 1));
    assert_eq!(pdu(&input, &[]), [4, 0, 8, 0, 1]);
    assert_eq!(
        pdu(&build(|r| bits::write_single(r, 0xAC, 1)), &[]),
        [5, 0, 0xAC, 0xFF, 0]
    );
    assert_eq!(
        pdu(&build(|r| registers::write_single(r, 1, 3)), &[]),
        [6, 0, 1, 0, 3]
    );
    let coils = build(|r| bits::write_multiple(r, 0x13, 0x0A));
    assert_eq!(
        pdu(&coils, &[0x01CD]),
        [0x0F, 0, 0x13, 0, 0x0A, 2, 0xCD, 0x01]
    );
    let registers_ = build(|r| registers::write_multiple(r, 1, 2));
    assert_eq!(
        pdu(&registers_, &[0x000A, 0x0102]),
        [0x10, 0, 1, 0, 2, 4, 0, 0x0A, 1, 2]
    );
    assert_eq!(
        pdu(&build(|r| registers::mask_write(r, 4, 0xF2, 0x25)), &[]),
        [0x16, 0, 4, 0, 0xF2, 0, 0x25]
    );
    let both = build(|r| registers::read_write(r, 3, 6, 0x0E, 3));
    assert_eq!(
        pdu(&both, &[0xFF, 0xFF, 0xFF]),
        [0x17, 0, 3, 0, 6, 0, 0x0E, 0, 3, 6, 0, 0xFF, 0, 0xFF, 0, 0xFF]
    );
}

#[test]
fn request_frames_with_their_crc() {
    let read = |function, address, quantity| match function {
        1 => build(|r| bits::read_coils(r, address, quantity)),
        2 => build(|r| bits::read_discrete_inputs(r, address, quantity)),
        3 => build(|r| registers::read_holding(r, address, quantity)),
        _ => build(|r| registers::read_input(r, address, quantity)),
    };
    let cases: &[(u8, Query, &[u16], &[u8])] = &[
        (
            0x10,
            read(1, 0x6B, 3),
            &[],
            &[0x10, 1, 0, 0x6B, 0, 3, 0x0E, 0x96],
        ),
        (
            0x10,
            read(2, 0x6B, 3),
            &[],
            &[0x10, 2, 0, 0x6B, 0, 3, 0x4A, 0x96],
        ),
        (1, read(3, 0x6B, 1), &[], &[1, 3, 0, 0x6B, 0, 1, 0xF5, 0xD6]),
        (1, read(4, 0x6B, 1), &[], &[1, 4, 0, 0x6B, 0, 1, 0x40, 0x16]),
        (
            0x11,
            build(|r| bits::write_single(r, 0x6B, 1)),
            &[],
            &[0x11, 5, 0, 0x6B, 0xFF, 0, 0xFF, 0x76],
        ),
        (
            0x11,
            build(|r| registers::write_single(r, 0x6B, 0x0101)),
            &[],
            &[0x11, 6, 0, 0x6B, 1, 1, 0x3A, 0xD6],
        ),
        (
            0x11,
            build(|r| bits::write_multiple(r, 0x0410, 3)),
            &[5],
            &[0x11, 0x0F, 4, 0x10, 0, 3, 1, 5, 0x8E, 0x1F],
        ),
        (
            0x11,
            build(|r| registers::write_multiple(r, 0x0410, 3)),
            &[0x00C8, 0x0082, 0x8701],
            &[
                0x11, 0x10, 4, 0x10, 0, 3, 6, 0, 0xC8, 0, 0x82, 0x87, 1, 0x2F, 0x7D,
            ],
        ),
        (
            0x11,
            build(|r| registers::read_write(r, 0x0410, 1, 0x0112, 2)),
            &[0x00C8, 0x0082],
            &[
                0x11, 0x17, 4, 0x10, 0, 1, 1, 0x12, 0, 2, 4, 0, 0xC8, 0, 0x82, 0x64, 0xE2,
            ],
        ),
    ];
    for (unit, request, words, expected) in cases {
        assert_eq!(frame(*unit, request, words), *expected);
    }
}

#[test]
fn reply_frames_with_their_crc() {
    let holding = build(|r| registers::read_holding(r, 0x6B, 1));
    let read = reply(1, &holding, &[1, 3, 2, 0xCD, 0x6B, 0xAD, 0x3B]);
    assert_eq!(read, (Status::OK, vec![0xCD, 0x6B]));
    let input = build(|r| registers::read_input(r, 0x6B, 1));
    let read = reply(1, &input, &[1, 4, 2, 0xCD, 0x6B, 0xAC, 0x4F]);
    assert_eq!(read, (Status::OK, vec![0xCD, 0x6B]));
    let coils = build(|r| bits::read_coils(r, 0, 16));
    let read = reply(3, &coils, &[3, 1, 2, 0xCD, 0x6B, 0xD5, 0x43]);
    assert_eq!(read, (Status::OK, vec![0xCD, 0x6B]));
    let inputs = build(|r| bits::read_discrete_inputs(r, 0, 16));
    let read = reply(3, &inputs, &[3, 2, 2, 0xCD, 0x6B, 0xD5, 0x07]);
    assert_eq!(read, (Status::OK, vec![0xCD, 0x6B]));
    let both = build(|r| registers::read_write(r, 0x0410, 1, 0x0112, 2));
    let read = reply(0x11, &both, &[0x11, 0x17, 2, 0xCD, 0x6B, 0x69, 0x08]);
    assert_eq!(read, (Status::OK, vec![0xCD, 0x6B]));
    let coils = build(|r| bits::write_multiple(r, 0x0410, 3));
    let wrote = reply(0x11, &coils, &[0x11, 0x0F, 4, 0x10, 0, 3, 0x17, 0xAF]);
    assert_eq!(wrote, (Status::OK, vec![]));
    let words = build(|r| registers::write_multiple(r, 0x0410, 3));
    let wrote = reply(0x11, &words, &[0x11, 0x10, 4, 0x10, 0, 3, 0x82, 0x6D]);
    assert_eq!(wrote, (Status::OK, vec![]));
    let coil = build(|r| bits::write_single(r, 2, 1));
    let wrote = reply(3, &coil, &[3, 5, 0, 2, 0xFF, 0, 0x2C, 0x18]);
    assert_eq!(wrote, (Status::OK, vec![]));
    let refused = reply(
        0x0A,
        &build(|r| bits::read_coils(r, 0, 8)),
        &[0x0A, 0x81, 2, 0xB0, 0x53],
    );
    assert_eq!(refused, (Status::ILLEGAL_DATA_ADDRESS, vec![]));
}

#[test]
fn a_write_reply_with_another_address_or_value_is_malformed() {
    let request = build(|r| registers::write_single(r, 0x6B, 0x0101));
    for (at, wrong) in [(1, 1), (2, 0x6C), (3, 0), (4, 0)] {
        let mut pdu = [6, 0, 0x6B, 1, 1];
        pdu[at] = wrong;
        assert_eq!(reply::judge(&request, &pdu), Status::MALFORMED_REPLY);
    }
}

#[test]
fn exception_codes_of_0_and_from_80_are_malformed() {
    let request = build(|r| registers::write_single(r, 1, 2));
    for code in 0..=255 {
        let expected = match code {
            1..=0x7F => Status::from_code(code),
            _ => Status::MALFORMED_REPLY,
        };
        assert_eq!(reply::judge(&request, &[0x86, code]), expected);
        assert_eq!(reply::exception_code(&[0x86, code]), Some(code));
    }
}

#[test]
fn quantities_and_addresses_are_held_to_the_standard() {
    use Status as S;
    let value = Err(S::ILLEGAL_DATA_VALUE);
    let address = Err(S::ILLEGAL_DATA_ADDRESS);
    let build = |build: fn(&mut Query, u16, u16) -> Status, a, q| {
        Query::build(|request| build(request, a, q)).map(|_| ())
    };
    for (most, function) in [
        (2000, bits::read_coils as fn(&mut Query, u16, u16) -> Status),
        (125, registers::read_holding),
        (1968, bits::write_multiple),
        (123, registers::write_multiple),
        (121, |r, a, q| registers::read_write(r, 0, 1, a, q)),
        (125, |r, a, q| registers::read_write(r, a, q, 0, 1)),
    ] {
        assert_eq!(build(function, 0, 0), value);
        assert_eq!(build(function, 0, 1), Ok(()));
        assert_eq!(build(function, 0, most), Ok(()));
        assert_eq!(build(function, 0, most + 1), value);
        assert_eq!(build(function, 0, 0xFFFF), value);
        assert_eq!(build(function, 0xFFFF, 1), Ok(()));
        assert_eq!(build(function, 0xFFFF, 2), address);
        assert_eq!(build(function, 0u16.wrapping_sub(most), most), Ok(()));
    }
}

#[test]
fn lying_byte_counts_and_lengths_are_refused() {
    let value = Err(Status::ILLEGAL_DATA_VALUE);
    assert_eq!(Request::parse(&[]), Err(Status::ILLEGAL_FUNCTION));
    assert_eq!(Request::parse(&[0x2C, 1]), Err(Status::ILLEGAL_FUNCTION));
    assert_eq!(Request::parse(&[3, 0, 0, 0]), value);
    assert_eq!(Request::parse(&[3, 0, 0, 0, 1, 9]), value);
    assert_eq!(Request::parse(&[5, 0, 0, 1, 0]), value);
    assert_eq!(Request::parse(&[0x10, 0, 0, 0, 1, 2, 1]), value);
    assert_eq!(Request::parse(&[0x10, 0, 0, 0, 1, 3, 1, 2, 3]), value);
    assert_eq!(Request::parse(&[0x10, 0, 0, 0, 1, 0, 1, 2]), value);
    assert_eq!(Request::parse(&[0x0F, 0, 0, 0, 9, 1, 1]), value);
    let past = Request::parse(&[3, 0xFF, 0xFF, 0, 2]);
    assert_eq!(past, Err(Status::ILLEGAL_DATA_ADDRESS));
}
