//! RTU frames: whole ones, and replies searched for in pieces of a stream, both
//! held against the naive way.
#![no_main]

use libfuzzer_sys::fuzz_target;
use mbm::error::Status;
use mbm::frame::rtu::{self, Verdict, Wanted, Window};
use mbm::pdu::reply;
use mbm_fuzz::asked::Asked;
use mbm_fuzz::stream::{event, Event};
use mbm_fuzz::{naive, Input};
use std::num::NonZeroU8;

fuzz_target!(|data: &[u8]| {
    whole(data);
    whole(&naive::with_crc(data));
    search(Input(data));
});

fn whole(frame: &[u8]) {
    let expected = match frame.len() {
        0..=3 => Err(Status::INCOMPLETE_FRAME),
        257.. => Err(Status::MALFORMED_FRAME),
        _ if !naive::has_crc(frame) => Err(Status::INVALID_CRC),
        length => Ok((frame[0], &frame[1..length - 2])),
    };
    let parsed = rtu::parse(frame);
    assert_eq!(parsed.map(|adu| (adu.unit, adu.pdu)), expected);
    if let Ok(adu) = parsed {
        let mut buffer = [0; rtu::MAX_FRAME];
        let length = rtu::emit(&mut buffer, adu.unit, |pdu| {
            pdu[..adu.pdu.len()].copy_from_slice(adu.pdu);
            Ok(adu.pdu.len())
        });
        assert_eq!(&buffer[..length.expect("it fits")], frame);
    }
}

/// What the search is for, by mbm's own rules.
struct Ours<'a>(&'a Asked);

impl Wanted for Ours<'_> {
    fn unit(&self) -> u8 {
        self.0.unit
    }
    fn function(&self) -> u8 {
        self.0.function()
    }
    fn length(&self, frame: &[u8]) -> Option<NonZeroU8> {
        match frame {
            [unit, pdu @ ..] if *unit == self.0.unit => reply::expected(&self.0.query, pdu),
            _ => None,
        }
    }
    fn judge(&mut self, frame: &[u8]) -> Verdict {
        match reply::judge(&self.0.query, &frame[rtu::PDU..frame.len() - 2]) {
            Status::MALFORMED_REPLY => Verdict::Wrong,
            _ => Verdict::Right,
        }
    }
}

/// All that ever arrived, looked through from a position on.
struct Naive<'a> {
    asked: &'a Asked,
    room: usize,
    bytes: Vec<u8>,
    at: usize,
}

impl Naive<'_> {
    /// The frame that answers; looks behind what is not complete if `skim`.
    fn search(&mut self, skim: bool) -> Option<Vec<u8>> {
        let mut at = self.at;
        while at < self.bytes.len() {
            let rest = &self.bytes[at..];
            let length = self.asked.frame_length(rest);
            match length.and_then(|length| rest.get(..length)) {
                Some(frame) if naive::has_crc(frame) => {
                    let (right, found) = (self.asked.is_answered_by(frame), frame.to_vec());
                    at += found.len();
                    self.at = at;
                    if right {
                        return Some(found);
                    }
                    continue;
                }
                Some(_) => {}
                // What the buffer cannot hold is passed over.
                None if length.is_some_and(|length| length <= self.room) && !skim => break,
                None => {}
            }
            at += 1;
        }
        if !skim {
            self.at = at;
        }
        None
    }
}

fn search(mut input: Input) {
    let Some(asked) = Asked::new(&mut input) else {
        return;
    };
    let room = 8 + usize::from(input.u8()) % 249;
    let piece = 1 + usize::from(input.u8());
    let mut buffer = vec![0; room];
    let mut window = Window::EMPTY;
    let mut naive = Naive {
        asked: &asked,
        room,
        bytes: Vec::new(),
        at: 0,
    };
    let check = |window: &mut Window, naive: &mut Naive, buffer: &mut [u8], skim| {
        let found = window
            .search(buffer, &mut Ours(&asked))
            .then(|| window.bytes(buffer).expect("within the buffer"));
        let expected = naive.search(skim);
        match (found, &expected) {
            (Some(found), Some(expected)) => assert!(found.starts_with(expected)),
            (found, expected) => assert_eq!(found, expected.as_deref()),
        }
        expected.is_some()
    };
    while !input.is_empty() {
        match event(&mut input, &asked) {
            Event::Silence => {
                window.skim();
                if check(&mut window, &mut naive, &mut buffer, true) {
                    return;
                }
            }
            Event::Bytes(bytes) => {
                let mut rest = &bytes[..];
                while !rest.is_empty() {
                    let place = window.room(&mut buffer).expect("room");
                    assert!(!place.is_empty(), "a full window asks for more");
                    let (now, later) = rest.split_at(piece.min(place.len()).min(rest.len()));
                    place[..now.len()].copy_from_slice(now);
                    window.arrived(now.len() as u16);
                    naive.bytes.extend_from_slice(now);
                    rest = later;
                    if check(&mut window, &mut naive, &mut buffer, false) {
                        return;
                    }
                }
            }
        }
    }
}
