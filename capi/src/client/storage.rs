//! What the begin functions and settings of a client lend.

use crate::storage::{frame_storage, mbm_counters};
use core::ffi::c_void;
use core::slice::from_raw_parts_mut;
use mbm::client::{ClientStorage, Policy, Unit};
use mbm::engine::Storage;
use mbm::error::Status;

/// How long a request waits to be asked again, if it is. (A pointer, as [`UnitRecords`].)
pub(super) type Again = fn(&mut ClientBuffers, &Policy, retries: u8, Status) -> Option<u32>;

/// How a unit is treated as its record says. (Behind a pointer, so that firmware
/// without records carries none of it.)
pub(super) struct UnitRecords {
    pub(super) rest: fn(&mut ClientBuffers, unit: u8, now: u32) -> u32,
    pub(super) note: fn(&mut ClientBuffers, unit: u8, ended: Ended, now: u32),
}

/// How a request to a unit ended, and whether it is asked again.
pub(super) struct Ended {
    pub(super) status: Status,
    pub(super) again: bool,
}

/// What the begin functions and settings lend.
#[repr(C)]
pub(super) struct ClientBuffers {
    pub(super) frame: *mut u8,
    pub(super) outgoing: *mut u8,
    pub(super) counters: *mut mbm_counters,
    pub(super) units: *mut Unit,
    pub(super) unit_records: Option<&'static UnitRecords>,
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
impl Storage for ClientBuffers {
    frame_storage!(u16);
}

impl ClientStorage for ClientBuffers {
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
        match self.unit_records {
            Some(unit_records) => (unit_records.rest)(self, unit, now),
            None => 0,
        }
    }

    fn note(&mut self, unit: u8, status: Status, again: bool, now: u32) {
        if let Some(unit_records) = self.unit_records {
            (unit_records.note)(self, unit, Ended { status, again }, now);
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
