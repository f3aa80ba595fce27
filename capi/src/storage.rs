//! The buffers and counters that C lends.

use core::slice::{from_raw_parts, from_raw_parts_mut};
use mbm::bytes::copy_words;
use mbm::engine::{Counter, Storage, Words, COUNTERS};
use mbm::FIRMWARE;

/// What happened on the line, since the caller zeroed it. Each wraps at 2^32.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct mbm_counters {
    /// Requests sent, retries included.
    pub requests: u32,
    /// Replies that answered a request, exceptions included.
    pub replies: u32,
    /// Replies that were exceptions.
    pub exceptions: u32,
    /// Requests whose reply arrived damaged.
    pub badCrc: u32,
    /// Requests that were not answered in time.
    pub timeouts: u32,
    /// Frames with a right CRC of other units, or that answered no request of
    /// ours, while a reply was waited for.
    pub foreignFrames: u32,
    /// Replies that were found behind bytes that were no frame.
    pub resynchronisations: u32,
    /// Bytes sent.
    pub bytesSent: u32,
    /// Bytes received, foreign ones and noise included.
    pub bytesReceived: u32,
}

const _: () = assert!(size_of::<mbm_counters>() == COUNTERS * size_of::<u32>());

/// What mbm_master_setBuffers was given.
// In this order: see `Engine`.
#[repr(C)]
pub(super) struct LentByC {
    pub(super) frame_bytes: u8,
    pub(super) response_words: u8,
    pub(super) transmit_words: u8,
    pub(super) response: *mut u16,
    pub(super) transmit: *mut u16,
    pub(super) frame: *mut u8,
    pub(super) counters: *mut mbm_counters,
}

/// Words from a pointer on; none where nobody lent any.
///
/// # Safety
/// `first` points to so many words, or is NULL.
unsafe fn words<'a>(first: *mut u16, count: u8) -> &'a mut [u16] {
    if first.is_null() {
        return &mut [];
    }
    // SAFETY: not NULL; the rest as the caller promises.
    unsafe { from_raw_parts_mut(first, count.into()) }
}

// Nothing is checked here, for its bytes: mbm_master_setBuffers demands three buffers
// that do not overlap, of these lengths, valid for as long as the object is used.
// The engine keeps every index below `room`, and below the words that it asks for;
// `tests/storage_bounds.rs` holds it to that. Without buffers nothing is requested.
impl Storage for LentByC {
    type Count = u8;

    fn room(&self) -> u8 {
        self.frame_bytes
    }

    #[inline(always)]
    fn byte(&self, index: u8) -> u8 {
        // SAFETY: below `frame_bytes`, see above.
        unsafe { *self.frame.add(index.into()) }
    }

    #[inline(always)]
    fn set_byte(&mut self, index: u8, byte: u8) {
        // SAFETY: below `frame_bytes`, see above.
        unsafe { *self.frame.add(index.into()) = byte }
    }

    #[inline(always)]
    fn slice(&self, index: u8, count: u8) -> &[u8] {
        // SAFETY: up to `frame_bytes`, see above.
        unsafe { from_raw_parts(self.frame.add(index.into()), count.into()) }
    }

    #[inline(always)]
    fn bytes(&mut self, index: u8, count: u8) -> &mut [u8] {
        // SAFETY: up to `frame_bytes`, see above.
        unsafe { from_raw_parts_mut(self.frame.add(index.into()), count.into()) }
    }

    // Volatile, or LLVM would call memmove of libc.
    #[cfg_attr(target_os = "none", inline(never))]
    fn move_down(&mut self, from: u8, count: u8) {
        // SAFETY: both stretches lie within `frame_bytes`, see above.
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

    fn set_aside(&mut self, count: u8) {
        // SAFETY: up to `frame_bytes`, see above.
        self.frame = unsafe { self.frame.add(count.into()) };
        self.frame_bytes -= count;
    }

    fn take_back(&mut self, count: u8) {
        // SAFETY: as many as were set aside.
        self.frame = unsafe { self.frame.sub(count.into()) };
        self.frame_bytes += count;
    }

    // On a microcontroller once, not at every call: flash.
    #[cfg_attr(all(feature = "counters", target_os = "none"), inline(never))]
    fn count(&mut self, counter: Counter, more: u16) {
        if !cfg!(feature = "counters") || self.counters.is_null() {
            return;
        }
        // SAFETY: the caller's counters are COUNTERS integers in a row, and
        // `counter` is less than that.
        unsafe {
            let counter = self.counters.cast::<u32>().add(counter as usize);
            *counter = (*counter).wrapping_add(more.into());
        }
    }
}

impl Words for LentByC {
    fn transmit(&mut self) -> &mut [u16] {
        // SAFETY: see above.
        unsafe { words(self.transmit, self.transmit_words) }
    }

    fn transmit_words(&self) -> u8 {
        self.transmit_words
    }

    #[inline(always)]
    fn send_words(&mut self, to: u8, count: u8, high_first: bool) {
        // SAFETY: of `transmit_words`, and below `frame_bytes`, see above.
        unsafe {
            if !FIRMWARE && high_first {
                let words = from_raw_parts(self.transmit.cast(), count.into());
                return copy_words(self.bytes(to, count), words);
            }
            let flip = flip(high_first);
            let words = self.transmit.cast::<u8>();
            let mut place = self.frame.add(to.into());
            for index in 0..count {
                *place = *words.add((index ^ flip).into());
                place = place.add(1);
            }
        }
    }

    fn response(&mut self) -> &mut [u16] {
        // SAFETY: see above.
        unsafe { words(self.response, self.response_words) }
    }

    fn response_words(&self) -> u8 {
        self.response_words
    }

    #[inline(always)]
    fn take_words(&mut self, from: u8, count: u8, high_first: bool) {
        // SAFETY: below `frame_bytes`, and of `response_words`, see above.
        unsafe {
            if !FIRMWARE && high_first {
                let words = from_raw_parts_mut(self.response.cast(), count.into());
                return copy_words(words, self.slice(from, count));
            }
            let mut word = self.response;
            let mut byte = self.frame.add(from.into());
            // The CRC stands there, and is in no word.
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

/// What turns the index of a byte on the wire into its index in memory.
const fn flip(high_first: bool) -> u8 {
    (high_first != cfg!(target_endian = "big")) as u8
}
