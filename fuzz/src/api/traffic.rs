//! Frames on a line: requests, and the responses of a device.

use super::records;
use super::world::{Grant, World};
use crate::frame;
use mbm::frame::Framing;
use mbm_c::*;

/// The frame of a PDU; the framing is one of MBM_FRAMING_*, modulo 4.
pub fn framed(framing: u8, transaction: u16, unit: u8, pdu: &[u8]) -> Vec<u8> {
    let framing = Framing::from_code(framing % 4).expect("one of four");
    frame::framed(framing, transaction, unit, &pdu[..pdu.len().min(253)])
}

/// The PDU of a request, most often a valid one.
pub fn pdu(w: &World) -> Vec<u8> {
    const FUNCTIONS: [u8; 24] = [
        1, 2, 3, 4, 5, 6, 7, 8, 11, 12, 15, 16, 17, 20, 21, 22, 23, 24, 43, 65, 100, 3, 16, 0,
    ];
    let function = FUNCTIONS[w.below(FUNCTIONS.len())];
    let (address, quantity) = (w.word(), w.word());
    let two = |a: u16, b: u16| [a.to_be_bytes(), b.to_be_bytes()].concat();
    let some = |count: usize| -> Vec<u8> { (0..count.min(250)).map(|at| at as u8).collect() };
    let counted = |data: Vec<u8>| [vec![data.len() as u8], data].concat();
    let body = match function {
        1..=4 | 6 => two(address, quantity),
        5 => two(address, if quantity & 1 == 0 { 0 } else { 0xFF00 }),
        7 | 11 | 12 | 17 => vec![],
        8 => two(address % 24, if w.rarely(4) { 0xFF00 } else { quantity }),
        15 => [
            two(address, quantity),
            counted(some(usize::from(quantity).div_ceil(8))),
        ]
        .concat(),
        16 => [
            two(address, quantity),
            counted(some(usize::from(quantity) * 2)),
        ]
        .concat(),
        20 => {
            let group = [
                vec![6],
                two(1 + address % 3, quantity),
                vec![0, w.byte() % 8],
            ]
            .concat();
            counted(group.repeat(1 + w.below(3)))
        }
        21 => {
            let words = 1 + w.below(6);
            let head = [
                vec![6],
                two(1 + address % 3, quantity),
                vec![0, words as u8],
            ];
            counted(
                [head.concat(), some(2 * words)]
                    .concat()
                    .repeat(1 + w.below(3)),
            )
        }
        22 => [two(address, quantity), vec![0, 9]].concat(),
        23 => {
            let words = 1 + w.below(8);
            let written = two(quantity, words as u16);
            [
                two(address, 1 + w.word() % 125),
                written,
                counted(some(2 * words)),
            ]
            .concat()
        }
        24 => address.to_be_bytes().to_vec(),
        43 => vec![14, 1 + w.byte() % 4, w.byte() % 8],
        _ => some(w.below(40)),
    };
    [vec![function], body].concat()
}

/// The frame of a request, sometimes damaged.
pub fn request(w: &World, framing: u8) -> Vec<u8> {
    let pdu = pdu(w);
    let frame = framed(framing, w.word(), w.unit_id(), &pdu);
    maybe_damaged(w, frame)
}

/// Damages a frame; most often it leaves it unchanged.
fn maybe_damaged(w: &World, mut frame: Vec<u8>) -> Vec<u8> {
    if frame.is_empty() {
        return frame;
    }
    match w.byte() {
        0xF8.. => frame.truncate(w.below(frame.len())),
        0xF0.. => {
            let at = w.below(frame.len());
            frame[at] ^= w.byte();
        }
        0xE8.. => frame.extend_from_within(..),
        0xE4.. => frame.insert(0, w.byte()),
        0xE0.. => frame = (0..w.byte()).map(|_| w.byte()).collect(),
        _ => {}
    }
    frame
}

/// The device's responses to the requests in `written`.
pub fn answer(w: &World, framing: u8, written: &[u8]) -> Vec<u8> {
    let mut answers = Vec::new();
    let mut rest = written;
    while !rest.is_empty() {
        let length = match rest {
            [_, _, _, _, high, low, ..] if framing == MBM_FRAMING_TCP => {
                6 + usize::from(u16::from_be_bytes([*high, *low]))
            }
            _ => rest.len(),
        };
        let (frame, others) = rest.split_at(length.min(rest.len()));
        rest = others;
        answers.extend(maybe_damaged(w, respond(w, framing, frame)));
    }
    answers
}

/// The device's response to one frame; empty if the frame is longer than any valid one.
fn respond(w: &World, framing: u8, frame: &[u8]) -> Vec<u8> {
    if w.device.get().is_null() {
        w.device.set(records::device(w));
    }
    let mut buffer = vec![0; 600];
    let Some(place) = buffer.get_mut(..frame.len()) else {
        return Vec::new();
    };
    place.copy_from_slice(frame);
    let mut length = 0;
    w.before(std::ptr::null::<mbm_unit>());
    // SAFETY: a valid unit, and a buffer of the given length.
    unsafe {
        w.inside(Grant::Nothing, || {
            mbm_unit_respond(
                w.device.get(),
                1,
                std::ptr::null_mut(),
                In::from(&mbm_framing {
                    functions: std::ptr::null(),
                    functionCount: 0,
                    kind: framing,
                    delimiter: 0,
                }),
                buffer.as_mut_ptr(),
                frame.len() as u16,
                buffer.len() as u16,
                &raw mut length,
            )
        });
    }
    w.after();
    buffer.truncate(length.into());
    buffer
}
