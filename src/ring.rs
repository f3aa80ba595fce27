//! A receive ring: an interrupt handler puts bytes in, the main loop takes them
//! out. One side each, without locks.
//!
//! Only the side that puts moves the head, and only the side that takes moves
//! the tail. A byte is written before the head passes it, and read before the
//! tail does, so neither side ever touches what the other is at. One place
//! stays free, which tells a full ring from an empty one.

use crate::atomic::{AtomicPlace, AtomicU8, Ordering};

/// A place in the storage. An 8-bit processor moves only 8 bits at once.
#[cfg(not(target_pointer_width = "16"))]
pub type Place = u16;
/// A place in the storage. An 8-bit processor moves only 8 bits at once.
#[cfg(target_pointer_width = "16")]
pub type Place = u8;

/// The most bytes of storage.
pub const MAX_STORAGE: usize = Place::MAX as usize + if size_of::<Place>() == 1 { 1 } else { 0 };

/// Where the two sides are.
#[derive(Debug, Default)]
#[repr(C)]
pub struct Positions {
    /// Where the next byte is put.
    head: AtomicPlace,
    /// Where the next byte is taken.
    tail: AtomicPlace,
    /// Bytes that found no room; wraps.
    lost: AtomicPlace,
}

impl Positions {
    /// An empty ring.
    pub const fn new() -> Self {
        Positions {
            head: AtomicPlace::new(0),
            tail: AtomicPlace::new(0),
            lost: AtomicPlace::new(0),
        }
    }
}

/// A ring over storage of the caller's, of at most [`MAX_STORAGE`] bytes.
#[derive(Clone, Copy, Debug)]
pub struct Ring<'a> {
    bytes: &'a [AtomicU8],
    positions: &'a Positions,
}

impl<'a> Ring<'a> {
    /// The ring over these bytes, of which one always stays free.
    pub const fn new(bytes: &'a [AtomicU8], positions: &'a Positions) -> Self {
        Ring { bytes, positions }
    }

    /// The place behind `place`.
    fn after(&self, place: Place) -> Place {
        let next = place.wrapping_add(1);
        if usize::from(next) >= self.bytes.len() {
            0
        } else {
            next
        }
    }

    /// Puts a byte in; false, and the byte counts as lost, if there is no room.
    /// For the one side that puts.
    pub fn put(&self, byte: u8) -> bool {
        let head = self.positions.head.load(Ordering::Relaxed);
        let next = self.after(head);
        // Acquired, so that the place is written only after it was read.
        if next != self.positions.tail.load(Ordering::Acquire) {
            if let Some(place) = self.bytes.get(usize::from(head)) {
                place.store(byte, Ordering::Relaxed);
                self.positions.head.store(next, Ordering::Release);
                return true;
            }
        }
        // Not an addition in memory, which a small core lacks; only this side counts.
        let lost = self.positions.lost.load(Ordering::Relaxed);
        self.positions
            .lost
            .store(lost.wrapping_add(1), Ordering::Relaxed);
        false
    }

    /// Puts bytes in, in order; returns how many found room. For the one side
    /// that puts.
    pub fn write(&self, bytes: &[u8]) -> u16 {
        let put = bytes.iter().filter(|byte| self.put(**byte)).count();
        put as u16
    }

    /// Takes bytes out, in order; returns how many there were. For the one side
    /// that takes.
    pub fn read(&self, bytes: &mut [u8]) -> u16 {
        let head = self.positions.head.load(Ordering::Acquire);
        let mut tail = self.positions.tail.load(Ordering::Relaxed);
        let mut count = 0;
        for place in bytes {
            if tail == head {
                break;
            }
            let Some(byte) = self.bytes.get(usize::from(tail)) else {
                break;
            };
            *place = byte.load(Ordering::Relaxed);
            tail = self.after(tail);
            count += 1;
        }
        self.positions.tail.store(tail, Ordering::Release);
        count
    }

    /// How many bytes there are to take. For the one side that takes.
    pub fn available(&self) -> u16 {
        let head = self.positions.head.load(Ordering::Acquire);
        let tail = self.positions.tail.load(Ordering::Relaxed);
        let used = if head >= tail {
            usize::from(head - tail)
        } else {
            self.bytes.len() - usize::from(tail - head)
        };
        used as u16
    }

    /// Forgets what there is to take. For the one side that takes.
    pub fn clear(&self) {
        let head = self.positions.head.load(Ordering::Acquire);
        self.positions.tail.store(head, Ordering::Release);
    }

    /// How many bytes found no room; wraps, at 256 on an 8-bit processor. For
    /// both sides.
    pub fn lost(&self) -> u16 {
        usize::from(self.positions.lost.load(Ordering::Relaxed)) as u16
    }
}
