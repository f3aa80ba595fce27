//! A receive ring that a DMA fills. The DMA writes round and round into the storage, without end,
//! and counts the places that are left until it begins again at the front. The reader takes the
//! bytes out.
//!
//! A position is the place that the DMA writes next, and the number of laps before it. The counter
//! of the DMA has the place alone. [`DmaRing::note`] and the reader look at it: each takes the
//! latest position that one of them has found, and moves it on to the place of the counter. So a
//! lap is noticed if they look at least once in each lap. An interrupt that calls `note` when half
//! of the storage is full, and when all of it is, looks twice in each lap, whatever the reader
//! does.
//!
//! `note` and the reader may interrupt each other at any point. `note` changes only `noted`; the
//! reader changes the other fields.

use crate::atomic::{AtomicU8, AtomicWord, Ordering};

/// A position: the place is in the lower bits, the number of laps in the upper ones. (An 8-bit
/// processor loads and stores only 8 bits at once.)
#[cfg(not(target_pointer_width = "16"))]
pub type Word = u32;
/// A position: the place is in the lower bits, the number of laps in the upper ones. (An 8-bit
/// processor loads and stores only 8 bits at once.)
#[cfg(target_pointer_width = "16")]
pub type Word = u8;

/// The position a lap later is greater by this.
const LAP: Word = 1 << if size_of::<Word>() == 1 { 6 } else { 16 };
/// The number of laps wraps here.
const LAPS: Word = Word::MAX / LAP + 1;

/// Greatest size of the storage in bytes.
pub const MAX_STORAGE: usize = LAP as usize - (size_of::<Word>() != 1) as usize;

/// What interrupt and reader know about the DMA.
///
/// ```
/// use mbm::dma_ring::Positions;
///
/// static POSITIONS: Positions = Positions::new();
/// ```
#[derive(Debug, Default)]
#[repr(C)]
pub struct Positions {
    /// The position that `note` has found last.
    noted: AtomicWord,
    /// What `noted` was when the reader looked last.
    heard: AtomicWord,
    /// The position that the reader has found last.
    seen: AtomicWord,
    /// The position of the next byte that the reader takes.
    tail: AtomicWord,
    /// Number of bytes that were lost because the DMA overwrote them; wraps.
    lost: AtomicWord,
}

impl Positions {
    /// An empty ring, whose DMA begins at the front of the storage.
    pub const fn new() -> Self {
        Positions {
            noted: AtomicWord::new(0),
            heard: AtomicWord::new(0),
            seen: AtomicWord::new(0),
            tail: AtomicWord::new(0),
            lost: AtomicWord::new(0),
        }
    }
}

const fn place_of(position: Word) -> usize {
    (position % LAP) as usize
}

/// A ring in storage of the caller, of at most [`MAX_STORAGE`] bytes. `R` returns the counter of
/// the DMA: how many bytes it writes until it begins again at the front of the storage.
///
/// ```
/// use mbm::dma_ring::{DmaRing, Positions};
/// use std::sync::atomic::{AtomicU16, AtomicU8, Ordering};
///
/// static BYTES: [AtomicU8; 64] = [const { AtomicU8::new(0) }; 64];
/// static POSITIONS: Positions = Positions::new();
/// # static COUNTER: AtomicU16 = AtomicU16::new(64);
/// // The counter of the DMA, a register of the chip: how many bytes are left until it begins again.
/// let ring = DmaRing::new(&BYTES, &POSITIONS, || COUNTER.load(Ordering::Relaxed));
///
/// # BYTES[0].store(17, Ordering::Relaxed);
/// # COUNTER.store(63, Ordering::Relaxed);
/// // In the interrupts of the DMA, at the half and at the end:
/// ring.note();
/// // In `Port::read`, which the main loop calls:
/// assert_eq!(ring.available(), 1);
/// let mut bytes = [0; 8];
/// assert_eq!((ring.read(&mut bytes), bytes[0]), (1, 17));
/// assert_eq!(ring.lost(), 0);
/// ```
#[derive(Clone, Copy, Debug)]
pub struct DmaRing<'a, R> {
    bytes: &'a [AtomicU8],
    positions: &'a Positions,
    remaining: R,
}

impl<'a, R: Fn() -> u16> DmaRing<'a, R> {
    /// A ring in `bytes`, of which the DMA writes all. It holds one byte less.
    pub const fn new(bytes: &'a [AtomicU8], positions: &'a Positions, remaining: R) -> Self {
        DmaRing {
            bytes,
            positions,
            remaining,
        }
    }

    /// Moves a position on to the place of the DMA's counter. A counter that is no place in the
    /// storage moves nothing.
    fn moved(&self, position: Word) -> Word {
        let size = self.bytes.len();
        let place = match size.checked_sub(usize::from((self.remaining)())) {
            None => return position,
            // The counter is 0 for the moment before the DMA begins again.
            Some(place) if place == size => 0,
            Some(place) => place,
        };
        let lap = if place < place_of(position) { LAP } else { 0 };
        (position - place_of(position) as Word)
            .wrapping_add(lap)
            .wrapping_add(place as Word)
    }

    /// The later of the positions that `note` and the reader have found, if `note` has found
    /// `noted`.
    fn latest(&self, noted: Word) -> Word {
        if noted == self.positions.heard.load(Ordering::Acquire) {
            self.positions.seen.load(Ordering::Relaxed)
        } else {
            noted
        }
    }

    /// Looks where the DMA is. The interrupts of the DMA call this when half of the storage is
    /// full and when all of it is.
    pub fn note(&self) {
        let noted = self.positions.noted.load(Ordering::Relaxed);
        let noted = self.moved(self.latest(noted));
        self.positions.noted.store(noted, Ordering::Release);
    }

    /// Returns what `note` has found, and where the DMA is.
    fn look(&self) -> (Word, Word) {
        loop {
            let noted = self.positions.noted.load(Ordering::Acquire);
            let position = self.moved(self.latest(noted));
            // If `note` came in between, `position` may be earlier than what it has found.
            if noted == self.positions.noted.load(Ordering::Acquire) {
                return (noted, position);
            }
        }
    }

    /// How many bytes the DMA has written from the reader's position to `position`.
    fn unread(&self, position: Word) -> usize {
        let tail = self.positions.tail.load(Ordering::Relaxed);
        let laps = (position / LAP).wrapping_sub(tail / LAP) % LAPS;
        let bytes = laps as usize * self.bytes.len() + place_of(position);
        bytes.wrapping_sub(place_of(tail))
    }

    /// Looks where the DMA is, and skips the bytes that it has overwritten or may be overwriting.
    /// Returns the number of unread bytes, and of those skipped.
    fn catch_up(&self) -> (usize, usize) {
        let (noted, position) = self.look();
        // `note` takes `seen` only if it finds its own position in `heard`.
        self.positions.seen.store(position, Ordering::Relaxed);
        self.positions.heard.store(noted, Ordering::Release);
        let (unread, holds) = (self.unread(position), self.holds());
        let skipped = unread.saturating_sub(holds);
        if skipped != 0 {
            let lost = self.positions.lost.load(Ordering::Relaxed);
            let lost = lost.wrapping_add(skipped as Word);
            self.positions.lost.store(lost, Ordering::Relaxed);
            // The oldest byte that is left lies after the DMA's place, a lap before.
            let oldest = self.after(position).wrapping_sub(LAP);
            self.positions.tail.store(oldest, Ordering::Relaxed);
        }
        (unread - skipped, skipped)
    }

    const fn holds(&self) -> usize {
        self.bytes.len().saturating_sub(1)
    }

    /// The position after a position.
    const fn after(&self, position: Word) -> Word {
        if place_of(position) + 1 < self.bytes.len() {
            position + 1
        } else {
            (position - place_of(position) as Word).wrapping_add(LAP)
        }
    }

    /// Takes bytes out, in order, at most `bytes.len()`. Returns their number. Only the
    /// reader may call this.
    pub fn read(&self, bytes: &mut [u8]) -> u16 {
        let (unread, _) = self.catch_up();
        let tail = self.positions.tail.load(Ordering::Relaxed);
        let (mut next, mut count) = (tail, 0usize);
        for place in bytes.iter_mut().take(unread) {
            let Some(byte) = self.bytes.get(place_of(next)) else {
                break;
            };
            *place = byte.load(Ordering::Relaxed);
            next = self.after(next);
            count += 1;
        }
        // The DMA may have reached the first of these bytes meanwhile.
        let (_, skipped) = self.catch_up();
        let Some(left) = count.checked_sub(skipped) else {
            return 0;
        };
        // Those after them are moved to the front, without the function memmove.
        for place in 0..if skipped != 0 { left } else { 0 } {
            let byte = bytes.get(place + skipped).copied();
            if let (Some(place), Some(byte)) = (bytes.get_mut(place), byte) {
                *place = byte;
            }
        }
        self.positions.tail.store(next, Ordering::Relaxed);
        left as u16
    }

    /// Number of bytes in the ring. Only the reader may call this.
    pub fn available(&self) -> u16 {
        self.unread(self.look().1).min(self.holds()) as u16
    }

    /// Number of bytes that were lost because the DMA overwrote them before they were read. The
    /// reader finds them. It wraps at 65536, on an 8-bit processor at 256.
    pub fn lost(&self) -> u16 {
        self.positions.lost.load(Ordering::Relaxed) as u16
    }
}
