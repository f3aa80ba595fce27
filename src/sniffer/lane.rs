//! Bytes as they arrived, and when: one stream of a bus.

use crate::bytes::move_items;
use crate::time::elapsed;
use core::cell::Cell;

/// When bytes arrived: those up to `end`, the last of them at `time`.
#[derive(Clone, Copy, Debug)]
struct Mark {
    time: u32,
    end: u16,
    /// The line was silent after them.
    silent: bool,
    /// As large on every core, for the sake of the storage that C sets aside.
    _even: u8,
}

const MARKS: usize = 8;

/// How time tells bytes apart, in microseconds.
#[derive(Clone, Copy, Debug)]
pub(super) struct Timing {
    /// One character on the line; 0 if that is not known.
    pub character: u32,
    /// What separates two frames.
    pub silence: u32,
    /// How long an incomplete frame is waited for.
    pub patience: u32,
}

impl Timing {
    /// How long so many characters take on the line; 0 if that is not known.
    fn on_the_line(&self, count: usize) -> u32 {
        self.character.saturating_mul(count as u32)
    }
}

/// A window over what has arrived. The buffer is the caller's and is passed to
/// each call.
#[derive(Clone, Copy, Debug)]
pub(super) struct Lane {
    /// Where what was not yet told of begins, where a frame is looked for, and
    /// where what arrived ends. No frame begins between the first two.
    pub start: u16,
    pub at: u16,
    pub end: u16,
    /// Characters of an ASCII frame at `at` that were decoded in place.
    pub decoded: u16,
    /// Bytes to come that belong to what was told of already.
    pub skip: u16,
    /// Of an ASCII frame: how many bytes from `at` on were searched for its end.
    pub searched: u16,
    /// Nothing can be found before the lane has bytes up to here...
    need: u16,
    /// A frame between `start` and `at` may have been too long for the buffer.
    pub cut: bool,
    heard: bool,
    count: u8,
    /// How many marks are silent.
    silent: u8,
    /// When the last byte arrived, and the last before the first mark.
    last: u32,
    floor: u32,
    /// ...or has been silent for so long.
    calm: u32,
    marks: [Mark; MARKS],
}

impl Lane {
    pub const EMPTY: Lane = Lane {
        start: 0,
        at: 0,
        end: 0,
        decoded: 0,
        skip: 0,
        searched: 0,
        need: 0,
        cut: false,
        heard: false,
        count: 0,
        silent: 0,
        last: 0,
        floor: 0,
        calm: 0,
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

    /// True if nothing more can be taken while a frame is waited for.
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

    /// Takes a byte that arrived now if it goes on with what arrived last, as most
    /// do: all that [`Lane::feed`] does then. False if it does not.
    #[inline(always)]
    pub fn feed_next(&mut self, buffer: &mut [u8], byte: u8, now: u32, timing: &Timing) -> bool {
        let gap = elapsed(now, self.last).saturating_sub(timing.character);
        if gap >= timing.silence || self.skip > 0 || self.start > 0 || self.end == 0 {
            return false;
        }
        let Some(place) = buffer.get_mut(usize::from(self.end)) else {
            return false;
        };
        *place = byte;
        self.mark(1, now, false, timing);
        true
    }

    /// Takes bytes of which the last arrived now; how many there was room for.
    pub fn feed(&mut self, buffer: &mut [u8], bytes: &[u8], now: u32, timing: &Timing) -> usize {
        if bytes.is_empty() {
            return 0;
        }
        let on_the_line = timing.on_the_line(bytes.len());
        if !self.heard {
            self.heard = true;
            self.last = now.wrapping_sub(on_the_line);
            self.floor = self.last;
        }
        let since = elapsed(now, self.last);
        let gap = since.saturating_sub(on_the_line);
        if gap >= timing.patience {
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
        self.move_to_the_front(buffer);
        let room = buffer.get_mut(self.end.into()..).unwrap_or_default();
        let mut count = 0;
        for (place, byte) in room.iter_mut().zip(bytes) {
            *place = *byte;
            count += 1;
        }
        if count > 0 {
            let later = timing.on_the_line(bytes.len() - count).min(since);
            self.mark(count as u16, now.wrapping_sub(later), is_new, timing);
        }
        skipped.len() + count
    }

    /// Ends the last mark with a silence; false if there is no place for another.
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

    /// Notes that `count` bytes more stand in the buffer, and when they arrived.
    #[inline(always)]
    fn mark(&mut self, count: u16, time: u32, is_new: bool, timing: &Timing) {
        self.last = time;
        self.calm = timing.silence.min(timing.patience);
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

    /// Says that there is nothing to find before `need` bytes stand where a frame is
    /// looked for, or the line has been silent for longer than now, or
    /// [`Lane::look_again`].
    pub fn settle(&mut self, need: usize, capacity: usize, now: u32, timing: &Timing) {
        let need = (usize::from(self.at) + need).min(usize::from(self.start) + capacity);
        self.need = need.min(u16::MAX.into()) as u16;
        let quiet = self.quiet(now);
        let later = |time: u32| if time > quiet { time } else { u32::MAX };
        self.calm = later(timing.silence).min(later(timing.patience));
    }

    /// Undoes [`Lane::settle`].
    pub fn look_again(&mut self) {
        self.need = 0;
    }

    /// True if there is nothing to find yet: see [`Lane::settle`].
    pub fn is_settled(&self, now: u32) -> bool {
        self.end < self.need && self.quiet(now) < self.calm
    }

    /// Looks for a frame one byte further on.
    pub fn pass(&mut self) {
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

    fn move_to_the_front(&mut self, buffer: &mut [u8]) {
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

    /// True if the line was silent after some of what arrived, or is so now.
    pub fn has_silence(&self, now: u32, timing: &Timing) -> bool {
        self.silent > 0 || self.quiet(now) >= timing.silence
    }

    /// Where the next silence behind `at` is, among what arrived.
    pub fn silences(&self, at: u16) -> impl Iterator<Item = u16> + '_ {
        let marks = if self.silent > 0 { self.marks() } else { &[] };
        marks
            .iter()
            .filter(move |mark| mark.silent && mark.end > at)
            .map(|mark| mark.end)
    }

    /// When the byte before `offset` arrived.
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

    /// How long the first byte that was not told of is there; 0 if there is none.
    pub fn waited(&self, now: u32, timing: &Timing) -> u32 {
        if self.is_empty() {
            0
        } else {
            elapsed(now, self.time(self.start + 1, timing))
        }
    }

    /// Has everything before `offset` told of.
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
