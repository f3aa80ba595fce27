//! The buffers and counters that C lends.

use crate::transaction::{Counter, Storage, COUNTERS};

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
#[derive(Clone, Copy)]
pub(super) struct LentByC {
    pub(super) response: *mut u16,
    pub(super) transmit: *mut u16,
    pub(super) frame: *mut u8,
    pub(super) counters: *mut mbm_counters,
    pub(super) response_words: u16,
    pub(super) transmit_words: u16,
    pub(super) frame_bytes: u16,
}

impl LentByC {
    pub(super) const NONE: LentByC = LentByC {
        response: core::ptr::null_mut(),
        transmit: core::ptr::null_mut(),
        frame: core::ptr::null_mut(),
        counters: core::ptr::null_mut(),
        response_words: 0,
        transmit_words: 0,
        frame_bytes: 0,
    };
}

/// The slice of C's pointer and length; a length of 0 may come with NULL.
///
/// # Safety
/// `length` items from `first` are valid and borrowed by nobody else.
unsafe fn slice<'a, T>(first: *mut T, length: u16) -> &'a mut [T] {
    if length == 0 {
        &mut []
    } else {
        // SAFETY: as the caller promises.
        unsafe { core::slice::from_raw_parts_mut(first, usize::from(length)) }
    }
}

// SAFETY, of all functions here: mbm_master_setBuffers demands three buffers
// that do not overlap, of these lengths, valid for as long as the object is
// used; each is lent for as long as `self` is borrowed.
impl Storage for LentByC {
    fn frame(&mut self) -> &mut [u8] {
        // SAFETY: see above.
        unsafe { slice(self.frame, self.frame_bytes) }
    }

    fn transmit(&mut self) -> &mut [u16] {
        // SAFETY: see above.
        unsafe { slice(self.transmit, self.transmit_words) }
    }

    fn response(&mut self) -> &mut [u16] {
        // SAFETY: see above.
        unsafe { slice(self.response, self.response_words) }
    }

    fn frame_and_transmit(&mut self) -> (&mut [u8], &[u16]) {
        // SAFETY: see above; the two do not overlap.
        unsafe {
            (
                slice(self.frame, self.frame_bytes),
                slice(self.transmit, self.transmit_words),
            )
        }
    }

    fn frame_and_response(&mut self) -> (&[u8], &mut [u16]) {
        // SAFETY: see above; the two do not overlap.
        unsafe {
            (
                slice(self.frame, self.frame_bytes),
                slice(self.response, self.response_words),
            )
        }
    }

    // On a microcontroller once, not at every call: flash.
    #[cfg_attr(all(feature = "counters", target_os = "none"), inline(never))]
    fn count(&mut self, counter: Counter, more: usize) {
        if !cfg!(feature = "counters") || self.counters.is_null() {
            return;
        }
        // SAFETY: the caller's counters are COUNTERS integers in a row, and
        // `counter` is less than that.
        unsafe {
            let counter = self.counters.cast::<u32>().add(counter as usize);
            *counter = (*counter).wrapping_add(more as u32);
        }
    }
}
