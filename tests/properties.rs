//! What holds for every request and for every string of bytes.

mod common;

use common::{frame, Wanting};
use mbm::error::Status;
use mbm::frame::checksum::crc16;
use mbm::frame::rtu::Window;
use mbm::pdu::query::Query;
use mbm::pdu::request::Request;
use mbm::pdu::{bits, registers, reply};
use proptest::prelude::*;

fn build(build: impl FnOnce(&mut Query) -> Status) -> Option<Query> {
    Query::build(build).ok()
}

/// Any request that the ten functions build.
fn any_request() -> impl Strategy<Value = Query> {
    prop_oneof![
        (any::<u16>(), 0u16..2002).prop_map(|(a, q)| build(|r| bits::read_coils(r, a, q))),
        (any::<u16>(), 0u16..2002)
            .prop_map(|(a, q)| build(|r| bits::read_discrete_inputs(r, a, q))),
        (any::<u16>(), 0u16..127).prop_map(|(a, q)| build(|r| registers::read_holding(r, a, q))),
        (any::<u16>(), 0u16..127).prop_map(|(a, q)| build(|r| registers::read_input(r, a, q))),
        any::<(u16, u16)>().prop_map(|(a, on)| build(|r| bits::write_single(r, a, on))),
        any::<(u16, u16)>().prop_map(|(a, v)| build(|r| registers::write_single(r, a, v))),
        (any::<u16>(), 0u16..1970).prop_map(|(a, q)| build(|r| bits::write_multiple(r, a, q))),
        (any::<u16>(), 0u16..125).prop_map(|(a, q)| build(|r| registers::write_multiple(r, a, q))),
        any::<(u16, u16, u16)>().prop_map(|(a, b, c)| build(|r| registers::mask_write(r, a, b, c))),
        (any::<u16>(), 0u16..127, any::<u16>(), 0u16..123)
            .prop_map(|(ra, rq, wa, wq)| build(|r| registers::read_write(r, ra, rq, wa, wq))),
    ]
    .prop_filter_map("within the standard", |request| request)
}

/// A right reply to `request`, with data bytes from `seed`.
fn right_reply(unit: u8, request: &Query, seed: u8) -> Vec<u8> {
    let sent = frame(unit, request, &[]);
    let mut frame = if request.is_read() {
        let count = request.response_length() - 2;
        let mut frame = vec![unit, request.function(), count];
        frame.extend((0..count).map(|i| seed.wrapping_mul(31).wrapping_add(i)));
        frame
    } else {
        sent[..1 + usize::from(request.response_length())].to_vec()
    };
    frame.extend(crc16(&frame).to_bytes());
    frame
}

/// Feeds `bytes` in pieces and returns the first frame's PDU.
fn find(unit: u8, request: &Query, bytes: &[u8], piece: usize, size: usize) -> Option<Vec<u8>> {
    let mut buffer = vec![0; size];
    let mut window = Window::EMPTY;
    let mut rest = bytes;
    loop {
        let found = window.search(&mut buffer, &mut Wanting(unit, request));
        if found {
            let pdu = &window.bytes(&buffer)?[1..];
            let length = reply::expected(request, pdu).map(|length| usize::from(length.get()));
            return Some(pdu[..length?].to_vec());
        }
        if rest.is_empty() {
            return None;
        }
        let room = window.room(&mut buffer).expect("room");
        let count = rest.len().min(piece).min(room.len());
        assert!(count > 0, "a full window asks for more");
        room[..count].copy_from_slice(&rest[..count]);
        window.arrived(count as u16);
        rest = &rest[count..];
    }
}

proptest! {
    #[test]
    fn every_emitted_request_parses_back(
        request in any_request(),
        words in prop::collection::vec(any::<u16>(), 123),
    ) {
        let frame = frame(9, &request, &words);
        prop_assert!(crc16(&frame).is_residue());
        let pdu = &frame[1..frame.len() - 2];
        let received = Request::parse(pdu).expect("a request of ours is in order");
        let data = |words: &[u16]| -> Vec<u8> {
            words.iter().flat_map(|word| word.to_be_bytes()).collect()
        };
        match received {
            Request::ReadBits { function, address, quantity } => {
                prop_assert_eq!(pdu, emit_words(function, &[address, quantity]));
            }
            Request::ReadRegisters { function, address, quantity } => {
                prop_assert_eq!(pdu, emit_words(function, &[address, quantity]));
            }
            Request::WriteSingleCoil { address, on } => {
                prop_assert_eq!(pdu, emit_words(5, &[address, if on { 0xFF00 } else { 0 }]));
            }
            Request::WriteSingleRegister { address, value } => {
                prop_assert_eq!(pdu, emit_words(6, &[address, value]));
            }
            Request::MaskWriteRegister { address, and_mask, or_mask } => {
                prop_assert_eq!(pdu, emit_words(0x16, &[address, and_mask, or_mask]));
            }
            Request::WriteMultipleCoils { quantity, data, .. } => {
                for bit in 0..8 * data.len() {
                    let on = words[bit / 16] >> (bit % 16) & 1 == 1 && bit < usize::from(quantity);
                    prop_assert_eq!(data[bit / 8] >> (bit % 8) & 1 == 1, on);
                }
            }
            Request::WriteMultipleRegisters { quantity, data: sent, .. } => {
                prop_assert_eq!(sent, data(&words[..usize::from(quantity)]));
            }
            Request::ReadWriteMultipleRegisters { write_quantity, data: sent, .. } => {
                prop_assert_eq!(sent, data(&words[..usize::from(write_quantity)]));
            }
            other => prop_assert!(false, "{:?} is no request of the facade", other),
        }
    }

    #[test]
    fn no_byte_string_panics(
        request in any_request(),
        bytes in prop::collection::vec(any::<u8>(), 0..600),
        piece in 1usize..40,
        size in 8usize..256,
    ) {
        let _ = Request::parse(&bytes);
        let _ = reply::judge(&request, &bytes);
        let _ = request.take(&mut [0; 125], &bytes);
        let _ = find(bytes.first().copied().unwrap_or(1), &request, &bytes, piece, size);
    }

    #[test]
    fn a_right_reply_is_found_behind_bytes_that_are_not_our_unit(
        request in any_request(),
        noise in prop::collection::vec(2u8..=255, 0..300),
        seed: u8,
        piece in 1usize..300,
    ) {
        let reply = right_reply(1, &request, seed);
        let bytes: Vec<u8> = noise.iter().chain(&reply).copied().collect();
        let pdu = find(1, &request, &bytes, piece, 256);
        prop_assert_eq!(pdu.as_deref(), Some(&reply[1..reply.len() - 2]));
    }

    #[test]
    fn a_reply_with_one_flipped_bit_is_not_a_reply(
        request in any_request(),
        seed: u8,
        bit: prop::sample::Index,
    ) {
        let mut reply = right_reply(1, &request, seed);
        let bit = bit.index(8 * reply.len());
        reply[bit / 8] ^= 1 << (bit % 8);
        prop_assert_eq!(find(1, &request, &reply, 300, 256), None);
    }

    #[test]
    fn a_right_reply_is_judged_a_success(request in any_request(), seed: u8) {
        let reply = right_reply(1, &request, seed);
        prop_assert_eq!(reply::judge(&request, &reply[1..reply.len() - 2]), Status::OK);
    }
}

fn emit_words(function: u8, words: &[u16]) -> Vec<u8> {
    let mut pdu = vec![function];
    pdu.extend(words.iter().flat_map(|word| word.to_be_bytes()));
    pdu
}
