//! The records of units, and the setting that passes them to a client.

use super::object::mbm_client;
use super::repeat::allow_retries;
use super::settings::set;
use super::storage::UnitRecords;
use crate::pointers::{self, In};
use mbm::client::{find, note, rest, ClientStorage as _, UnitRecord};
use mbm::error::Status;
use mbm::time::LONGEST_TIMEOUT_MS;

/// The record of one unit, an item of the array for mbm_client_setUnits. You may read and
/// zero the counters at any time, but not from an interrupt; each wraps at 2^32.
#[repr(C)]
pub struct mbm_clientUnit {
    /// Requests that ended, without retries.
    pub requests: u32,
    /// Requests that the unit answered, also with an exception.
    pub replies: u32,
    /// Requests that the unit answered with an exception.
    pub exceptions: u32,
    /// Repetitions of requests.
    pub retries: u32,
    /// Set by you: the minimum time from the end of a request to the next request to this
    /// unit, in microseconds; a value above 2^31 (36 minutes) means 2^31.
    pub delayUs: u32,
    /// Private.
    lastUs: u32,
    /// Set by you: the response timeout of this unit in milliseconds, 1 to 1000000 (16
    /// minutes); 0: that of mbm_client_setResponseTimeout. mbm_client_setUnits refuses a
    /// greater number. If you set it later, it means 1000000.
    pub timeoutMs: u32,
    /// Set by you: the unit identifier, 0 to 255. mbm_client_setUnits refuses a greater number.
    /// If you set it later, the record is of no unit.
    pub unit: u16,
    /// The status of the last request that ended; MBM_OK if none has ended.
    pub status: u8,
    /// Private.
    cooling_down: u8,
    /// Set by you: how often the client repeats a request to this unit at most, 1 to 254;
    /// MBM_NO_RETRIES: never; 0: as often as mbm_client_setRetries says.
    pub retryLimit: u8,
}

const _: () = {
    use core::mem::offset_of;
    assert!(size_of::<mbm_clientUnit>() == size_of::<UnitRecord>());
    assert!(align_of::<mbm_clientUnit>() == align_of::<UnitRecord>());
    assert!(offset_of!(mbm_clientUnit, delayUs) == offset_of!(UnitRecord, delay));
    assert!(offset_of!(mbm_clientUnit, unit) == offset_of!(UnitRecord, unit));
    assert!(offset_of!(mbm_clientUnit, retryLimit) == offset_of!(UnitRecord, retry_limit));
    assert!(offset_of!(mbm_clientUnit, timeoutMs) == offset_of!(UnitRecord, timeout_ms));
    assert!(offset_of!(mbm_clientUnit, status) == offset_of!(UnitRecord, status));
};

/// Sets the records of units. In a record the client counts the requests to its unit. The
/// record's `delayUs` sets the minimum time between two requests to the unit; its `timeoutMs`
/// and `retryLimit` replace those of the client. You may change these three at any time.
///
/// @param units  your array of records, initialised with MBM_INIT except for the fields that you
///               set; NULL for none
/// @param count  the number of records, 0 to 255
/// @return a status; MBM_INVALID_ARGUMENT for a record with a `unit` above 255 or a `timeoutMs`
///         above 1000000
#[no_mangle]
pub unsafe extern "C" fn mbm_client_setUnits(
    client: *mut mbm_client,
    units: *mut mbm_clientUnit,
    count: u8,
) -> u8 {
    set(client, |parts| {
        let records: &[UnitRecord] = In::new(units.cast()).slice_or_empty(count.into());
        if !records.iter().all(UnitRecord::is_in_range) {
            return Status::INVALID_ARGUMENT;
        }
        parts.storage.units = units.cast();
        parts.storage.unit_count = count;
        parts.storage.unit_records = (!units.is_null()).then_some(&UNIT_RECORDS);
        parts.storage.unit_timeout_ms = 0;
        allow_retries(parts);
        Status::OK
    })
}

/// Returns the response timeout of a request to a unit that has none of its own: that of its record
/// (mbm_client_setUnits) or of the client (mbm_client_setResponseTimeout).
///
/// @param unit  the unit identifier
/// @return milliseconds; 0 if the client was not begun, and from within a hook of its port
#[no_mangle]
pub unsafe extern "C" fn mbm_client_getResponseTimeout(client: *const mbm_client, unit: u8) -> u32 {
    pointers::read(client, 0, |object| {
        let kind = &*(*object).kind;
        let line = kind.settings(object).response_timeout.get() / 1000;
        match find(kind.storage(object).units(), unit) {
            Some(record) if record.timeout_ms > 0 => record.timeout_ms.min(LONGEST_TIMEOUT_MS),
            _ => line,
        }
    })
}

const UNIT_RECORDS: UnitRecords = UnitRecords {
    rest: |storage, unit, now| {
        storage.unit_timeout_ms = find(storage.units(), unit).map_or(0, |unit| unit.timeout_ms);
        rest(storage.units_mut(), unit, now)
    },
    retry_limit: |storage, unit| find(storage.units(), unit).map_or(0, |unit| unit.retry_limit),
    note: |storage, unit, ended, now| {
        note(storage.units_mut(), unit, ended.status, ended.again, now)
    },
};
