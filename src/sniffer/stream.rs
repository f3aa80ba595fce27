//! One stream of a bus: its bytes, and the times at which they arrived.

use crate::bytes::move_items;
use crate::time::{elapsed, Micros};
use core::cell::Cell;

/// The time of arrival of bytes: the last byte before `end` arrived at `time`.
#[derive(Clone, Copy, Debug)]
struct Mark {
    time: Micros,
    end: u16,
    /// The line was silent after them.
    silent: bool,
    /// Padding, so that the struct has the same size on every core. The C struct counts on it.
    _even: u8,
}

const MARKS: usize = 8;

/// The times that separate frames, in microseconds.
#[derive(Clone, Copy, Debug)]
pub(super) struct Timing {
    /// Time of one character; 0 if it is unknown.
    pub character: Micros,
    /// Silence between two frames.
    pub silence: Micros,
    /// How long to wait for the rest of an incomplete frame.
    pub frame_timeout: Micros,
}

impl Timing {
    /// Time of `count` characters on the line; 0 if it is unknown.
    fn on_the_line(&self, count: usize) -> u32 {
        self.character.saturating_mul(count as u32)
    }
}

/// The state of one stream. The caller passes the buffer to each call.
#[derive(Clone, Copy, Debug)]
pub(super) struct RxStream {
    /// Index of the first byte that was not reported yet, of the byte at which a frame is looked
    /// for, and of the end of the received bytes. No frame begins between the first two.
    pub start: u16,
    pub at: u16,
    pub end: u16,
    /// How many characters of the ASCII frame at `at` were decoded in place.
    pub decoded: u16,
    /// How many of the next bytes belong to an event that was already reported.
    pub skip: u16,
    /// How many bytes from `at` on were already searched for the end of an ASCII frame.
    pub searched: u16,
    /// No frame can be found before the stream has bytes up to this index...
    need: u16,
    /// A frame between `start` and `at` may be too long for the buffer.
    pub cut: bool,
    received: bool,
    count: u8,
    /// How many marks are followed by silence.
    silent: u8,
    /// Time of the last byte, and of the last byte before the first mark.
    last: Micros,
    floor: Micros,
    /// ...or the line has been silent for this time.
    quiet_limit: Micros,
    marks: [Mark; MARKS],
}

impl RxStream {
    pub const EMPTY: RxStream = RxStream {
        start: 0,
        at: 0,
        end: 0,
        decoded: 0,
        skip: 0,
        searched: 0,
        need: 0,
        cut: false,
        received: false,
        count: 0,
        silent: 0,
        last: 0,
        floor: 0,
        quiet_limit: 0,
        marks: [Mark {
            time: 0,
            end: 0,
            silent: false,
            _even: 0,
        }; MARKS],
    };

    pub const fn is_empty(&self) -> bool {
        self.start == self.end
    }

    /// True if the stream can take no more bytes until a frame is consumed.
    pub fn is_full(&self, capacity: usize) -> bool {
        usize::from(self.end - self.start) >= capacity || usize::from(self.silent) == MARKS
    }

    fn marks(&self) -> &[Mark] {
        self.marks.get(..self.count.into()).unwrap_or_default()
    }

    fn last_mark(&mut self) -> Option<&mut Mark> {
        let index = usize::from(self.count).checked_sub(1)?;
        self.marks.get_mut(index)
    }

    fn drop_mark(&mut self, index: usize) {
        let is_silent = self.marks().get(index).is_some_and(|mark| mark.silent);
        self.silent -= u8::from(is_silent);
        let marks = Cell::from_mut(&mut self.marks[..]).as_slice_of_cells();
        let marks = marks.get(index..).unwrap_or_default();
        move_items(marks, marks.get(1..).unwrap_or_default());
        self.count = self.count.saturating_sub(1);
    }

    /// Takes bytes; the last one arrived now. Returns how many fitted into the buffer.
    pub fn feed(&mut self, buffer: &mut [u8], bytes: &[u8], now: u32, timing: &Timing) -> usize {
        if bytes.is_empty() {
            return 0;
        }
        let on_the_line = timing.on_the_line(bytes.len());
        if !self.received {
            self.received = true;
            self.last = now.wrapping_sub(on_the_line);
            self.floor = self.last;
        }
        let since = elapsed(now, self.last);
        let gap = since.saturating_sub(on_the_line);
        if gap >= timing.frame_timeout {
            self.skip = 0;
        }
        let (skipped, bytes) = bytes.split_at(bytes.len().min(self.skip.into()));
        self.skip -= skipped.len() as u16;
        if self.is_empty() {
            self.forget();
        }
        let is_new = gap >= timing.silence && self.count > 0;
        if is_new && !self.begin_piece() {
            return skipped.len();
        }
        if !skipped.is_empty() {
            self.last = now.wrapping_sub(timing.on_the_line(bytes.len()).min(since));
        }
        self.move_to_front(buffer);
        let space = buffer.get_mut(self.end.into()..).unwrap_or_default();
        let mut count = 0;
        for (place, byte) in space.iter_mut().zip(bytes) {
            *place = *byte;
            count += 1;
        }
        if count > 0 {
            let later = timing.on_the_line(bytes.len() - count).min(since);
            self.mark(count as u16, now.wrapping_sub(later), is_new, timing);
        }
        skipped.len() + count
    }

    /// Notes that silence follows the last mark. False if there is no free mark.
    fn begin_piece(&mut self) -> bool {
        self.need = 0;
        if let Some(mark) = self.last_mark().filter(|mark| !mark.silent) {
            mark.silent = true;
            self.silent += 1;
        }
        if usize::from(self.count) == MARKS {
            let within = self.marks().iter().position(|mark| !mark.silent);
            match within {
                Some(index) => self.drop_mark(index),
                None => return false,
            }
        }
        true
    }

    /// Notes that the buffer holds `count` more bytes, and the time of the last one.
    #[inline(always)]
    fn mark(&mut self, count: u16, time: u32, is_new: bool, timing: &Timing) {
        self.last = time;
        self.quiet_limit = timing.silence.min(timing.frame_timeout);
        self.end += count;
        let (end, many) = (self.end, usize::from(self.count) >= MARKS / 2);
        match self.last_mark() {
            Some(mark) if many && !is_new => {
                mark.end = end;
                mark.time = time;
            }
            _ => {
                let mark = Mark {
                    time,
                    end,
                    silent: false,
                    _even: 0,
                };
                if let Some(place) = self.marks.get_mut(usize::from(self.count)) {
                    *place = mark;
                    self.count += 1;
                }
            }
        }
    }

    /// Suspends the search until `need` bytes have arrived from `at` on, the line has been silent
    /// for longer than now, or [`RxStream::resume`] is called.
    pub fn suspend(&mut self, need: usize, capacity: usize, now: u32, timing: &Timing) {
        let need = (usize::from(self.at) + need).min(usize::from(self.start) + capacity);
        self.need = need.min(u16::MAX.into()) as u16;
        let quiet = self.quiet(now);
        let later = |time: u32| if time > quiet { time } else { u32::MAX };
        self.quiet_limit = later(timing.silence).min(later(timing.frame_timeout));
    }

    /// Undoes [`RxStream::suspend`].
    pub fn resume(&mut self) {
        self.need = 0;
    }

    /// True while the search is suspended: see [`RxStream::suspend`].
    pub fn is_suspended(&self, now: u32) -> bool {
        self.end < self.need && self.quiet(now) < self.quiet_limit
    }

    /// Moves the search on by one byte.
    pub fn skip_byte(&mut self) {
        self.at += 1;
        self.searched = 0;
    }

    fn forget(&mut self) {
        if let Some(mark) = self.last_mark() {
            self.floor = mark.time;
        }
        self.need = self.need.saturating_sub(self.start);
        self.start = 0;
        self.at = 0;
        self.end = 0;
        self.count = 0;
        self.silent = 0;
    }

    fn move_to_front(&mut self, buffer: &mut [u8]) {
        let by = self.start;
        if by == 0 {
            return;
        }
        let cells = Cell::from_mut(buffer).as_slice_of_cells();
        let kept = cells.get(by.into()..self.end.into()).unwrap_or_default();
        move_items(cells, kept);
        self.start = 0;
        self.at -= by;
        self.end -= by;
        self.need = self.need.saturating_sub(by);
        for mark in &mut self.marks {
            mark.end = mark.end.saturating_sub(by);
        }
    }

    /// How long the line has been silent since the last byte.
    pub fn quiet(&self, now: u32) -> u32 {
        elapsed(now, self.last)
    }

    /// True if silence follows some of the received bytes, or the line is silent now.
    pub fn has_silence(&self, now: u32, timing: &Timing) -> bool {
        self.silent > 0 || self.quiet(now) >= timing.silence
    }

    /// The indexes after `at` at which the received bytes are followed by silence.
    pub fn silences(&self, at: u16) -> impl Iterator<Item = u16> + '_ {
        let marks = if self.silent > 0 { self.marks() } else { &[] };
        marks
            .iter()
            .filter(move |mark| mark.silent && mark.end > at)
            .map(|mark| mark.end)
    }

    /// The time at which the byte before `offset` arrived.
    pub fn time(&self, offset: u16, timing: &Timing) -> u32 {
        let mut floor = self.floor;
        for mark in self.marks() {
            if mark.end >= offset {
                let later = timing.character.saturating_mul((mark.end - offset).into());
                return mark.time.wrapping_sub(later.min(elapsed(mark.time, floor)));
            }
            floor = mark.time;
        }
        self.last
    }

    /// How long ago the first unreported byte arrived; 0 if there is none.
    pub fn waited(&self, now: u32, timing: &Timing) -> u32 {
        if self.is_empty() {
            0
        } else {
            elapsed(now, self.time(self.start + 1, timing))
        }
    }

    /// Marks all bytes before `offset` as reported.
    pub fn consume(&mut self, offset: u16) {
        while let Some(first) = self.marks().first() {
            if first.end > offset {
                break;
            }
            self.floor = first.time;
            self.drop_mark(0);
        }
        self.start = offset;
        self.at = offset;
        self.decoded = 0;
        self.searched = 0;
        self.need = 0;
        self.cut = false;
    }
}
