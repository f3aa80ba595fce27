//! RTU frames: whole ones, and replies searched for in pieces of a stream, both
//! held against the naive way.
#![no_main]

use libfuzzer_sys::fuzz_target;
use mbm::error::Status;
use mbm::frame::rtu::{self, Verdict, Wanted, Window};
use mbm_fuzz::asked::Asked;
use mbm_fuzz::search::Search;
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

/// What the search is for, by the rules of the naive one.
struct Ours<'a>(&'a Asked);

impl Wanted for Ours<'_> {
    fn unit(&self) -> u8 {
        self.0.unit
    }
    fn function(&self) -> u8 {
        self.0.function()
    }
    fn length(&self, frame: &[u8]) -> Option<NonZeroU8> {
        let length = self.0.frame_length(frame)? - rtu::OVERHEAD;
        NonZeroU8::new(length as u8)
    }
    fn judge(&mut self, frame: &[u8]) -> Verdict {
        if self.0.is_answered_by(frame) {
            Verdict::Right
        } else {
            Verdict::Wrong
        }
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
    let mut naive = Search {
        asked: &asked,
        room,
        bytes: Vec::new(),
        at: 0,
    };
    let check = |window: &mut Window, naive: &mut Search, buffer: &mut [u8], skim| {
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
