//! The caller's memory: a frame buffer, transmit words, response words and counters.

use super::Settings;
use crate::bytes::move_to_front;
use core::fmt::Debug;
use core::hash::Hash;
use core::ops::{Add, AddAssign, Sub, SubAssign};

/// The counters, in the order in which they are stored.
///
/// ```
/// # include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/doc/pump.rs"));
/// # fn main() -> Result<(), mbm::Error> {
/// # let buffers = mbm::master::Buffers::new([0; 64], [0; 20], [0; 20]);
/// # let mut master = mbm::master::Master::new(17, rtu(), buffers);
/// use mbm::master::Counter;
///
/// master.holding_registers::<2>(107)?;
/// assert_eq!(master.storage().counters[Counter::Replies as usize], 1);
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
#[repr(u8)]
pub enum Counter {
    /// Requests sent, retries included.
    Requests,
    /// Replies that answered a request, exceptions included.
    Replies,
    /// Replies that were exceptions.
    Exceptions,
    /// Complete replies with a wrong CRC.
    BadCrc,
    /// Requests without a reply in time.
    Timeouts,
    /// Frames with a right CRC that did not answer the request.
    ForeignFrames,
    /// Replies that were found after bytes that were no frame.
    Resynchronisations,
    /// Bytes sent.
    BytesSent,
    /// Bytes received.
    BytesReceived,
}

/// How many counters there are.
pub const COUNTERS: usize = 9;

/// A number of bytes in a frame buffer: [`u8`] for buffers of at most 255 bytes, which costs
/// an AVR half as much as [`u16`].
///
/// ```
/// use mbm::master::Count;
///
/// assert_eq!(u8::ZERO, 0);
/// ```
pub trait Count:
    Copy
    + Ord
    + Hash
    + Debug
    + Add<Output = Self>
    + Sub<Output = Self>
    + AddAssign
    + SubAssign
    + From<u8>
    + Into<usize>
{
    /// No byte.
    const ZERO: Self;

    /// This number of bytes of a frame buffer.
    // The core calls it; it may change in any version.
    #[doc(hidden)]
    fn of(bytes: usize) -> Self;

    /// The next number; the greatest one stays.
    // The core calls it; it may change in any version.
    #[doc(hidden)]
    fn next(self) -> Self;

    /// The number in 16 bits.
    // The core calls it; it may change in any version.
    #[doc(hidden)]
    fn to_u16(self) -> u16;
}

impl Count for u8 {
    const ZERO: Self = 0;

    fn of(bytes: usize) -> Self {
        bytes as u8
    }

    fn next(self) -> Self {
        self.wrapping_add(u8::from(self != u8::MAX))
    }

    fn to_u16(self) -> u16 {
        self.into()
    }
}

impl Count for u16 {
    const ZERO: Self = 0;

    fn of(bytes: usize) -> Self {
        bytes as u16
    }

    fn next(self) -> Self {
        self.saturating_add(1)
    }

    fn to_u16(self) -> u16 {
        self
    }
}

impl Count for usize {
    const ZERO: Self = 0;

    fn of(bytes: usize) -> Self {
        bytes
    }

    fn next(self) -> Self {
        self.saturating_add(1)
    }

    fn to_u16(self) -> u16 {
        self as u16
    }
}

/// The memory of an engine or a server: a frame buffer, and counters.
///
/// They keep every index and count within `capacity`, so an implementation need not
/// check them.
///
/// ```
/// use mbm::client::{Frame, Storage};
///
/// /// Both `Frame` and `Buffers` are storage, and so are arrays of bytes.
/// fn is_storage(storage: impl Storage) {}
///
/// is_storage(Frame::new([0_u8; 256]));
/// is_storage([0_u8; 256]);
/// ```
pub trait Storage {
    /// The type of lengths and indexes.
    type Count: Count;

    /// Bytes of the frame buffer.
    // The core calls it; it may change in any version.
    #[doc(hidden)]
    fn capacity(&self) -> Self::Count;

    /// A byte of the frame buffer.
    // The core calls it; it may change in any version.
    #[doc(hidden)]
    fn byte(&self, index: Self::Count) -> u8;

    /// Sets a byte of the frame buffer.
    // The core calls it; it may change in any version.
    #[doc(hidden)]
    fn set_byte(&mut self, index: Self::Count, byte: u8);

    /// `count` bytes of the frame buffer from `index` on, to read.
    // The core calls it; it may change in any version.
    #[doc(hidden)]
    fn slice(&self, index: Self::Count, count: Self::Count) -> &[u8];

    /// `count` bytes of the frame buffer from `index` on, to read and write.
    // The core calls it; it may change in any version.
    #[doc(hidden)]
    fn bytes(&mut self, index: Self::Count, count: Self::Count) -> &mut [u8];

    /// Moves `count` bytes of the frame buffer from `from` on to its front.
    // The core calls it; it may change in any version.
    #[doc(hidden)]
    fn move_down(&mut self, from: Self::Count, count: Self::Count) {
        move_to_front(self.bytes(Self::Count::ZERO, from + count), from.into());
    }

    /// Adds `more` to a counter, if there is memory for counters.
    // The core calls it; it may change in any version.
    #[doc(hidden)]
    fn count(&mut self, _counter: Counter, _more: u32) {}
}

/// The memory of a master: transmit and response words beside the frame buffer. The engine
/// uses at most `transmit_words` and `response_words` words.
///
/// ```
/// use mbm::master::{Buffers, Words};
///
/// let mut buffers = Buffers::new([0; 64], [0; 20], [0; 10]);
/// buffers.transmit()[0] = 555;
/// assert_eq!(buffers.response().len(), 20);
/// ```
pub trait Words: Storage<Count = u8> {
    /// The response timeout in microseconds. `settings` has that of the line.
    // The core calls it; it may change in any version.
    #[doc(hidden)]
    fn response_timeout(&self, settings: &Settings) -> u32 {
        settings.response_timeout.get()
    }

    /// The transmit words, at most 255: write requests send them.
    fn transmit(&mut self) -> &mut [u16];

    /// How many transmit words there are.
    // The core calls it; it may change in any version.
    #[doc(hidden)]
    fn transmit_words(&self) -> u8;

    /// Copies `count` bytes of the transmit words into the frame buffer from `to` on: the high
    /// byte of each word first if `high_first`, otherwise the low byte.
    // The core calls it; it may change in any version.
    #[doc(hidden)]
    fn load_words(&mut self, to: u8, count: u8, high_first: bool);

    /// The response words, at most 255: a successful read fills them.
    fn response(&self) -> &[u16];

    /// How many response words there are.
    // The core calls it; it may change in any version.
    #[doc(hidden)]
    fn response_words(&self) -> u8;

    /// Fills the response words with `count` bytes of the frame buffer from `from` on: the high
    /// byte of each word first if `high_first`, otherwise the low byte. If `count` is odd, the
    /// missing byte of the last word is 0.
    // The core calls it; it may change in any version.
    #[doc(hidden)]
    fn store_words(&mut self, from: u8, count: u8, high_first: bool);
}

/// A frame buffer in Rust: an array, a slice or another container of bytes. An index out of
/// range reads 0 and writes nothing.
///
/// ```
/// use mbm::client::Frame;
///
/// // For any RTU frame; an ASCII frame needs 513.
/// let frame = Frame::new([0; 256]);
/// ```
#[derive(Clone, Hash, Debug, Default)]
pub struct Frame<F> {
    bytes: F,
}

impl<F> Frame<F> {
    /// A frame buffer of at least 8 bytes. 256 hold any RTU frame, 513 any ASCII frame.
    pub const fn new(bytes: F) -> Self {
        Frame { bytes }
    }
}

impl<F: AsRef<[u8]> + AsMut<[u8]>> Storage for Frame<F> {
    type Count = u16;

    fn capacity(&self) -> u16 {
        self.bytes.as_ref().len().min(u16::MAX.into()) as u16
    }

    fn byte(&self, index: u16) -> u8 {
        self.slice(index, 1).first().copied().unwrap_or(0)
    }

    fn set_byte(&mut self, index: u16, byte: u8) {
        self.bytes(index, 1).fill(byte);
    }

    fn slice(&self, index: u16, count: u16) -> &[u8] {
        let first = usize::from(index);
        let bytes = self.bytes.as_ref().get(first..first + usize::from(count));
        bytes.unwrap_or_default()
    }

    fn bytes(&mut self, index: u16, count: u16) -> &mut [u8] {
        let first = usize::from(index);
        let last = first + usize::from(count);
        let bytes = self.bytes.as_mut().get_mut(first..last);
        bytes.unwrap_or_default()
    }
}

macro_rules! bytes_are_a_frame_buffer {
    ($(($($generics:tt)*) $type:ty),*) => {$(
        impl<$($generics)*> Storage for $type {
            type Count = usize;

            fn capacity(&self) -> usize {
                self.len()
            }

            fn byte(&self, index: usize) -> u8 {
                self.get(index).copied().unwrap_or(0)
            }

            fn set_byte(&mut self, index: usize, byte: u8) {
                self.bytes(index, 1).fill(byte);
            }

            fn slice(&self, index: usize, count: usize) -> &[u8] {
                self.get(index..index + count).unwrap_or_default()
            }

            fn bytes(&mut self, index: usize, count: usize) -> &mut [u8] {
                self.get_mut(index..index + count).unwrap_or_default()
            }
        }
    )*};
}

// The frame buffers of a server in Rust. As of a `Frame`, a byte out of range reads 0.
bytes_are_a_frame_buffer!((const N: usize) [u8; N], () &mut [u8]);

/// The memory of a master in Rust. A word out of range is not filled, and is sent as 0.
///
/// ```
/// use mbm::master::Buffers;
///
/// // The frame buffer, the words that a read fills, the words that a write sends.
/// let buffers = Buffers::new([0; 64], [0; 20], [0; 20]);
/// assert_eq!(buffers.counters, [0; 9]);
/// ```
#[derive(Clone, Hash, Debug, Default)]
pub struct Buffers<F, R, T> {
    frame: Frame<F>,
    response: R,
    transmit: T,
    /// The counters, in the order of [`Counter`]. Each wraps at 2^32.
    pub counters: [u32; COUNTERS],
}

impl<F, R, T> Buffers<F, R, T> {
    /// Takes a frame buffer of at least 8 bytes, of which at most 255 are used; response words,
    /// which a read fills; and transmit words, which a write sends, also a write of a single
    /// register. A frame buffer of 13 + 2 N bytes holds every request and reply with N words,
    /// one of 13 + 4 N bytes also a late reply beside the right one. Response words may be `[]`
    /// if no request reads, transmit words if none writes.
    pub const fn new(frame: F, response: R, transmit: T) -> Self {
        Buffers {
            frame: Frame::new(frame),
            response,
            transmit,
            counters: [0; COUNTERS],
        }
    }
}

/// A number of items, limited to 255.
fn count(items: usize) -> u8 {
    items.min(usize::from(u8::MAX)) as u8
}

impl<F, R, T> Storage for Buffers<F, R, T>
where
    F: AsRef<[u8]> + AsMut<[u8]>,
{
    type Count = u8;

    fn capacity(&self) -> u8 {
        count(self.frame.bytes.as_ref().len())
    }

    fn byte(&self, index: u8) -> u8 {
        self.frame.byte(index.into())
    }

    fn set_byte(&mut self, index: u8, byte: u8) {
        self.frame.set_byte(index.into(), byte);
    }

    fn slice(&self, index: u8, count: u8) -> &[u8] {
        self.frame.slice(index.into(), count.into())
    }

    fn bytes(&mut self, index: u8, count: u8) -> &mut [u8] {
        self.frame.bytes(index.into(), count.into())
    }

    fn count(&mut self, counter: Counter, more: u32) {
        if let Some(count) = self.counters.get_mut(counter as usize) {
            *count = count.wrapping_add(more);
        }
    }
}

impl<F, R, T> Words for Buffers<F, R, T>
where
    F: AsRef<[u8]> + AsMut<[u8]>,
    R: AsRef<[u16]> + AsMut<[u16]>,
    T: AsRef<[u16]> + AsMut<[u16]>,
{
    fn transmit(&mut self) -> &mut [u16] {
        self.transmit.as_mut()
    }

    fn transmit_words(&self) -> u8 {
        count(self.transmit.as_ref().len())
    }

    fn load_words(&mut self, to: u8, count: u8, high_first: bool) {
        for index in 0..count {
            let word = self.transmit.as_ref().get(usize::from(index / 2));
            let [low, high] = word.map_or([0, 0], |word| word.to_le_bytes());
            let byte = if index.is_multiple_of(2) == high_first {
                high
            } else {
                low
            };
            self.set_byte(to + index, byte);
        }
    }

    fn response(&self) -> &[u16] {
        self.response.as_ref()
    }

    fn response_words(&self) -> u8 {
        count(self.response.as_ref().len())
    }

    fn store_words(&mut self, from: u8, count: u8, high_first: bool) {
        for index in 0..count.div_ceil(2) {
            let first = self.byte(from + 2 * index);
            let second = match 2 * index + 1 < count {
                true => self.byte(from + 2 * index + 1),
                false => 0,
            };
            if let Some(word) = self.response.as_mut().get_mut(usize::from(index)) {
                *word = match high_first {
                    true => u16::from_be_bytes([first, second]),
                    false => u16::from_le_bytes([first, second]),
                };
            }
        }
    }
}
