//! Properties that hold for every request of the master and for any received bytes.

mod common;

use common::frame::sealed;
use common::master::{frame, Call, TestMaster};
use mbm::error::Status;
use mbm::frame::checksum::crc16;
use mbm::pdu::request::Request;
use proptest::prelude::*;

/// Any request that the master's ten functions can build.
fn any_request() -> impl Strategy<Value = Call> {
    let ranged = |function: u8, most: u16| {
        (any::<u16>(), 0..most + 2).prop_map(move |(a, q)| Call::new(function, &[a, q]))
    };
    prop_oneof![
        ranged(0x01, 2000),
        ranged(0x02, 2000),
        ranged(0x03, 125),
        ranged(0x04, 125),
        any::<[u16; 2]>().prop_map(|words| Call::new(0x05, &words)),
        any::<[u16; 2]>().prop_map(|words| Call::new(0x06, &words)),
        ranged(0x0F, 1968),
        ranged(0x10, 123),
        any::<[u16; 3]>().prop_map(|words| Call::new(0x16, &words)),
        (any::<u16>(), 0u16..127, any::<u16>(), 0u16..123)
            .prop_map(|(ra, rq, wa, wq)| Call::new(0x17, &[ra, rq, wa, wq])),
    ]
    .prop_filter("within the standard", |call| call.query().is_ok())
}

/// The data bytes of the right reply to `call`, generated from `seed`.
fn data(call: Call, seed: u8) -> Vec<u8> {
    let count = call.query().unwrap().reads();
    (0..count)
        .map(|i| seed.wrapping_mul(31).wrapping_add(i))
        .collect()
}

/// The right reply to `call`, with data bytes generated from `seed`.
fn right_reply(unit: u8, call: Call, seed: u8) -> Vec<u8> {
    let query = call.query().unwrap();
    if query.is_read() {
        let head = [unit, call.function, query.reads()];
        return sealed(&[&head, &data(call, seed)[..]].concat());
    }
    sealed(&frame(unit, call, &[])[..1 + usize::from(query.response_length())])
}

/// The response words after the right reply to `call`.
fn right_words(call: Call, seed: u8) -> Vec<u16> {
    let mut data = data(call, seed);
    if call.function > 2 {
        let pairs = data.chunks(2);
        return pairs
            .map(|pair| u16::from_be_bytes([pair[0], pair[1]]))
            .collect();
    }
    // The bits after the last requested one are zero.
    data.push(0);
    let quantity = usize::from(call.words[1]);
    let bit = |bit: usize| u16::from(data[bit / 8]) >> (bit % 8) & 1;
    let word = |word: usize| {
        let bits = 16 * word..quantity.min(16 * word + 16);
        bits.fold(0, |bits, at| bits | bit(at) << (at % 16))
    };
    (0..quantity.div_ceil(16)).map(word).collect()
}

/// True if a frame starts before the last `reply` bytes that looks like the reply to `call`
/// or like an exception, and whose CRC is right by chance.
fn is_answered_before(unit: u8, call: Call, bytes: &[u8], reply: usize) -> bool {
    let right = |at: usize, length: usize| {
        let frame = bytes.get(at..at + length);
        frame.is_some_and(|frame| crc16(frame).is_residue())
    };
    (0..bytes.len() - reply).any(|at| match bytes[at..] {
        [first, function, ..] if first == unit && function == call.function => right(at, reply),
        [first, function, ..] if first == unit && function == call.function | 0x80 => right(at, 5),
        _ => false,
    })
}

proptest! {
    #[test]
    fn every_emitted_request_parses_back(
        request in any_request(),
        words in prop::collection::vec(any::<u16>(), 123),
    ) {
        let frame = frame(9, request, &words);
        prop_assert!(crc16(&frame).is_residue());
        let pdu = &frame[1..frame.len() - 2];
        let received = Request::parse(pdu).expect("the master sends valid requests");
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
            other => prop_assert!(false, "{:?} is not a request of the master", other),
        }
    }

    #[test]
    fn no_byte_string_panics(
        request in any_request(),
        bytes in prop::collection::vec(any::<u8>(), 0..600),
        piece in 1usize..40,
        step in 50u32..3000,
        size in 8usize..256,
        echo: bool,
    ) {
        let _ = Request::parse(&bytes);
        let unit = bytes.first().copied().unwrap_or(1).max(1);
        let request_length = usize::from(request.query().unwrap().length()) + 3;
        let mut master = TestMaster::<false>::new(unit, size.max(request_length));
        master.0.settings().echo_discard = echo;
        let _ = master.request(request, &bytes, piece, step);
        // The bytes as the PDU of a frame. Then again after a timeout, when the master holds
        // a reply for a while because it may be a late one.
        let pdu = &bytes[..bytes.len().min(253)];
        let _ = master.request(request, &sealed(&[&[unit], pdu].concat()), piece, step);
        master.send(request, &[]);
        let _ = master.request(request, &bytes, piece, step);
    }

    #[test]
    fn a_right_reply_is_found_after_bytes_other_than_its_unit(
        request in any_request(),
        noise in prop::collection::vec(2u8..=255, 0..300),
        seed: u8,
        piece in 1usize..300,
        step in 50u32..3000,
    ) {
        let reply = right_reply(1, request, seed);
        let bytes = [noise, reply].concat();
        let right = (Status::OK, right_words(request, seed));
        prop_assert_eq!(outcome::<false>((1, 256), request, &bytes, piece, step), right.clone());
        prop_assert_eq!(outcome::<true>((1, 256), request, &bytes, piece, step), right);
    }

    #[test]
    fn a_right_reply_is_found_after_bytes_that_look_like_its_start(
        request in any_request(),
        noise in prop::collection::vec(prop::collection::vec(any::<u8>(), 0..20), 1..60),
        seed: u8,
        piece in 1usize..300,
        space in 0usize..20,
    ) {
        let reply = right_reply(17, request, seed);
        let query = request.query().unwrap();
        let head = &reply[..if query.is_read() { 3 } else { 2 }];
        let false_heads = noise.iter().flat_map(|noise| [head, noise]);
        let bytes: Vec<u8> = false_heads.flatten().chain(&reply).copied().collect();
        prop_assume!(!is_answered_before(17, request, &bytes, reply.len()));
        let least = reply.len().max(usize::from(query.length()) + 3);
        let right = (Status::OK, right_words(request, seed));
        let master = (17, least + space);
        // The polls are closer together than the silence that ends a frame.
        prop_assert_eq!(outcome::<false>(master, request, &bytes, piece, 100), right.clone());
        prop_assert_eq!(outcome::<true>(master, request, &bytes, piece, 100), right);
    }

    #[test]
    fn a_reply_with_one_flipped_bit_is_not_a_reply(
        request in any_request(),
        seed: u8,
        piece in 1usize..300,
        bit: prop::sample::Index,
    ) {
        let mut reply = right_reply(1, request, seed);
        let bit = bit.index(8 * reply.len());
        reply[bit / 8] ^= 1 << (bit % 8);
        for (status, words) in [
            outcome::<false>((1, 256), request, &reply, piece, 100),
            outcome::<true>((1, 256), request, &reply, piece, 100),
        ] {
            prop_assert!(status.is_failure(), "{:?}", status);
            prop_assert_eq!(words, []);
        }
    }

    #[test]
    fn a_right_reply_ends_the_request_with_ok(request in any_request(), seed: u8) {
        let reply = right_reply(1, request, seed);
        let mut master = TestMaster::<false>::new(1, 256);
        prop_assert_eq!(master.request(request, &reply, 300, 100), Status::OK);
        prop_assert_eq!(master.0.exception_code(), 0);
        prop_assert_eq!(master.words(), right_words(request, seed));
    }
}

fn emit_words(function: u8, words: &[u16]) -> Vec<u8> {
    let mut pdu = vec![function];
    pdu.extend(words.iter().flat_map(|word| word.to_be_bytes()));
    pdu
}

/// The status and the words of a request to which `bytes` arrive, of a master with this unit and
/// size of the frame buffer.
fn outcome<const SINGLE: bool>(
    (unit, size): (u8, usize),
    request: Call,
    bytes: &[u8],
    piece: usize,
    step: u32,
) -> (Status, Vec<u16>) {
    let mut master = TestMaster::<SINGLE>::new(unit, size);
    let status = master.request(request, bytes, piece, step);
    (status, master.words())
}
