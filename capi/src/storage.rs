//! The buffers and counters that belong to the C program.

use core::slice::from_raw_parts_mut;
use mbm::engine::{MicrosSetting, Settings, Storage, Words, COUNTERS};
use mbm::time::millis;

/// Counters of the events on the line since you zeroed them. Each wraps at 2^32.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct mbm_counters {
    /// Requests sent, including retries.
    pub requests: u32,
    /// Replies that matched a request, including exceptions.
    pub replies: u32,
    /// Replies that were exceptions.
    pub exceptions: u32,
    /// Requests whose reply arrived with a wrong CRC.
    pub badCrc: u32,
    /// Requests without a reply within the response timeout.
    pub timeouts: u32,
    /// Frames with a right CRC that arrived during the wait for a reply, from another unit
    /// or not matching the request.
    pub foreignFrames: u32,
    /// Replies that were found after bytes that were not a frame.
    pub resynchronisations: u32,
    /// Bytes sent.
    pub bytesSent: u32,
    /// Bytes received, including those of foreign frames and noise.
    pub bytesReceived: u32,
}

const _: () = assert!(size_of::<mbm_counters>() == COUNTERS * size_of::<u32>());

/// The words of a node, which mbm_node_begin sets, and the time that its replies may take.
#[repr(C)]
pub(super) struct NodeWords {
    pub(super) response_words: u8,
    pub(super) transmit_words: u8,
    /// The node's functions do not wait for the reply.
    pub(super) is_non_blocking: bool,
    pub(super) response_timeout: MicrosSetting<{ millis(2000) }>,
    pub(super) response: *mut u16,
    pub(super) transmit: *mut u16,
}

impl NodeWords {
    /// The words that reads fill.
    pub(super) fn response(&self) -> &[u16] {
        // SAFETY: as the header of mbm_node_begin demands.
        unsafe { words(self.response, self.response_words) }
    }

    /// The words that reads fill, to be changed.
    pub(super) fn response_mut(&mut self) -> &mut [u16] {
        // SAFETY: as the header of mbm_node_begin demands.
        unsafe { words(self.response, self.response_words) }
    }

    /// The words that writes send.
    pub(super) fn transmit(&mut self) -> &mut [u16] {
        // SAFETY: as the header of mbm_node_begin demands.
        unsafe { words(self.transmit, self.transmit_words) }
    }
}

/// The frame buffer and the counters of a line, and the words of the node whose request is
/// pending.
// The order of the fields saves flash: see `Engine`.
#[repr(C)]
pub(super) struct LineStorage {
    pub(super) frame_bytes: u8,
    pub(super) frame: *mut u8,
    /// Set before each request; not used without one.
    pub(super) words: *mut NodeWords,
    pub(super) counters: *mut mbm_counters,
}

impl LineStorage {
    /// Sets the frame buffer.
    pub(super) fn set_frame(&mut self, frame: *mut u8, bytes: u16) {
        self.frame = frame;
        // No frame of a node is longer than 255 bytes.
        self.frame_bytes = bytes.min(u8::MAX.into()) as u8;
    }
}

/// The array of `count` words at `first`; an empty one if `first` is NULL.
///
/// # Safety
/// `first` is NULL or points to `count` words.
unsafe fn words<'a>(first: *mut u16, count: u8) -> &'a mut [u16] {
    if first.is_null() {
        return &mut [];
    }
    from_raw_parts_mut(first, count.into())
}

/// Implements the functions of [`Storage`] for a struct with the fields `frame`,
/// `frame_bytes` and `counters`: a frame buffer of the C program, whose lengths are of the
/// type `$count`.
///
/// To save flash, no function here checks an index. The C function that sets the fields
/// demands a buffer of that length, and counters or NULL, valid for as long as the object is
/// used. The engine and the client's TCP transport keep every index within the buffer:
/// `tests/storage_bounds.rs`, `tests/client_bounds.rs` and `c-tests/test_buffers.c`
/// prove that.
macro_rules! frame_storage {
    ($count:ty) => {
        type Count = $count;

        fn capacity(&self) -> $count {
            self.frame_bytes
        }

        fn byte(&self, index: $count) -> u8 {
            // SAFETY: below `frame_bytes`, see above.
            unsafe { *self.frame.add(index.into()) }
        }

        fn set_byte(&mut self, index: $count, byte: u8) {
            // SAFETY: below `frame_bytes`, see above.
            unsafe { *self.frame.add(index.into()) = byte }
        }

        fn slice(&self, index: $count, count: $count) -> &[u8] {
            // SAFETY: up to `frame_bytes`, see above.
            unsafe { core::slice::from_raw_parts(self.frame.add(index.into()), count.into()) }
        }

        fn bytes(&mut self, index: $count, count: $count) -> &mut [u8] {
            // SAFETY: up to `frame_bytes`, see above.
            unsafe { core::slice::from_raw_parts_mut(self.frame.add(index.into()), count.into()) }
        }

        // Not inlined on a microcontroller, to save flash.
        fn count(&mut self, counter: mbm::engine::Counter, more: u32) {
            if self.counters.is_null() {
                return;
            }
            // SAFETY: mbm_counters is an array of COUNTERS integers, and `counter` is less
            // than COUNTERS.
            unsafe {
                let counter = self.counters.cast::<u32>().add(counter as usize);
                *counter = (*counter).wrapping_add(more);
            }
        }
    };
}
pub(crate) use frame_storage;

// Without a frame buffer, the engine refuses every request.
impl Storage for LineStorage {
    frame_storage!(u8);

    // Volatile: otherwise LLVM would call memmove of libc, which costs flash.
    fn move_down(&mut self, from: u8, count: u8) {
        // SAFETY: both ranges lie within `frame_bytes`, see above.
        unsafe {
            let mut to = self.frame;
            let mut from = to.add(from.into());
            for _ in 0..count {
                to.write_volatile(*from);
                to = to.add(1);
                from = from.add(1);
            }
        }
    }
}

// SAFETY, below: a request is pending, so `words` points to those of its node. The engine keeps
// every index below the number of words, too.
impl Words for LineStorage {
    fn response_timeout(&self, _settings: &Settings) -> u32 {
        // SAFETY: see above.
        unsafe { (*self.words).response_timeout.get() }
    }

    fn transmit(&mut self) -> &mut [u16] {
        // SAFETY: see above.
        unsafe { (*self.words).transmit() }
    }

    fn transmit_words(&self) -> u8 {
        // SAFETY: see above.
        unsafe { (*self.words).transmit_words }
    }

    fn load_words(&mut self, to: u8, count: u8, high_first: bool) {
        // SAFETY: within `transmit_words` and `frame_bytes`, see above.
        unsafe {
            let flip = flip(high_first);
            let words = (*self.words).transmit.cast::<u8>();
            let mut place = self.frame.add(to.into());
            for index in 0..count {
                *place = *words.add((index ^ flip).into());
                place = place.add(1);
            }
        }
    }

    fn response(&self) -> &[u16] {
        // SAFETY: see above.
        unsafe { (*self.words).response() }
    }

    fn response_words(&self) -> u8 {
        // SAFETY: see above.
        unsafe { (*self.words).response_words }
    }

    fn store_words(&mut self, from: u8, count: u8, high_first: bool) {
        // SAFETY: within `frame_bytes` and `response_words`, see above.
        unsafe {
            let mut word = (*self.words).response;
            let mut byte = self.frame.add(from.into());
            // An odd last byte is padded with 0. This overwrites a byte of the CRC, which
            // has been checked.
            *byte.add(count.into()) = 0;
            for _ in 0..count.div_ceil(2) {
                let bytes = [*byte, *byte.add(1)];
                *word = if high_first {
                    u16::from_be_bytes(bytes)
                } else {
                    u16::from_le_bytes(bytes)
                };
                word = word.add(1);
                byte = byte.add(2);
            }
        }
    }
}

/// The mask that converts the index of a byte on the wire to its index in memory, by XOR.
const fn flip(high_first: bool) -> u8 {
    (high_first != cfg!(target_endian = "big")) as u8
}
