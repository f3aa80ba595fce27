//! What the begin functions and settings of a client lend.

use crate::storage::mbm_counters;
use core::ffi::c_void;
use core::slice::{from_raw_parts, from_raw_parts_mut};
use mbm::client::{Means, Policy, Unit};
use mbm::engine::{Counter, Storage};
use mbm::error::Status;

/// How long a request waits to be asked again, if it is. (A pointer, as [`Treatment`].)
pub(super) type Again = fn(&mut LentByC, &Policy, retries: u8, Status) -> Option<u32>;

/// How a unit is treated as its record says. (Behind a pointer, so that firmware
/// without records carries none of it.)
pub(super) struct Treatment {
    pub(super) rest: fn(&mut LentByC, unit: u8, now: u32) -> u32,
    pub(super) note: fn(&mut LentByC, unit: u8, told: Told, now: u32),
}

/// How a request to a unit ended, and whether it is asked again.
pub(super) struct Told {
    pub(super) status: Status,
    pub(super) again: bool,
}

/// What the begin functions and settings lend.
#[repr(C)]
pub(super) struct LentByC {
    pub(super) frame: *mut u8,
    pub(super) outgoing: *mut u8,
    pub(super) counters: *mut mbm_counters,
    pub(super) units: *mut Unit,
    pub(super) treatment: Option<&'static Treatment>,
    pub(super) again: Option<Again>,
    pub(super) random: Option<unsafe extern "C" fn(context: *mut c_void) -> u32>,
    pub(super) random_context: *mut c_void,
    pub(super) frame_bytes: u16,
    pub(super) outgoing_bytes: u16,
    pub(super) unit_count: u8,
}

// SAFETY, of all functions here: each pointer is NULL, or what the function of
// the header that set it demands, valid for as long as the object is used; what
// is NULL has no length, and each is lent for as long as `self` is borrowed.
//
// Nothing is checked here, for its bytes: engine and TCP line keep every index within
// `room`. `c-tests/test_client_buffers.c` holds them to that under AddressSanitizer.
impl Storage for LentByC {
    type Count = u16;

    fn room(&self) -> u16 {
        self.frame_bytes
    }

    #[inline(always)]
    fn byte(&self, index: u16) -> u8 {
        // SAFETY: below `frame_bytes`, see above.
        unsafe { *self.frame.add(index.into()) }
    }

    #[inline(always)]
    fn set_byte(&mut self, index: u16, byte: u8) {
        // SAFETY: below `frame_bytes`, see above.
        unsafe { *self.frame.add(index.into()) = byte }
    }

    #[inline(always)]
    fn slice(&self, index: u16, count: u16) -> &[u8] {
        // SAFETY: up to `frame_bytes`, see above.
        unsafe { from_raw_parts(self.frame.add(index.into()), count.into()) }
    }

    #[inline(always)]
    fn bytes(&mut self, index: u16, count: u16) -> &mut [u8] {
        // SAFETY: up to `frame_bytes`, see above.
        unsafe { from_raw_parts_mut(self.frame.add(index.into()), count.into()) }
    }

    fn set_aside(&mut self, count: u16) {
        // SAFETY: up to `frame_bytes`, see above.
        self.frame = unsafe { self.frame.add(count.into()) };
        self.frame_bytes -= count;
    }

    fn take_back(&mut self, count: u16) {
        // SAFETY: as many as were set aside.
        self.frame = unsafe { self.frame.sub(count.into()) };
        self.frame_bytes += count;
    }

    #[cfg_attr(all(feature = "counters", target_os = "none"), inline(never))]
    fn count(&mut self, counter: Counter, more: u16) {
        if cfg!(feature = "counters") && !self.counters.is_null() {
            // SAFETY: see above, and mbm_counters are integers in a row, in the
            // order of `Counter`.
            unsafe {
                let counter = self.counters.cast::<u32>().add(counter as usize);
                *counter = (*counter).wrapping_add(more.into());
            }
        }
    }
}

impl Means for LentByC {
    fn outgoing(&mut self) -> &mut [u8] {
        // SAFETY: see above; a TCP client is begun with one, no other asks for it.
        unsafe { from_raw_parts_mut(self.outgoing, self.outgoing_bytes.into()) }
    }

    fn to_send(&mut self, from: u16, to: u16) -> &mut [u8] {
        // SAFETY: see above; the client keeps its places within the buffer.
        unsafe { from_raw_parts_mut(self.outgoing.add(from.into()), (to - from).into()) }
    }

    fn units(&mut self) -> &mut [Unit] {
        if self.units.is_null() {
            return &mut [];
        }
        // SAFETY: see above.
        unsafe { from_raw_parts_mut(self.units, self.unit_count.into()) }
    }

    fn rest(&mut self, unit: u8, now: u32) -> u32 {
        match self.treatment {
            Some(treatment) => (treatment.rest)(self, unit, now),
            None => 0,
        }
    }

    fn note(&mut self, unit: u8, status: Status, again: bool, now: u32) {
        if let Some(treatment) = self.treatment {
            (treatment.note)(self, unit, Told { status, again }, now);
        }
    }

    fn again(&mut self, policy: &Policy, retries: u8, status: Status) -> Option<u32> {
        self.again
            .and_then(|again| again(self, policy, retries, status))
    }

    fn random(&mut self) -> u32 {
        match self.random {
            // SAFETY: the hook keeps the contract of mbm_client_setJitter.
            Some(random) => unsafe { random(self.random_context) },
            None => 0,
        }
    }
}
