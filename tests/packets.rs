//! Every line of `tests/vectors.txt`: PDUs, and whole frames with their CRC or LRC.

#[path = "common/vectors.rs"]
mod vectors;

use mbm::error::{Error, Status};
use mbm::frame::{ascii, Framing};
use std::collections::HashSet;
use vectors::{all, parse_and_emit, right_pdus, Direction, Vector};

/// Reads a frame and the PDU in it, and writes both again.
fn frame_again(framing: Framing, vector: &Vector) -> Result<Vec<u8>, Error> {
    let mut bytes = vector.bytes.clone();
    let adu = framing.parse(&mut bytes, ascii::END)?;
    let pdu = parse_and_emit(vector.direction, adu.pdu)?;
    let mut buffer = [0; ascii::MAX_FRAME];
    let length = framing.emit(
        &mut buffer,
        adu.transaction,
        adu.unit,
        ascii::END,
        |place| {
            place[..pdu.len()].copy_from_slice(&pdu);
            Ok(pdu.len())
        },
    )?;
    Ok(buffer[..length].to_vec())
}

#[test]
fn every_vector_reads_as_the_table_says_and_is_written_again_byte_for_byte() {
    for vector in all() {
        let again = match vector.framing {
            None => parse_and_emit(vector.direction, &vector.bytes),
            Some(framing) => frame_again(framing, &vector),
        };
        // mbm writes hexadecimal digits in upper case.
        let bytes = match vector.framing {
            Some(Framing::Ascii) => vector.bytes.to_ascii_uppercase(),
            _ => vector.bytes,
        };
        let expected = match vector.status {
            Status::OK => Ok(bytes),
            refused => refused.result().map(|()| bytes),
        };
        assert_eq!(again, expected, "{}", vector.name);
    }
}

#[test]
fn names_of_vectors_are_unique() {
    let mut names = HashSet::new();
    for vector in all() {
        assert!(
            names.insert(vector.name),
            "the table has {} twice",
            vector.name
        );
    }
}

#[test]
fn a_packet_with_a_wrong_crc_is_refused_although_its_pdu_is_valid() {
    let wrong = all().into_iter().filter(|vector| {
        vector.framing == Some(Framing::Rtu)
            && vector.status == Status::INVALID_CRC
            && vector.direction == Direction::Response
    });
    let names: Vec<_> = wrong
        .map(|vector| {
            let pdu = &vector.bytes[1..vector.bytes.len() - 2];
            let again = parse_and_emit(vector.direction, pdu);
            assert_eq!(again.as_deref(), Ok(pdu), "{}", vector.name);
            vector.name
        })
        .collect();
    assert_eq!(names, ["read-server-id-rtu-answer"]);
}

#[test]
fn every_pdu_can_be_sent_in_every_framing() {
    let framings = [
        Framing::Rtu,
        Framing::Ascii,
        Framing::Tcp,
        Framing::RtuOverTcp,
    ];
    for framing in framings {
        for vector in right_pdus() {
            let mut buffer = vec![0; framing.max_frame()];
            let length = framing.emit(&mut buffer, 0x1234, 17, ascii::END, |place| {
                place[..vector.bytes.len()].copy_from_slice(&vector.bytes);
                Ok(vector.bytes.len())
            });
            buffer.truncate(length.expect(vector.name));
            let adu = framing.parse(&mut buffer, ascii::END).expect(vector.name);
            let transaction = if framing == Framing::Tcp { 0x1234 } else { 0 };
            assert_eq!((adu.transaction, adu.unit), (transaction, 17));
            assert_eq!(adu.pdu, vector.bytes, "{} in {framing:?}", vector.name);
        }
    }
}

/// Every truncation of a frame, and the frame with every other value of every byte.
fn damaged(frame: &[u8]) -> impl Iterator<Item = Vec<u8>> + '_ {
    let truncated = (0..frame.len()).map(|length| frame[..length].to_vec());
    let changed = (0..frame.len()).flat_map(move |at| {
        (1..=255).map(move |difference| {
            let mut bytes = frame.to_vec();
            bytes[at] ^= difference;
            bytes
        })
    });
    truncated.chain(changed)
}

#[test]
fn an_rtu_frame_with_a_changed_or_missing_byte_is_refused() {
    for vector in all() {
        if vector.framing == Some(Framing::Rtu) && vector.status == Status::OK {
            for mut bytes in damaged(&vector.bytes) {
                let refused = Framing::Rtu.parse(&mut bytes, ascii::END).unwrap_err();
                let expected = match bytes.len() {
                    0..=3 => Status::INCOMPLETE_FRAME,
                    _ => Status::INVALID_CRC,
                };
                assert_eq!(refused, expected, "{} as {bytes:02X?}", vector.name);
            }
        }
    }
}

#[test]
fn an_ascii_frame_with_a_changed_or_missing_character_is_refused_unless_only_its_case_changed() {
    for vector in all() {
        if vector.framing == Some(Framing::Ascii) && vector.status == Status::OK {
            let mut right = vector.bytes.clone();
            let right = Framing::Ascii.parse(&mut right, ascii::END).unwrap();
            for damaged in damaged(&vector.bytes) {
                let mut bytes = damaged.clone();
                if let Ok(adu) = Framing::Ascii.parse(&mut bytes, ascii::END) {
                    assert!(damaged.eq_ignore_ascii_case(&vector.bytes));
                    assert_eq!(adu, right);
                }
            }
        }
    }
}

#[test]
fn a_tcp_frame_with_a_changed_or_missing_byte_is_refused_or_written_again_unchanged() {
    for vector in all() {
        if vector.framing == Some(Framing::Tcp) && vector.status == Status::OK {
            for damaged in damaged(&vector.bytes) {
                let mut bytes = damaged.clone();
                let Ok(adu) = Framing::Tcp.parse(&mut bytes, ascii::END) else {
                    // Only a changed protocol or length in the header makes it invalid.
                    let whole = damaged.len() == vector.bytes.len();
                    assert!(!whole || damaged[2..6] != vector.bytes[2..6]);
                    continue;
                };
                let (transaction, unit) = (adu.transaction, adu.unit);
                let pdu = adu.pdu.to_vec();
                if let Ok(pdu) = parse_and_emit(vector.direction, &pdu) {
                    let again = Framing::Tcp.emit(&mut bytes, transaction, unit, 0, |place| {
                        place.copy_from_slice(&pdu);
                        Ok(pdu.len())
                    });
                    assert_eq!((again, bytes), (Ok(damaged.len()), damaged));
                }
            }
        }
    }
}
