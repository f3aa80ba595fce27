//! Bytes as they arrived, and when: one stream of a bus.

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
    /// A frame between `start` and `at` may have been too long for the buffer.
    pub cut: bool,
    heard: bool,
    count: u8,
    /// When the last byte arrived, and the last before the first mark.
    last: u32,
    floor: u32,
    marks: [Mark; MARKS],
}

impl Lane {
    pub const EMPTY: Lane = Lane {
        start: 0,
        at: 0,
        end: 0,
        decoded: 0,
        skip: 0,
        cut: false,
        heard: false,
        count: 0,
        last: 0,
        floor: 0,
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
        usize::from(self.end - self.start) >= capacity
            || (usize::from(self.count) == MARKS && self.marks().iter().all(|mark| mark.silent))
    }

    fn marks(&self) -> &[Mark] {
        self.marks.get(..self.count.into()).unwrap_or_default()
    }

    fn last_mark(&mut self) -> Option<&mut Mark> {
        let index = usize::from(self.count).checked_sub(1)?;
        self.marks.get_mut(index)
    }

    fn drop_mark(&mut self, index: usize) {
        let cells = Cell::from_mut(&mut self.marks[..]).as_slice_of_cells();
        for pair in cells.windows(2).skip(index) {
            if let [to, from] = pair {
                to.set(from.get());
            }
        }
        self.count = self.count.saturating_sub(1);
    }

    /// Takes bytes of which the last arrived now; how many there was room for.
    pub fn feed(&mut self, buffer: &mut [u8], bytes: &[u8], now: u32, timing: &Timing) -> usize {
        let on_the_line = |count: usize| timing.character.saturating_mul(count as u32);
        let since = if self.heard {
            elapsed(now, self.last)
        } else {
            on_the_line(bytes.len())
        };
        if bytes.is_empty() {
            return 0;
        }
        if !self.heard {
            self.heard = true;
            self.last = now.wrapping_sub(since);
            self.floor = self.last;
        }
        let gap = since.saturating_sub(on_the_line(bytes.len()));
        if gap >= timing.patience {
            self.skip = 0;
        }
        let (skipped, bytes) = bytes.split_at(bytes.len().min(self.skip.into()));
        self.skip -= skipped.len() as u16;
        if self.is_empty() {
            self.forget();
        }
        let is_new = gap >= timing.silence && self.count > 0;
        if is_new {
            if let Some(mark) = self.last_mark() {
                mark.silent = true;
            }
            if usize::from(self.count) == MARKS {
                let within = self.marks().iter().position(|mark| !mark.silent);
                match within {
                    Some(index) => self.drop_mark(index),
                    None => return skipped.len(),
                }
            }
        }
        self.move_to_the_front(buffer);
        let room = buffer.get_mut(self.end.into()..).unwrap_or_default();
        let mut count = 0;
        for (place, byte) in room.iter_mut().zip(bytes) {
            *place = *byte;
            count += 1;
        }
        let later = on_the_line(bytes.len() - count);
        let time = now.wrapping_sub(later.min(since));
        if count > 0 {
            self.end += count as u16;
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
        if count + skipped.len() > 0 {
            self.last = time;
        }
        skipped.len() + count
    }

    fn forget(&mut self) {
        if let Some(mark) = self.last_mark() {
            self.floor = mark.time;
        }
        self.start = 0;
        self.at = 0;
        self.end = 0;
        self.count = 0;
    }

    fn move_to_the_front(&mut self, buffer: &mut [u8]) {
        let by = self.start;
        if by == 0 {
            return;
        }
        let cells = Cell::from_mut(buffer).as_slice_of_cells();
        let kept = cells.get(by.into()..self.end.into()).unwrap_or_default();
        for (to, from) in cells.iter().zip(kept) {
            to.set(from.get());
        }
        self.start = 0;
        self.at -= by;
        self.end -= by;
        for mark in &mut self.marks {
            mark.end = mark.end.saturating_sub(by);
        }
    }

    /// How long the line has been silent since the last byte.
    pub fn quiet(&self, now: u32) -> u32 {
        elapsed(now, self.last)
    }

    /// Where the next silence behind `at` is, among what arrived.
    pub fn silences(&self, at: u16) -> impl Iterator<Item = u16> + '_ {
        let marks = self.marks().iter();
        marks
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
        self.cut = false;
    }
}
