//! The settings of a client.

use super::object::mbm_client;
use super::storage::{ClientBuffers, UnitRecords};
use crate::pointers;
use crate::storage::mbm_counters;
use core::ffi::c_void;
use mbm::client::{again, note, rest, Backoff, ClientStorage as _, Policy, UnitRecord};
use mbm::engine::Settings;
use mbm::error::Status;
use mbm::time::millis;

/// mbm_client_setBackoff: the client repeats a request at once.
pub const MBM_BACKOFF_NONE: u8 = 0;
/// mbm_client_setBackoff: the client waits `delayMs` before each repetition.
pub const MBM_BACKOFF_FIXED: u8 = 1;
/// mbm_client_setBackoff: the client waits `delayMs` before the first repetition, twice that
/// before the second, three times that before the third, but at most `maxDelayMs`.
pub const MBM_BACKOFF_LINEAR: u8 = 2;
/// mbm_client_setBackoff: the client waits `delayMs` before the first repetition, twice that
/// before the second, four times that before the third, but at most `maxDelayMs`.
pub const MBM_BACKOFF_EXPONENTIAL: u8 = 3;

const _: () = {
    assert!(MBM_BACKOFF_NONE == Backoff::None as u8);
    assert!(MBM_BACKOFF_FIXED == Backoff::Fixed as u8);
    assert!(MBM_BACKOFF_LINEAR == Backoff::Linear as u8);
    assert!(MBM_BACKOFF_EXPONENTIAL == Backoff::Exponential as u8);
};

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
    last: u32,
    /// Set by you: the unit identifier.
    pub unit: u8,
    /// The status of the last request that ended; MBM_OK if none has ended.
    pub status: u8,
    /// Private.
    cooling_down: u8,
}

const _: () = {
    use core::mem::offset_of;
    assert!(size_of::<mbm_clientUnit>() == size_of::<UnitRecord>());
    assert!(align_of::<mbm_clientUnit>() == align_of::<UnitRecord>());
    assert!(offset_of!(mbm_clientUnit, delayUs) == offset_of!(UnitRecord, delay));
    assert!(offset_of!(mbm_clientUnit, unit) == offset_of!(UnitRecord, unit));
    assert!(offset_of!(mbm_clientUnit, status) == offset_of!(UnitRecord, status));
};

/// The parts of a client that the functions here change.
struct Parts<'a> {
    settings: &'a mut Settings,
    storage: &'a mut ClientBuffers,
    policy: &'a mut Policy,
}

/// Changes a setting.
///
/// # Safety
/// As for [`pointers::with`].
#[cfg_attr(target_os = "none", inline(always))]
unsafe fn set(client: *mut mbm_client, change: impl FnOnce(Parts) -> Status) -> u8 {
    // SAFETY: as the caller promises.
    unsafe {
        pointers::with(client, |object| {
            let kind = &*(*object).kind;
            change(Parts {
                settings: kind.settings(object),
                storage: kind.storage(object),
                policy: &mut (*object).queue.policy,
            })
        })
    }
}

/// Sets the response timeout. On a serial line and in RTU over TCP, the time starts when the
/// request has been sent. In TCP frames it starts when mbm_client_poll puts the request into
/// the outgoing buffer, also if the port accepts it later.
///
/// @param client        the object
/// @param timeoutMs     milliseconds, 0 to 65535; the default is 2000
/// @return MBM_OK, MBM_INVALID_ARGUMENT or MBM_NOT_INITIALISED
#[no_mangle]
pub unsafe extern "C" fn mbm_client_setResponseTimeout(
    client: *mut mbm_client,
    timeoutMs: u16,
) -> u8 {
    // SAFETY: as the header demands.
    unsafe {
        set(client, |parts| {
            parts.settings.response_timeout = millis(timeoutMs);
            Status::OK
        })
    }
}

/// Sets the baud rate from which the client computes the gap before an RTU request (t3.5,
/// serial line guide V1.02, 2.5.1.1) and the duration of a character. It does not configure
/// the serial line. Without a baud rate the gap is 4 ms, which is enough from 9600 up.
///
/// @param client  the object
/// @param baud    bits per second; 0 (the default): unknown
/// @return MBM_OK, MBM_INVALID_ARGUMENT or MBM_NOT_INITIALISED
#[no_mangle]
pub unsafe extern "C" fn mbm_client_setBaudRate(client: *mut mbm_client, baud: u32) -> u8 {
    // SAFETY: as the header demands.
    unsafe {
        set(client, |parts| {
            parts.settings.set_baud_rate(baud);
            Status::OK
        })
    }
}

/// Sets the silence before a request, instead of t3.5. A later call of
/// mbm_client_setBaudRate sets it back to t3.5. It has no effect on TCP.
///
/// @param client        the object
/// @param gapUs         microseconds from the last byte received or sent; a value above 2^31
///                      (36 minutes) means 2^31
/// @return MBM_OK, MBM_INVALID_ARGUMENT or MBM_NOT_INITIALISED
#[no_mangle]
pub unsafe extern "C" fn mbm_client_setGap(client: *mut mbm_client, gapUs: u32) -> u8 {
    // SAFETY: as the header demands.
    unsafe {
        set(client, |parts| {
            parts.settings.set_gap(gapUs);
            Status::OK
        })
    }
}

/// Sets the turnaround delay: how long the client waits after a request that no device
/// answers. These requests are a broadcast (serial line guide V1.02, 2.4.1), and 08 with
/// sub-function 04.
///
/// @param client        the object
/// @param delayMs       milliseconds, 0 to 65535; the default is 100
/// @return MBM_OK, MBM_INVALID_ARGUMENT or MBM_NOT_INITIALISED
#[no_mangle]
pub unsafe extern "C" fn mbm_client_setTurnaroundDelay(
    client: *mut mbm_client,
    delayMs: u16,
) -> u8 {
    // SAFETY: as the header demands.
    unsafe {
        set(client, |parts| {
            parts.settings.turnaround_delay = millis(delayMs);
            Status::OK
        })
    }
}

/// Sets the quiet time of a serial line. It prevents that the client accepts a late reply as
/// the reply to a later request: see mbm_master_setQuietTime. It has no effect in TCP frames,
/// whose transaction identifier shows to which request a reply belongs.
///
/// @param client        the object
/// @param quietMs       milliseconds, 0 to 65535; the default is 100; 0 holds no reply
/// @return MBM_OK, MBM_INVALID_ARGUMENT or MBM_NOT_INITIALISED
#[no_mangle]
pub unsafe extern "C" fn mbm_client_setQuietTime(client: *mut mbm_client, quietMs: u16) -> u8 {
    // SAFETY: as the header demands.
    unsafe {
        set(client, |parts| {
            parts.settings.quiet_time = millis(quietMs);
            Status::OK
        })
    }
}

/// Switches echo discarding on or off. Switch it on if the receiver also receives what the
/// driver sends: then the client discards the copy of each request that arrives before the
/// reply. It has no effect on TCP.
///
/// @param client  the object
/// @param on      0 (the default) or 1
/// @return MBM_OK, MBM_INVALID_ARGUMENT or MBM_NOT_INITIALISED
#[no_mangle]
pub unsafe extern "C" fn mbm_client_setEchoDiscard(client: *mut mbm_client, on: u8) -> u8 {
    // SAFETY: as the header demands.
    unsafe {
        set(client, |parts| {
            if_built_in(cfg!(feature = "echo") || on == 0, || {
                parts.settings.echo_discard = on != 0;
            })
        })
    }
}

/// Sets how long the driver stays on after the port's flush, for platforms whose flush
/// returns before the last bit was sent. It has no effect on TCP.
///
/// @param client      the object
/// @param characters  the time in characters at the baud rate of mbm_client_setBaudRate
///                    (without one, at 9600); the default is 0
/// @return MBM_OK, MBM_INVALID_ARGUMENT or MBM_NOT_INITIALISED
#[no_mangle]
pub unsafe extern "C" fn mbm_client_setPostFlushHold(
    client: *mut mbm_client,
    characters: u8,
) -> u8 {
    // SAFETY: as the header demands.
    unsafe {
        set(client, |parts| {
            if_built_in(cfg!(feature = "hold") || characters == 0, || {
                parts.settings.post_flush_hold = characters;
            })
        })
    }
}

/// Makes a change if the archive contains the code for it; otherwise refuses it.
#[inline(always)]
fn if_built_in(built_in: bool, change: impl FnOnce()) -> Status {
    if built_in {
        change();
        Status::OK
    } else {
        Status::INVALID_ARGUMENT
    }
}

/// Sets how often the client repeats a request whose response is missing, damaged or
/// malformed, or that the port did not accept. It does not repeat a request that was
/// answered with an exception, one that a lost link interrupted, or one whose response is
/// too long for a buffer.
///
/// @param client   the object
/// @param retries  0 to 255; the default is 0
/// @return MBM_OK, MBM_INVALID_ARGUMENT or MBM_NOT_INITIALISED
#[no_mangle]
pub unsafe extern "C" fn mbm_client_setRetries(client: *mut mbm_client, retries: u8) -> u8 {
    // SAFETY: as the header demands.
    unsafe {
        set(client, |parts| {
            parts.policy.retries = retries;
            parts.storage.again = Some(|storage, policy, retries, status| {
                again(policy, retries, status, || storage.random())
            });
            Status::OK
        })
    }
}

/// Sets how long a request waits before the client repeats it. Meanwhile the client sends
/// other requests.
///
/// @param client            the object
/// @param backoff           MBM_BACKOFF_NONE (the default) to MBM_BACKOFF_EXPONENTIAL
/// @param delayMs           the wait before the first repetition, in milliseconds
/// @param maxDelayMs        the longest wait, in milliseconds
/// @return MBM_OK, MBM_INVALID_ARGUMENT or MBM_NOT_INITIALISED
#[no_mangle]
pub unsafe extern "C" fn mbm_client_setBackoff(
    client: *mut mbm_client,
    backoff: u8,
    delayMs: u16,
    maxDelayMs: u16,
) -> u8 {
    // SAFETY: as the header demands.
    unsafe {
        set(client, |parts| {
            let Some(backoff) = Backoff::from_code(backoff) else {
                return Status::INVALID_ARGUMENT;
            };
            let (wait, most) = (millis(delayMs), millis(maxDelayMs));
            parts.policy.set_backoff(backoff, wait, most);
            Status::OK
        })
    }
}

/// Shortens each wait before a repetition by a random part, so that several clients do not
/// repeat their requests at the same time.
///
/// @param client   the object
/// @param percent  0 (the default) to 100: the largest part of the wait by which the client
///                 shortens it
/// @param random   returns a new random number at each call, for example that of rand(). It
///                 may have 32 bits, 15 bits, or random bits in its upper half only. A
///                 function that it calls on the client returns MBM_BUSY. NULL only if
///                 `percent` is 0
/// @param context  your pointer, passed to `random`; may be NULL
/// @return MBM_OK, MBM_INVALID_ARGUMENT or MBM_NOT_INITIALISED
#[no_mangle]
pub unsafe extern "C" fn mbm_client_setJitter(
    client: *mut mbm_client,
    percent: u8,
    random: Option<unsafe extern "C" fn(context: *mut c_void) -> u32>,
    context: *mut c_void,
) -> u8 {
    // SAFETY: as the header demands.
    unsafe {
        set(client, |parts| {
            if percent > 100 || (random.is_none() && percent > 0) {
                return Status::INVALID_ARGUMENT;
            }
            parts.policy.jitter = ((u16::from(percent) * 163) >> 6).min(255) as u8;
            parts.storage.random = random;
            parts.storage.random_context = context;
            Status::OK
        })
    }
}

/// Sets your storage for counters, in which the client counts from now on. You may read and
/// zero the counters at any time, but not from an interrupt. In TCP frames, foreignFrames
/// counts frames whose transaction identifier and unit match no pending request, and
/// resynchronisations counts sequences of bytes that were not a frame.
///
/// @param client    the object
/// @param counters  your counters, zeroed; NULL stops counting
/// @return MBM_OK, MBM_INVALID_ARGUMENT or MBM_NOT_INITIALISED
#[no_mangle]
pub unsafe extern "C" fn mbm_client_setCounters(
    client: *mut mbm_client,
    counters: *mut mbm_counters,
) -> u8 {
    // SAFETY: as the header demands.
    unsafe {
        set(client, |parts| {
            if_built_in(cfg!(feature = "counters") || counters.is_null(), || {
                parts.storage.counters = counters;
            })
        })
    }
}

/// Sets the records of units. In a record the client counts the requests to its unit. The
/// record's `delayUs` sets the minimum time between two requests to the unit.
///
/// @param client  the object
/// @param units   your array of records, zeroed except `unit` and `delayUs`; NULL for none
/// @param count   the number of records, 0 to 255
/// @return MBM_OK, MBM_INVALID_ARGUMENT or MBM_NOT_INITIALISED
#[no_mangle]
pub unsafe extern "C" fn mbm_client_setUnits(
    client: *mut mbm_client,
    units: *mut mbm_clientUnit,
    count: u8,
) -> u8 {
    // SAFETY: as the header demands.
    unsafe {
        set(client, |parts| {
            parts.storage.units = units.cast();
            parts.storage.unit_count = count;
            parts.storage.unit_records = (!units.is_null()).then_some(&UNIT_RECORDS);
            Status::OK
        })
    }
}

const UNIT_RECORDS: UnitRecords = UnitRecords {
    rest: |storage, unit, now| rest(storage.units(), unit, now),
    note: |storage, unit, ended, now| note(storage.units(), unit, ended.status, ended.again, now),
};
