//! A receive ring: an interrupt handler puts bytes in, the main loop takes them
//! out. One side each, without locks.
//!
//! Only the side that puts moves the head, and only the side that takes moves
//! the tail. A byte is written before the head passes it, and read before the
//! tail does, so neither side ever touches what the other is at. One place
//! stays free, which tells a full ring from an empty one.

use core::sync::atomic::{AtomicU8, Ordering};

/// A place in the storage. An 8-bit processor moves only 8 bits at once.
#[cfg(not(target_pointer_width = "16"))]
pub type Place = u16;
#[cfg(not(target_pointer_width = "16"))]
type AtomicPlace = core::sync::atomic::AtomicU16;
/// A place in the storage. An 8-bit processor moves only 8 bits at once.
#[cfg(target_pointer_width = "16")]
pub type Place = u8;
#[cfg(target_pointer_width = "16")]
type AtomicPlace = AtomicU8;

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

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::collections::VecDeque;
    use std::vec::Vec;

    fn places(count: usize) -> Vec<AtomicU8> {
        (0..count).map(|_| AtomicU8::new(0xEE)).collect()
    }

    #[test]
    fn a_ring_holds_one_byte_less_than_its_storage() {
        let (bytes, positions) = (places(4), Positions::new());
        let ring = Ring::new(&bytes, &positions);
        assert_eq!(ring.write(&[1, 2, 3, 4, 5]), 3);
        assert_eq!((ring.available(), ring.lost()), (3, 2));
        let mut taken = [0; 5];
        assert_eq!(ring.read(&mut taken), 3);
        assert_eq!(taken, [1, 2, 3, 0, 0]);
        assert_eq!((ring.available(), ring.read(&mut taken)), (0, 0));
    }

    #[test]
    fn a_ring_without_storage_loses_what_is_put() {
        for count in 0..2 {
            let (bytes, positions) = (places(count), Positions::new());
            let ring = Ring::new(&bytes, &positions);
            assert!(!ring.put(1));
            assert_eq!((ring.lost(), ring.available()), (1, 0));
            assert_eq!(ring.read(&mut [0; 2]), 0);
        }
    }

    #[test]
    fn clear_leaves_nothing_to_take_and_all_the_room() {
        let (bytes, positions) = (places(4), Positions::new());
        let ring = Ring::new(&bytes, &positions);
        ring.write(&[1, 2]);
        ring.clear();
        assert_eq!(ring.available(), 0);
        assert_eq!(ring.write(&[3, 4, 5]), 3);
    }

    #[test]
    fn one_thread_puts_while_another_takes_and_no_byte_is_lost_or_doubled() {
        const BYTES: u32 = 300_000;
        let (bytes, positions) = (places(17), Positions::new());
        let ring = Ring::new(&bytes, &positions);
        std::thread::scope(|scope| {
            scope.spawn(move || {
                for number in 0..BYTES {
                    while !ring.put(number as u8) {
                        std::thread::yield_now();
                    }
                }
            });
            let (mut expected, mut some) = (0u32, [0; 7]);
            while expected < BYTES {
                let count = ring.read(&mut some);
                for byte in &some[..count.into()] {
                    assert_eq!(*byte, expected as u8);
                    expected += 1;
                }
                if count == 0 {
                    std::thread::yield_now();
                }
            }
        });
    }

    proptest! {
        #[test]
        fn a_ring_is_a_queue_of_bounded_length(
            storage in 1usize..20,
            steps in prop::collection::vec((any::<bool>(), 0usize..25), 0..60),
        ) {
            let (bytes, positions) = (places(storage), Positions::new());
            let ring = Ring::new(&bytes, &positions);
            let (mut model, mut next, mut lost) = (VecDeque::new(), 0u8, 0u16);
            for (put, count) in steps {
                if put {
                    for _ in 0..count {
                        let fits = model.len() + 1 < storage;
                        prop_assert_eq!(ring.put(next), fits);
                        if fits {
                            model.push_back(next);
                        } else {
                            lost += 1;
                        }
                        next = next.wrapping_add(1);
                    }
                } else {
                    let mut taken = std::vec![0; count];
                    let got = usize::from(ring.read(&mut taken));
                    prop_assert_eq!(got, count.min(model.len()));
                    for byte in &taken[..got] {
                        prop_assert_eq!(Some(*byte), model.pop_front());
                    }
                }
                prop_assert_eq!(usize::from(ring.available()), model.len());
                prop_assert_eq!(ring.lost(), lost);
            }
        }
    }
}
