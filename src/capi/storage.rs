//! The buffers and counters that C lends.

use crate::transaction::{Counter, Storage, COUNTERS};
use core::slice::{from_raw_parts, from_raw_parts_mut};

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
// In this order: see `Transaction`.
#[repr(C)]
pub(super) struct LentByC {
    pub(super) response: *mut u16,
    pub(super) transmit: *mut u16,
    pub(super) frame: *mut u8,
    pub(super) counters: *mut mbm_counters,
    pub(super) frame_bytes: usize,
    pub(super) response_words: u8,
    pub(super) transmit_words: u8,
}

impl LentByC {
    /// Turns zeroed storage into no buffers; a slice may not start at NULL.
    #[cfg_attr(target_os = "none", inline(never))]
    pub(super) fn preset(&mut self) {
        self.response = core::ptr::dangling_mut();
        self.transmit = core::ptr::dangling_mut();
        self.frame = core::ptr::dangling_mut();
    }
}

// SAFETY, of all functions here: mbm_master_setBuffers demands three buffers
// that do not overlap, of these lengths, valid for as long as the object is
// used (until then, and where it was given none, the length is 0); each is lent for as long as `self` is borrowed.
impl Storage for LentByC {
    fn frame(&mut self) -> &mut [u8] {
        // SAFETY: see above. (The compiler tests for NULL where it is not told.)
        unsafe {
            core::hint::assert_unchecked(!self.frame.is_null());
            from_raw_parts_mut(self.frame, self.frame_bytes)
        }
    }

    fn transmit(&mut self) -> &mut [u16] {
        // SAFETY: see above.
        unsafe { from_raw_parts_mut(self.transmit, self.transmit_words.into()) }
    }

    fn response(&mut self) -> &mut [u16] {
        // SAFETY: see above.
        unsafe { from_raw_parts_mut(self.response, self.response_words.into()) }
    }

    fn frame_and_transmit(&mut self) -> (&mut [u8], &[u16]) {
        // SAFETY: see above; the two do not overlap.
        unsafe {
            (
                from_raw_parts_mut(self.frame, self.frame_bytes),
                from_raw_parts(self.transmit, self.transmit_words.into()),
            )
        }
    }

    fn frame_and_response(&mut self) -> (&[u8], &mut [u16]) {
        // SAFETY: see above; the two do not overlap.
        unsafe {
            (
                from_raw_parts(self.frame, self.frame_bytes),
                from_raw_parts_mut(self.response, self.response_words.into()),
            )
        }
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
