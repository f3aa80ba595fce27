//! What the caller lends: a frame buffer, words to send and words to fill, and
//! counters to count in.

use crate::transaction::{Counter, COUNTERS};

/// What the caller lends to an engine.
///
/// The engine keeps every index and count within what [`Storage::room`] says, or
/// within the words that [`Storage::transmit_words`] and [`Storage::response_words`]
/// say, so storage need not check them.
pub trait Storage {
    /// Bytes of the frame buffer behind what was set aside, at most 255.
    fn room(&self) -> u8;

    /// A byte of the frame buffer.
    fn byte(&self, index: u8) -> u8;

    /// Sets a byte of the frame buffer.
    fn set_byte(&mut self, index: u8, byte: u8);

    /// `count` bytes of the frame buffer from `index` on, to look at.
    fn slice(&self, index: u8, count: u8) -> &[u8];

    /// `count` bytes of the frame buffer from `index` on.
    fn bytes(&mut self, index: u8, count: u8) -> &mut [u8];

    /// Moves `count` bytes of the frame buffer from `from` on to its front.
    fn move_down(&mut self, from: u8, count: u8) {
        for index in 0..count {
            let byte = self.byte(from + index);
            self.set_byte(index, byte);
        }
    }

    /// Sets the first `count` bytes of the frame buffer aside: it begins behind them.
    fn set_aside(&mut self, count: u8);

    /// Has the frame buffer begin with the `count` bytes again that were set aside.
    fn take_back(&mut self, count: u8);

    /// The words that writing requests send, at most 255.
    fn transmit(&mut self) -> &mut [u16];

    /// How many words there are to send.
    fn transmit_words(&self) -> u8;

    /// Writes `count` bytes of the words to send into the frame buffer from `to` on; of
    /// each word the low byte first, or the high one if `high_first`.
    fn send_words(&mut self, to: u8, count: u8, high_first: bool);

    /// The words that a successful read fills, at most 255.
    fn response(&mut self) -> &mut [u16];

    /// How many words there are to fill.
    fn response_words(&self) -> u8;

    /// Fills words from `count` bytes of the frame buffer from `from` on; of each word
    /// the low byte first, or the high one if `high_first`. Of an odd count the last
    /// high byte is 0.
    fn take_words(&mut self, from: u8, count: u8, high_first: bool);

    /// Adds to a counter, if there is storage for counters.
    fn count(&mut self, counter: Counter, more: u16);
}

/// Storage in Rust: arrays, slices or whatever else holds bytes and words. An index
/// that is out of range reads 0 and writes nothing.
#[derive(Clone, Hash, Debug, Default)]
pub struct Buffers<F, R, T> {
    frame: F,
    /// Bytes at the front of the frame buffer that are set aside.
    aside: u8,
    response: R,
    transmit: T,
    /// What happened on the line, by [`Counter`]; each wraps at 2^32.
    pub counters: [u32; COUNTERS],
}

impl<F, R, T> Buffers<F, R, T> {
    /// A frame buffer of at least 8 bytes, of which at most 255 are used, words for
    /// replies, and words to send.
    pub const fn new(frame: F, response: R, transmit: T) -> Self {
        Buffers {
            frame,
            aside: 0,
            response,
            transmit,
            counters: [0; COUNTERS],
        }
    }
}

/// At most as many as an index counts.
fn count(items: usize) -> u8 {
    items.min(usize::from(u8::MAX)) as u8
}

impl<F, R, T> Storage for Buffers<F, R, T>
where
    F: AsRef<[u8]> + AsMut<[u8]>,
    R: AsRef<[u16]> + AsMut<[u16]>,
    T: AsRef<[u16]> + AsMut<[u16]>,
{
    fn room(&self) -> u8 {
        count(self.frame.as_ref().len()).saturating_sub(self.aside)
    }

    fn byte(&self, index: u8) -> u8 {
        let place = usize::from(self.aside) + usize::from(index);
        self.frame.as_ref().get(place).copied().unwrap_or(0)
    }

    fn set_byte(&mut self, index: u8, byte: u8) {
        let place = usize::from(self.aside) + usize::from(index);
        if let Some(place) = self.frame.as_mut().get_mut(place) {
            *place = byte;
        }
    }

    fn slice(&self, index: u8, count: u8) -> &[u8] {
        let first = usize::from(self.aside) + usize::from(index);
        let bytes = self.frame.as_ref();
        bytes
            .get(first..first + usize::from(count))
            .unwrap_or_default()
    }

    fn bytes(&mut self, index: u8, count: u8) -> &mut [u8] {
        let first = usize::from(self.aside) + usize::from(index);
        let bytes = self.frame.as_mut();
        bytes
            .get_mut(first..first + usize::from(count))
            .unwrap_or_default()
    }

    fn set_aside(&mut self, count: u8) {
        self.aside += count;
    }

    fn take_back(&mut self, count: u8) {
        self.aside -= count;
    }

    fn transmit(&mut self) -> &mut [u16] {
        self.transmit.as_mut()
    }

    fn transmit_words(&self) -> u8 {
        count(self.transmit.as_ref().len())
    }

    fn send_words(&mut self, to: u8, count: u8, high_first: bool) {
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

    fn response(&mut self) -> &mut [u16] {
        self.response.as_mut()
    }

    fn response_words(&self) -> u8 {
        count(self.response.as_ref().len())
    }

    fn take_words(&mut self, from: u8, count: u8, high_first: bool) {
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

    fn count(&mut self, counter: Counter, more: u16) {
        if let Some(count) = self.counters.get_mut(counter as usize) {
            *count = count.wrapping_add(more.into());
        }
    }
}
