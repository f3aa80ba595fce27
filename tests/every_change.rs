//! Every truncation and every one-byte change of every valid PDU, and the lengths that
//! follow from its first bytes.

#[path = "common/vectors.rs"]
mod vectors;

use mbm::error::Error;
use mbm::pdu::custom::{Function, Rule};
use mbm::pdu::length::{self, Length};
use vectors::{all, parse_and_emit, right_pdus, Direction, Vector};

/// The user-defined functions among the vectors.
const FUNCTIONS: [Function; 2] = [
    Function {
        code: 0x41,
        request: Rule::Fixed(3),
        response: Rule::Silence,
    },
    Function {
        code: 0x6E,
        request: Rule::Fixed(1),
        response: Rule::Counted(1, 0),
    },
];

fn length(direction: Direction, pdu: &[u8]) -> Length {
    match direction {
        Direction::Request => length::request(pdu, &FUNCTIONS),
        Direction::Response => length::response(pdu, &FUNCTIONS),
    }
}

/// Panics unless the PDU is read and written again unchanged, or refused with a status that
/// such a PDU can have.
fn right_or_refused(direction: Direction, pdu: &[u8]) {
    let expected: &[Error] = match direction {
        Direction::Request => &[
            Error::IllegalFunction,
            Error::IllegalDataAddress,
            Error::IllegalDataValue,
        ],
        Direction::Response => &[Error::InvalidFunction, Error::MalformedReply],
    };
    match parse_and_emit(direction, pdu) {
        Ok(again) => assert_eq!(again, pdu),
        Err(refused) => assert!(expected.contains(&refused), "{refused:?} of {pdu:02X?}"),
    }
}

/// True for a Report Server ID response whose byte count covers only the id, although more
/// data follow.
fn counts_too_little(vector: &Vector) -> bool {
    vector.direction == Direction::Response && vector.name.starts_with("read-server-id")
}

/// True for PDUs that do not contain their length: a shorter or longer one may be valid too.
fn ends_with_silence(vector: &Vector) -> bool {
    counts_too_little(vector) || length(vector.direction, &vector.bytes) == Length::Silence
}

#[test]
fn every_truncated_pdu_that_contains_its_length_is_refused() {
    for vector in right_pdus() {
        for end in 0..vector.bytes.len() {
            let part = &vector.bytes[..end];
            right_or_refused(vector.direction, part);
            let user = matches!(vector.bytes[0], 0x41 | 0x6E);
            if !ends_with_silence(&vector) && !user {
                let refused = parse_and_emit(vector.direction, part).unwrap_err();
                let expected = match vector.direction {
                    Direction::Request if end == 0 => Error::IllegalFunction,
                    Direction::Request => Error::IllegalDataValue,
                    Direction::Response => Error::MalformedReply,
                };
                assert_eq!(refused, expected, "{} cut to {end}", vector.name);
            }
        }
    }
}

#[test]
fn every_longer_pdu_that_contains_its_length_is_refused() {
    for vector in right_pdus() {
        let mut longer = vector.bytes.clone();
        longer.push(0);
        right_or_refused(vector.direction, &longer);
        let user = matches!(vector.bytes[0], 0x41 | 0x6E);
        let server_id = vector.direction == Direction::Response && vector.bytes[0] == 0x11;
        if !ends_with_silence(&vector) && !user && !server_id {
            let refused = parse_and_emit(vector.direction, &longer).unwrap_err();
            let expected = match vector.direction {
                Direction::Request => Error::IllegalDataValue,
                Direction::Response => Error::MalformedReply,
            };
            assert_eq!(refused, expected, "{} and a byte more", vector.name);
        }
    }
}

#[test]
fn every_change_of_one_byte_is_read_correctly_or_refused() {
    for vector in all() {
        if vector.framing.is_none() {
            for at in 0..vector.bytes.len() {
                for difference in 1..=255 {
                    let mut changed = vector.bytes.clone();
                    changed[at] ^= difference;
                    right_or_refused(vector.direction, &changed);
                }
            }
        }
    }
}

#[test]
fn requests_read_as_responses_and_responses_read_as_requests_are_read_correctly_or_refused() {
    for vector in all() {
        if vector.framing.is_none() {
            right_or_refused(Direction::Request, &vector.bytes);
            right_or_refused(Direction::Response, &vector.bytes);
        }
    }
}

#[test]
fn the_length_of_every_prefix_agrees_with_the_whole() {
    for vector in right_pdus() {
        let whole = vector.bytes.len();
        if counts_too_little(&vector) {
            continue;
        }
        for end in 0..=whole {
            match length(vector.direction, &vector.bytes[..end]) {
                Length::Exactly(length) => assert_eq!(length, whole, "{}", vector.name),
                Length::AtLeast(least) => {
                    assert!(end < least && least <= whole, "{} to {end}", vector.name);
                }
                Length::Silence => assert!(end > 0, "{}", vector.name),
                Length::Unknown => panic!("{} is unknown", vector.name),
            }
        }
    }
}

#[test]
fn a_known_length_does_not_change_with_the_bytes_that_follow() {
    for vector in right_pdus() {
        let mut known = None;
        for end in 0..=vector.bytes.len() {
            match length(vector.direction, &vector.bytes[..end]) {
                Length::AtLeast(_) => assert_eq!(known, None, "{}", vector.name),
                length => assert_eq!(*known.get_or_insert(length), length),
            }
        }
        assert!(
            known.is_some(),
            "the length of {} stays unknown",
            vector.name
        );
    }
}

#[test]
fn a_server_id_whose_count_is_too_small_is_as_long_as_its_count_says() {
    let short: Vec<_> = right_pdus().into_iter().filter(counts_too_little).collect();
    assert_eq!(short.len(), 2);
    for vector in short {
        let length = length::response(&vector.bytes, &[]);
        assert_eq!(length, Length::Exactly(2 + usize::from(vector.bytes[1])));
        assert!(vector.bytes.len() > 4);
    }
}

#[test]
fn a_byte_count_that_overflows_gives_a_length_beyond_any_pdu() {
    let fifo = length::response(&[0x18, 0xFF, 0xFF], &[]);
    assert_eq!(fifo, Length::Exactly(65535));
    let fifo = length::response(&[0x18, 0xFF, 0xFB], &[]);
    assert_eq!(fifo, Length::Exactly(0xFFFE));
    let write = length::request(&[0x10, 0, 0, 0, 1, 0xFF], &[]);
    assert_eq!(write, Length::Exactly(261));
    let both = length::request(&[0x17, 0, 0, 0, 1, 0, 0, 0, 1, 0xFF], &[]);
    assert_eq!(both, Length::Exactly(265));
    let log = length::response(&[0x0C, 0xFF], &[]);
    assert_eq!(log, Length::Exactly(257));
}

#[test]
fn the_length_of_an_undeclared_function_is_unknown() {
    for code in 0..=255u8 {
        let public = mbm::pdu::is_public(code);
        let differ = "of src/pdu/length.rs and `is_public` of src/pdu/mod.rs differ";
        let known = length::request(&[code], &[]) != Length::Unknown;
        assert_eq!(known, public, "{code:02X}: `request` {differ}");
        let known = length::response(&[code], &[]) != Length::Unknown;
        assert_eq!(
            known,
            public || code >= 0x80,
            "{code:02X}: `response` {differ}"
        );
    }
}

#[test]
fn every_exception_has_two_bytes() {
    for code in 0x80..=0xFF {
        for pdu in [&[code][..], &[code, 1]] {
            assert_eq!(length::response(pdu, &FUNCTIONS), Length::Exactly(2));
        }
    }
}
