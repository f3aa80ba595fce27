//! Events on a line: noise, right and damaged replies, silence.

use crate::asked::Asked;
use crate::{naive, Input};

/// An event on the line.
#[derive(Clone, Debug)]
pub enum Event {
    Bytes(Vec<u8>),
    Silence,
}

/// The event that an input describes. Whole frames are among the events, because a fuzzer does
/// not find a right CRC itself.
pub fn event(input: &mut Input, asked: &Asked) -> Event {
    let kind = input.u8();
    let reply = |pdu: &[u8]| naive::with_crc(&[&[asked.unit], pdu].concat());
    Event::Bytes(match kind % 8 {
        0 => return Event::Silence,
        1 => input.counted().to_vec(),
        2 => naive::with_crc(input.counted()),
        3 => reply(&asked.response(input)),
        4 => {
            let mut frame = reply(&asked.response(input));
            let at = usize::from(input.u8()) % frame.len();
            frame[at] ^= input.u8();
            frame
        }
        5 => {
            let mut frame = reply(&asked.response(input));
            frame.truncate(usize::from(input.u8()) % (frame.len() + 1));
            frame
        }
        6 => reply(&[asked.function() | 0x80, input.u8()]),
        _ => asked.frame(),
    })
}
