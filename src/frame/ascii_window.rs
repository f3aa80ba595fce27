//! Finds the ASCII frame that answers: a colon begins one, whatever was before.

use super::ascii::{self, END, RETURN, START};
use super::search::{Found, Search, Seen, Verdict, Wanted};
use crate::bytes::move_to_front;
use crate::error::Status;

/// Over the characters that arrived; the buffer is the caller's and is passed
/// to each call.
#[derive(Clone, Copy, Debug)]
pub struct Window {
    /// Where what was not looked at starts, and where what arrived ends.
    start: u16,
    end: u16,
    /// Characters of the frame that was found.
    found: u16,
    seen: Seen,
    foreign: u8,
    noise: bool,
    skim: bool,
    /// The character that ends a frame (08, sub-function 03).
    pub delimiter: u8,
}

impl Window {
    fn pass(&mut self, count: usize) {
        self.start += count as u16;
    }

    fn see(&mut self, what: Seen) {
        if self.seen < what {
            self.seen = what;
        }
    }

    /// Looks at the frame that ends at the end of `frame`; true if it is the one.
    fn judge(&mut self, frame: &mut [u8], wanted: &mut impl Wanted) -> bool {
        let length = match ascii::parse(frame, self.delimiter) {
            Ok(adu) => adu.pdu.len(),
            Err(Status::INVALID_CRC) => {
                // The unit stands decoded in front.
                if frame.first() == Some(&wanted.unit()) {
                    self.see(Seen::BAD_CRC);
                }
                return false;
            }
            Err(_) => {
                self.noise = true;
                return false;
            }
        };
        // Unit, PDU, LRC, and one byte more: as many as an RTU frame has.
        let content = frame.get(..length + 3).unwrap_or_default();
        let (unit, function) = match *content {
            [unit, function, ..] => (unit, function & 0x7F),
            _ => return false,
        };
        wanted.ends(true);
        let expected = wanted.length(content).map(|length| length.get());
        let what = if unit != wanted.unit() {
            Seen::OTHER_UNIT
        } else if function != wanted.function() {
            Seen::OTHER_FUNCTION
        } else if expected.map(usize::from) != Some(length) {
            Seen::MALFORMED
        } else {
            match wanted.judge(content) {
                Verdict::Right => return true,
                Verdict::Own => return false,
                Verdict::Wrong => Seen::MALFORMED,
            }
        };
        self.foreign = self.foreign.saturating_add(1);
        self.see(what);
        false
    }
}

impl Search for Window {
    const EMPTY: Window = Window {
        start: 0,
        end: 0,
        found: 0,
        seen: Seen::NOTHING,
        foreign: 0,
        noise: false,
        skim: false,
        delimiter: END,
    };

    fn hold(&mut self, count: u16) {
        self.start = 0;
        self.end = count;
    }

    fn frame_length(length: u8) -> u16 {
        // Colon, unit, PDU and LRC in two characters each, and the two at the end.
        2 * u16::from(length) + 7
    }

    fn write(
        &self,
        buffer: &mut [u8],
        unit: u8,
        length: usize,
        pdu: impl FnOnce(&mut [u8]),
    ) -> bool {
        let emit = |place: &mut [u8]| {
            let place = place.get_mut(..length).ok_or(Status::BUFFER_TOO_SMALL)?;
            pdu(place);
            Ok(length)
        };
        ascii::emit(buffer, unit, self.delimiter, emit).is_ok()
    }

    fn room<'a>(&mut self, buffer: &'a mut [u8]) -> Option<&'a mut [u8]> {
        if self.start > 0 {
            move_to_front(buffer, usize::from(self.start));
            self.end -= self.start;
            self.start = 0;
        }
        if usize::from(self.end) == buffer.len() {
            // A frame has begun that the buffer cannot hold.
            self.see(Seen::TOO_LONG);
            self.end = 0;
        }
        buffer.get_mut(usize::from(self.end)..)
    }

    fn clear(&mut self) {
        let delimiter = self.delimiter;
        *self = Window::EMPTY;
        self.delimiter = delimiter;
        self.skim = true;
    }

    fn arrived(&mut self, count: u16) {
        self.end += count;
        self.skim = false;
    }

    fn sent(&mut self, count: u16) {
        self.start += count;
    }

    fn skim(&mut self) {
        self.skim = true;
    }

    fn is_skimmed(&self) -> bool {
        self.skim
    }

    fn unsent<'a>(&self, buffer: &'a [u8]) -> Option<&'a [u8]> {
        buffer.get(usize::from(self.start)..usize::from(self.end))
    }

    fn behind<'a>(&self, buffer: &'a [u8], offset: usize) -> Option<&'a [u8]> {
        buffer.get(usize::from(self.start) + offset..)
    }

    fn seen(&self) -> Seen {
        self.seen
    }

    fn foreign_frames(&self) -> u8 {
        self.foreign
    }

    fn has_passed_noise(&self) -> bool {
        self.noise
    }

    fn fills(&self, length: usize) -> bool {
        usize::from(self.end - self.start) >= length
    }

    fn has_begun(&self) -> bool {
        // The last search left nothing in front of a colon.
        self.end > self.start
    }

    fn keep(&mut self) -> Found {
        let found = Found {
            start: self.start,
            // The colon, CR and LF carry no byte. One byte more than unit, PDU and
            // LRC belongs to the content.
            content: (self.found - 1) / 2,
            length: self.found,
        };
        self.end -= self.start + self.found;
        self.start = 0;
        self.seen = Seen::NOTHING;
        found
    }

    fn search(&mut self, buffer: &mut [u8], wanted: &mut impl Wanted) -> bool {
        loop {
            let range = usize::from(self.start)..usize::from(self.end);
            let Some(rest) = buffer.get_mut(range) else {
                return false;
            };
            // The last colon counts: a frame without its end was cut off.
            let mut begin = None;
            let mut before = 0;
            let mut end = None;
            for (index, character) in rest.iter().enumerate() {
                if *character == START {
                    begin = Some(index);
                } else if *character == self.delimiter && before == RETURN {
                    end = Some(index + 1);
                    break;
                }
                before = *character;
            }
            let first = begin.unwrap_or(end.unwrap_or(rest.len()));
            if first > 0 {
                self.noise = true;
            }
            let Some(end) = end else {
                // A return at the end may belong to what follows; noise does not.
                self.pass(first);
                return false;
            };
            if let Some(frame) = rest.get_mut(first..end) {
                if !frame.is_empty() && self.judge(frame, wanted) {
                    self.pass(first);
                    self.found = (end - first) as u16;
                    return true;
                }
            }
            self.pass(end);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use core::num::NonZeroU8;

    /// Read Exception Status of unit 2.
    struct Outputs(u8);

    impl Wanted for Outputs {
        fn unit(&self) -> u8 {
            2
        }
        fn function(&self) -> u8 {
            7
        }
        fn length(&self, _: &[u8]) -> Option<NonZeroU8> {
            NonZeroU8::new(2)
        }
        fn judge(&mut self, frame: &[u8]) -> Verdict {
            self.0 = frame[2];
            Verdict::Right
        }
    }

    /// Hands `characters` over one by one; what was found, and the window.
    fn found(characters: &[u8]) -> (Option<u8>, Window) {
        let mut buffer = [0; 40];
        let (mut window, mut wanted) = (Window::EMPTY, Outputs(0));
        window.clear();
        for character in characters {
            window.room(&mut buffer).unwrap()[0] = *character;
            window.arrived(1);
            if window.search(&mut buffer, &mut wanted) {
                return (Some(wanted.0), window);
            }
        }
        (None, window)
    }

    #[test]
    fn a_frame_is_found_behind_noise_and_a_frame_that_was_cut_off() {
        assert_eq!(found(b":02075A9D\r\n").0, Some(0x5A));
        let (outputs, window) = found(b"\xFF12\r\n:0207:02075A9D\r\n");
        assert_eq!(outputs, Some(0x5A));
        assert!(window.has_passed_noise());
    }

    #[test]
    fn what_else_was_seen_is_told() {
        assert_eq!(found(b":03075A9C\r\n").1.seen(), Seen::OTHER_UNIT);
        assert_eq!(found(b":02085A9C\r\n").1.seen(), Seen::OTHER_FUNCTION);
        assert_eq!(found(b":0207005A9D\r\n").1.seen(), Seen::MALFORMED);
        assert_eq!(found(b":02075A9E\r\n").1.seen(), Seen::BAD_CRC);
        assert_eq!(found(&[b':'; 50]).1.seen(), Seen::NOTHING);
        assert_eq!(
            found(b":02070000000000000000000000000000000000000000000000")
                .1
                .seen(),
            Seen::TOO_LONG
        );
    }
}
