//! How a client behaves.

use super::object::mbm_client;
use super::storage::{ClientBuffers, UnitRecords};
use crate::pointers;
use crate::storage::mbm_counters;
use core::ffi::c_void;
use mbm::client::{again, note, rest, Backoff, ClientStorage as _, Policy, UnitRecord};
use mbm::engine::Settings;
use mbm::error::Status;
use mbm::time::millis;

/// mbm_client_setBackoff: a request is asked again at once.
pub const MBM_BACKOFF_NONE: u8 = 0;
/// mbm_client_setBackoff: always the same wait.
pub const MBM_BACKOFF_FIXED: u8 = 1;
/// mbm_client_setBackoff: once, twice, three times the wait, up to the most.
pub const MBM_BACKOFF_LINEAR: u8 = 2;
/// mbm_client_setBackoff: once, twice, four times the wait, up to the most.
pub const MBM_BACKOFF_EXPONENTIAL: u8 = 3;

const _: () = {
    assert!(MBM_BACKOFF_NONE == Backoff::None as u8);
    assert!(MBM_BACKOFF_FIXED == Backoff::Fixed as u8);
    assert!(MBM_BACKOFF_LINEAR == Backoff::Linear as u8);
    assert!(MBM_BACKOFF_EXPONENTIAL == Backoff::Exponential as u8);
};

/// What is kept for one unit, in an array of yours for mbm_client_setUnits. The
/// counts are yours to read and to zero; each wraps at 2^32.
#[repr(C)]
pub struct mbm_clientUnit {
    /// Requests that ended, retries apart.
    pub requests: u32,
    /// Of these, those that were answered, exceptions included.
    pub replies: u32,
    /// Of the answers, those that were exceptions.
    pub exceptions: u32,
    /// Requests that were asked again.
    pub retries: u32,
    /// Set by you: rest for this unit from the end of a request to the next, in
    /// microseconds; more than 2^31 (36 minutes) means 2^31.
    pub delayUs: u32,
    /// Private.
    last: u32,
    /// Set by you: which unit this is.
    pub unit: u8,
    /// How the last request ended, MBM_OK if there was none.
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

/// The parts of a client that settings reach.
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

/// Sets how long a response may take. The time begins with the end of the request on a
/// serial line and in RTU over TCP; in TCP frames when mbm_client_poll puts the request
/// into the outgoing buffer, also if the port takes it later.
///
/// @param client        the object
/// @param timeoutMs     0 to 65535; 2000 at first
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

/// Tells the baud rate of an RTU line, from which the gap before a request (t3.5,
/// serial line guide V1.02, 2.5.1.1) and the length of a character follow. It sets
/// nothing on the line. Untold, the gap is 4 ms, which is safe from 9600 up.
///
/// @param client  the object
/// @param baud    bits per second; 0 goes back to untold
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

/// Sets the silence before a request, in place of t3.5; a later
/// mbm_client_setBaudRate sets it back. Without effect on TCP.
///
/// @param client        the object
/// @param gapUs         counted from the last byte seen or sent; more than 2^31
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

/// Sets how long a request takes that nobody responds to: a broadcast (serial
/// line guide V1.02, 2.4.1), and 08 with sub-function 04.
///
/// @param client        the object
/// @param delayMs       0 to 65535; 100 at first
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

/// Sets the quiet time of a serial line, which keeps a late reply from being taken
/// for the answer to a later request; see mbm_master_setQuietTime. Without effect on
/// TCP, where responses have a number.
///
/// @param client        the object
/// @param quietMs       0 to 65535; 100 at first; 0 holds no reply
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

/// Tells that the receiver hears what the driver sends, so each request comes back
/// before its reply and is to be dropped. Without effect on TCP.
///
/// @param client  the object
/// @param on      0 (at first) or 1
/// @return MBM_OK, MBM_INVALID_ARGUMENT or MBM_NOT_INITIALISED
#[no_mangle]
pub unsafe extern "C" fn mbm_client_setEchoDiscard(client: *mut mbm_client, on: u8) -> u8 {
    // SAFETY: as the header demands.
    unsafe {
        set(client, |parts| {
            built_in(cfg!(feature = "echo") || on == 0, || {
                parts.settings.echo_discard = on != 0;
            })
        })
    }
}

/// Holds the driver on after the port's flush, for platforms whose flush returns
/// before the last bit has left. Without effect on TCP.
///
/// @param client      the object
/// @param characters  times one character of the told baud rate (9600 if untold);
///                    0 at first
/// @return MBM_OK, MBM_INVALID_ARGUMENT or MBM_NOT_INITIALISED
#[no_mangle]
pub unsafe extern "C" fn mbm_client_setPostFlushHold(
    client: *mut mbm_client,
    characters: u8,
) -> u8 {
    // SAFETY: as the header demands.
    unsafe {
        set(client, |parts| {
            built_in(cfg!(feature = "hold") || characters == 0, || {
                parts.settings.post_flush_hold = characters;
            })
        })
    }
}

/// Makes a change that an archive may lack the code for: then it is refused.
#[inline(always)]
fn built_in(has: bool, change: impl FnOnce()) -> Status {
    if has {
        change();
        Status::OK
    } else {
        Status::INVALID_ARGUMENT
    }
}

/// Sets how often a request is repeated whose response is missing, damaged or
/// malformed, or that the port did not take. Exceptions are responses and are not
/// repeated, nor are requests that a lost link interrupted, nor those whose response is
/// too long for a buffer.
///
/// @param client   the object
/// @param retries  0 to 255; 0 at first
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

/// Sets how long a request waits before it is repeated. Other requests are sent
/// meanwhile.
///
/// @param client            the object
/// @param backoff           MBM_BACKOFF_NONE (at first) to MBM_BACKOFF_EXPONENTIAL
/// @param delayMs           the wait before the first repetition
/// @param maxDelayMs        the longest wait
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

/// Leaves a part of each wait before a repetition to chance, so that several
/// clients do not keep in step.
///
/// @param client   the object
/// @param percent  0 (at first) to 100: how much of the wait may be taken off
/// @param random   returns another number each time, for example rand(): one of 32
///                 bits, of 15 bits, or whose upper bits alone vary. What it
///                 calls on the client returns MBM_BUSY
/// @param context  handed to `random`
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

/// Counts into storage of yours from now on. Read and zero it as you like, but not
/// from an interrupt. In TCP frames, a foreign frame is one whose transaction identifier
/// and unit no pending request has; a resynchronisation is a run of bytes that were no
/// frame.
///
/// @param client    the object
/// @param counters  zeroed by you; NULL stops counting
/// @return MBM_OK, MBM_INVALID_ARGUMENT or MBM_NOT_INITIALISED
#[no_mangle]
pub unsafe extern "C" fn mbm_client_setCounters(
    client: *mut mbm_client,
    counters: *mut mbm_counters,
) -> u8 {
    // SAFETY: as the header demands.
    unsafe {
        set(client, |parts| {
            built_in(cfg!(feature = "counters") || counters.is_null(), || {
                parts.storage.counters = counters;
            })
        })
    }
}

/// Keeps a record of some units: how often they were asked and answered, and how
/// long each is left alone between two requests.
///
/// @param client  the object
/// @param units   zeroed by you but for `unit` and `delay`; NULL for none
/// @param count   how many records, 0 to 255
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
            parts.storage.unit_records = (!units.is_null()).then_some(&TREATMENT);
            Status::OK
        })
    }
}

const TREATMENT: UnitRecords = UnitRecords {
    rest: |storage, unit, now| rest(storage.units(), unit, now),
    note: |storage, unit, ended, now| note(storage.units(), unit, ended.status, ended.again, now),
};
