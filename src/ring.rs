//! A receive ring without locks. One writer, usually an interrupt handler, puts bytes in; one
//! reader, the main loop, takes them out.
//!
//! Only the writer moves the head, and only the reader moves the tail. The writer writes a
//! byte before it moves the head past the byte, and the reader reads a byte before it moves
//! the tail past the byte. So the two never access the same byte at the same time. One byte
//! of the storage always stays free, so that a full ring differs from an empty one.

use crate::atomic::{AtomicPlace, AtomicU8, Ordering};

/// An index into the storage. (An 8-bit processor loads and stores only 8 bits at once.)
#[cfg(not(target_pointer_width = "16"))]
pub type Place = u16;
/// An index into the storage. (An 8-bit processor loads and stores only 8 bits at once.)
#[cfg(target_pointer_width = "16")]
pub type Place = u8;

/// Greatest size of the storage in bytes.
pub const MAX_STORAGE: usize = Place::MAX as usize + if size_of::<Place>() == 1 { 1 } else { 0 };

/// The positions of writer and reader.
///
/// ```
/// use mbm::ring::Positions;
///
/// static POSITIONS: Positions = Positions::new();
/// ```
#[derive(Debug, Default)]
#[repr(C)]
pub struct Positions {
    /// Index at which the writer puts the next byte.
    head: AtomicPlace,
    /// Index from which the reader takes the next byte.
    tail: AtomicPlace,
    /// Number of bytes that were lost because the ring was full; wraps.
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

/// A ring in storage of the caller, of at most [`MAX_STORAGE`] bytes.
///
/// ```
/// use mbm::ring::{Positions, Ring};
/// use std::sync::atomic::AtomicU8;
///
/// static BYTES: [AtomicU8; 64] = [const { AtomicU8::new(0) }; 64];
/// static POSITIONS: Positions = Positions::new();
/// static RECEIVED: Ring = Ring::new(&BYTES, &POSITIONS);
///
/// // In the interrupt handler of the UART, or of its DMA:
/// RECEIVED.put(17);
/// RECEIVED.write(&[3, 4]);
///
/// // In `Port::read`, which the main loop calls:
/// assert_eq!(RECEIVED.available(), 3);
/// let mut bytes = [0; 8];
/// assert_eq!(RECEIVED.read(&mut bytes), 3);
/// assert_eq!(bytes[..3], [17, 3, 4]);
/// assert_eq!(RECEIVED.lost(), 0);
/// RECEIVED.clear();
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Ring<'a> {
    bytes: &'a [AtomicU8],
    positions: &'a Positions,
}

impl<'a> Ring<'a> {
    /// A ring in `bytes`. It holds one byte less than `bytes` has.
    pub const fn new(bytes: &'a [AtomicU8], positions: &'a Positions) -> Self {
        Ring { bytes, positions }
    }

    /// The index after `index`, which is 0 at the end of the storage.
    fn next_index(&self, index: Place) -> Place {
        let next = index.wrapping_add(1);
        if usize::from(next) >= self.bytes.len() {
            0
        } else {
            next
        }
    }

    /// Puts a byte in. Returns false and counts the byte as lost if the ring is full. Only
    /// the writer may call this.
    pub fn put(&self, byte: u8) -> bool {
        let head = self.positions.head.load(Ordering::Relaxed);
        let next = self.next_index(head);
        // `Acquire`: the reader has read the byte at `head` before it is overwritten.
        if next != self.positions.tail.load(Ordering::Acquire) {
            if let Some(place) = self.bytes.get(usize::from(head)) {
                place.store(byte, Ordering::Relaxed);
                self.positions.head.store(next, Ordering::Release);
                return true;
            }
        }
        // Load and store, because a small core has no atomic addition. Only the writer
        // changes this count.
        let lost = self.positions.lost.load(Ordering::Relaxed);
        self.positions
            .lost
            .store(lost.wrapping_add(1), Ordering::Relaxed);
        false
    }

    /// Puts bytes in, in order. Returns how many fit; the others count as lost. Only the
    /// writer may call this.
    pub fn write(&self, bytes: &[u8]) -> u16 {
        let put = bytes.iter().filter(|byte| self.put(**byte)).count();
        put as u16
    }

    /// Takes bytes out, in order, at most `bytes.len()`. Returns their number. Only the
    /// reader may call this.
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
            tail = self.next_index(tail);
            count += 1;
        }
        self.positions.tail.store(tail, Ordering::Release);
        count
    }

    /// Number of bytes in the ring. Only the reader may call this.
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

    /// Discards all bytes in the ring. Only the reader may call this.
    pub fn clear(&self) {
        let head = self.positions.head.load(Ordering::Acquire);
        self.positions.tail.store(head, Ordering::Release);
    }

    /// Number of bytes that were lost because the ring was full. It wraps at 65536, on an
    /// 8-bit processor at 256. Writer and reader may call this.
    pub fn lost(&self) -> u16 {
        usize::from(self.positions.lost.load(Ordering::Relaxed)) as u16
    }
}
