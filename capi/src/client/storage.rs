//! The buffers and hooks that the begin functions and settings of a client receive.

use crate::storage::{frame_storage, mbm_counters};
use core::ffi::c_void;
use core::slice::{from_raw_parts, from_raw_parts_mut};
use mbm::client::{ClientStorage, Policy, RequestState, UnitRecord};
use mbm::engine::Storage;
use mbm::error::Status;

/// The function that computes how long a request waits for its repetition. `None` means that
/// the client does not repeat it. (A pointer, for the reason that [`UnitRecords`] gives.)
pub(super) type Again = fn(&mut ClientBuffers, &Policy, &RequestState, Status) -> Option<u32>;

/// The functions that use the records of units. (Called through a pointer that
/// mbm_client_setUnits sets, so that firmware that does not call it does not contain them.)
pub(super) struct UnitRecords {
    pub(super) rest: fn(&mut ClientBuffers, unit: u8, now: u32) -> u32,
    pub(super) note: fn(&mut ClientBuffers, unit: u8, ended: Ended, now: u32),
    pub(super) retry_limit: fn(&mut ClientBuffers, unit: u8) -> u8,
}

/// How a request to a unit ended, and whether the client repeats it.
pub(super) struct Ended {
    pub(super) status: Status,
    pub(super) again: bool,
}

/// The buffers and hooks of a client.
#[repr(C)]
pub(crate) struct ClientBuffers {
    pub(super) frame: *mut u8,
    pub(super) outgoing: *mut u8,
    pub(super) counters: *mut mbm_counters,
    pub(super) units: *mut UnitRecord,
    pub(super) unit_records: Option<&'static UnitRecords>,
    pub(super) again: Option<Again>,
    pub(super) random: Option<unsafe extern "C" fn(context: *mut c_void) -> u32>,
    pub(super) random_context: *mut c_void,
    pub(super) frame_bytes: u16,
    pub(super) outgoing_bytes: u16,
    pub(super) unit_count: u8,
    /// The response timeout of the unit that `rest` last looked at.
    pub(super) unit_timeout_ms: u32,
}

// SAFETY, of all functions here: each pointer is NULL, or valid as the C function that set
// it demands, for as long as the object is used. A slice lives only as long as `self` is
// borrowed.
impl Storage for ClientBuffers {
    frame_storage!(u16);
}

impl ClientStorage for ClientBuffers {
    fn outgoing(&mut self) -> &mut [u8] {
        // SAFETY: see above; the begin function of a TCP client set it, and only TCP uses it.
        unsafe { from_raw_parts_mut(self.outgoing, self.outgoing_bytes.into()) }
    }

    fn to_send(&mut self, from: u16, to: u16) -> &mut [u8] {
        // SAFETY: see above; the client keeps `from` and `to` within the buffer.
        unsafe { from_raw_parts_mut(self.outgoing.add(from.into()), (to - from).into()) }
    }

    fn units(&self) -> &[UnitRecord] {
        if self.units.is_null() {
            return &[];
        }
        // SAFETY: see above.
        unsafe { from_raw_parts(self.units, self.unit_count.into()) }
    }

    fn units_mut(&mut self) -> &mut [UnitRecord] {
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

    fn unit_timeout_ms(&self, _: u8) -> u32 {
        self.unit_timeout_ms
    }

    fn again(&mut self, policy: &Policy, state: &RequestState, status: Status) -> Option<u32> {
        self.again
            .and_then(|again| again(self, policy, state, status))
    }

    fn random(&mut self) -> u32 {
        match self.random {
            // SAFETY: the hook keeps the contract of mbm_client_setJitter.
            Some(random) => unsafe { random(self.random_context) },
            None => 0,
        }
    }
}
