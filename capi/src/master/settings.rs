//! The settings of a master.

use super::with_hooks;
use super::{mbm_master, Core};
use crate::pointers::{check, read, with};
use crate::storage::mbm_counters;
use mbm::engine::Setting;
use mbm::error::Status;
use mbm::time::{millis, timeout};

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

/// Sets the unit to which the master sends later requests.
///
/// @param master  the object
/// @param slave   the unit identifier, 1 to 247; 0 is broadcast. The master also sends to 248
///                to 255, which the standard reserves
/// @return MBM_OK, MBM_INVALID_ARGUMENT or MBM_NOT_INITIALISED
#[no_mangle]
pub unsafe extern "C" fn mbm_master_setSlaveID(master: *mut mbm_master, slave: u8) -> u8 {
    // SAFETY: as the header demands.
    unsafe {
        with(master, |master| {
            master.core.set_slave(slave);
            Status::OK
        })
    }
}

/// Returns the unit to which the master sends requests.
///
/// @param master  the object
/// @return the unit identifier, 1 by default; 0 for an object that was never begun
#[no_mangle]
pub unsafe extern "C" fn mbm_master_getSlaveID(master: *const mbm_master) -> u8 {
    // SAFETY: as the header demands.
    unsafe { read(master, 0, |master| master.core.slave()) }
}

/// Sets the response timeout: the maximum time from the last bit of the request to the last
/// byte of the reply.
///
/// @param master        the object
/// @param timeoutMs     milliseconds, 0 to 1000000 (16 minutes); the default is 2000
/// @return MBM_OK, MBM_INVALID_ARGUMENT or MBM_NOT_INITIALISED
#[no_mangle]
pub unsafe extern "C" fn mbm_master_setResponseTimeout(
    master: *mut mbm_master,
    timeoutMs: u32,
) -> u8 {
    // SAFETY: as the header demands.
    unsafe {
        with(master, |master| {
            let Some(timeout) = timeout(timeoutMs) else {
                return Status::INVALID_ARGUMENT;
            };
            master.core.settings().response_timeout = Setting::new(timeout);
            Status::OK
        })
    }
}

/// Sets the baud rate from which the master computes the gap before a request (t3.5, serial
/// line guide V1.02, 2.5.1.1) and the duration of a character. It does not configure the
/// serial line. Without a baud rate the gap is 4 ms, which is enough from 9600 up.
///
/// @param master  the object
/// @param baud    bits per second; 0 (the default): unknown
/// @return MBM_OK, MBM_INVALID_ARGUMENT or MBM_NOT_INITIALISED
#[no_mangle]
pub unsafe extern "C" fn mbm_master_setBaudRate(master: *mut mbm_master, baud: u32) -> u8 {
    // SAFETY: as the header demands.
    unsafe {
        with(master, |master| {
            master.core.set_baud_rate(baud);
            Status::OK
        })
    }
}

/// Sets the silence before a request, instead of t3.5. Use 0 if no device on the line needs
/// the gap, and more than t3.5 for devices that need longer before they can receive again.
/// A later call of mbm_master_setBaudRate sets it back to t3.5.
///
/// @param master        the object
/// @param gapUs         microseconds from the last byte received or sent; a value above 2^31
///                      (36 minutes) means 2^31
/// @return MBM_OK, MBM_INVALID_ARGUMENT or MBM_NOT_INITIALISED
#[no_mangle]
pub unsafe extern "C" fn mbm_master_setGap(master: *mut mbm_master, gapUs: u32) -> u8 {
    // SAFETY: as the header demands.
    unsafe {
        with(master, |master| {
            master.core.settings().set_gap(gapUs);
            Status::OK
        })
    }
}

/// Sets the turnaround delay: how long the master waits after a broadcast, which no device
/// answers (serial line guide V1.02, 2.4.1).
///
/// @param master        the object
/// @param delayMs       milliseconds, 0 to 65535; the default is 100
/// @return MBM_OK, MBM_INVALID_ARGUMENT or MBM_NOT_INITIALISED
#[no_mangle]
pub unsafe extern "C" fn mbm_master_setTurnaroundDelay(
    master: *mut mbm_master,
    delayMs: u32,
) -> u8 {
    // SAFETY: as the header demands.
    unsafe {
        with(master, |master| {
            let Ok(delay) = u16::try_from(delayMs) else {
                return Status::INVALID_ARGUMENT;
            };
            master.core.settings().turnaround_delay = Setting::new(millis(delay));
            Status::OK
        })
    }
}

/// Sets the quiet time. It prevents that the master accepts a late reply as the reply to a
/// later request. In RTU the two cannot be distinguished if unit, function and length are the
/// same, or if the late reply is an exception to the same function.
///
/// After a request without a right reply, the master does two things. It waits for the quiet
/// time before it sends the next request, and discards bytes that arrive meanwhile. Then it
/// holds the next reply of that unit, until no byte has arrived for the response timeout; after
/// MBM_INVALID_CRC for the quiet time, because the damaged reply is not late. A second reply
/// replaces the held one, because a device answers in order. If the second reply is damaged,
/// the request fails. A right reply that arrives before a request is sent shows that replies
/// are late; the next reply is then held for the response timeout.
///
/// So a device that answers in order and within the response timeout never gives the data of
/// another request, whatever its usual latency and however late one of its replies was. The
/// request after a timeout ends one response timeout after the last reply that arrives, and at
/// the latest three response timeouts after it was sent; all others take no longer. A wrong
/// reading remains possible if the device takes longer than the response timeout for two
/// requests in a row.
///
/// With a quiet time of 0 the master waits and holds nothing: a reply that is later than the
/// response timeout may be taken for the reply to the next request, and so may all that
/// follow.
///
/// @param master        the object
/// @param quietMs       milliseconds, 0 to 65535; the default is 100
/// @return MBM_OK, MBM_INVALID_ARGUMENT or MBM_NOT_INITIALISED
#[no_mangle]
pub unsafe extern "C" fn mbm_master_setQuietTime(master: *mut mbm_master, quietMs: u32) -> u8 {
    // SAFETY: as the header demands.
    unsafe {
        with(master, |master| {
            let Ok(quiet) = u16::try_from(quietMs) else {
                return Status::INVALID_ARGUMENT;
            };
            master.core.settings().quiet_time = Setting::new(millis(quiet));
            Status::OK
        })
    }
}

/// Sets how often the master repeats a request whose reply is missing, damaged or malformed.
/// It does not repeat a request that was answered with an exception.
///
/// @param master   the object
/// @param retries  0 to 255; the default is 0
/// @return MBM_OK, MBM_INVALID_ARGUMENT or MBM_NOT_INITIALISED
#[no_mangle]
pub unsafe extern "C" fn mbm_master_setRetries(master: *mut mbm_master, retries: u8) -> u8 {
    // SAFETY: as the header demands.
    unsafe {
        with(master, |master| {
            if_built_in(cfg!(feature = "retries") || retries == 0, || {
                master.core.settings().retries = retries;
            })
        })
    }
}

/// Switches echo discarding on or off. Switch it on if the receiver also receives what the
/// driver sends: then the master discards the copy of each request that arrives before the
/// reply.
///
/// @param master  the object
/// @param on      0 (the default) or 1
/// @return MBM_OK, MBM_INVALID_ARGUMENT or MBM_NOT_INITIALISED
#[no_mangle]
pub unsafe extern "C" fn mbm_master_setEchoDiscard(master: *mut mbm_master, on: u8) -> u8 {
    // SAFETY: as the header demands.
    unsafe {
        with(master, |master| {
            if_built_in(cfg!(feature = "echo") || on == 0, || {
                master.core.settings().echo_discard = on != 0;
            })
        })
    }
}

/// Accepts replies of devices that deviate from the standard. It has these effects:
/// - The master accepts a reply with the right unit, function and CRC although it repeats
///   another address, value or quantity, or carries more or fewer data than were requested.
///   It accepts such a reply at the end of the response timeout, if no right reply has
///   arrived. mbm_master_available returns the number of words that arrived.
/// - A read of more words than the response words hold succeeds and fills all of them.
///   (If the reply is longer than the frame buffer, no noise may have arrived before it.)
/// - The master also sends requests that read to unit 0, and accepts a reply from unit 0.
///
/// Set a short response timeout (mbm_master_setResponseTimeout) if the device deviates in
/// every reply.
///
/// @param master  the object
/// @param on      0 (the default) or 1
/// @return MBM_OK, MBM_INVALID_ARGUMENT or MBM_NOT_INITIALISED; MBM_BUSY while a request is
///         under way
#[no_mangle]
pub unsafe extern "C" fn mbm_master_setLenient(master: *mut mbm_master, on: u8) -> u8 {
    // SAFETY: as the header demands.
    unsafe {
        with(master, |master| {
            if master.core.is_pending() {
                return Status::BUSY;
            }
            master.core.set_lenient(on != 0);
            Status::OK
        })
    }
}

/// Sets how long the driver stays on after the port's flush, for platforms whose flush
/// returns before the last bit was sent.
///
/// @param master      the object
/// @param characters  the time in characters at the baud rate of mbm_master_setBaudRate
///                    (without one, at 9600); the default is 0
/// @return MBM_OK, MBM_INVALID_ARGUMENT or MBM_NOT_INITIALISED
#[no_mangle]
pub unsafe extern "C" fn mbm_master_setPostFlushHold(
    master: *mut mbm_master,
    characters: u8,
) -> u8 {
    // SAFETY: as the header demands.
    unsafe {
        with(master, |master| {
            if_built_in(cfg!(feature = "hold") || characters == 0, || {
                master.core.settings().post_flush_hold = characters;
            })
        })
    }
}

/// Switches between blocking and non-blocking mode. In blocking mode, the default, a function
/// that makes a request returns when the request has ended. In non-blocking mode it returns
/// MBM_PENDING at once, and you call mbm_master_poll until the request has ended.
///
/// @param master  the object
/// @param on      1 blocking, 0 non-blocking; it applies from the next request on
/// @return MBM_OK, MBM_INVALID_ARGUMENT or MBM_NOT_INITIALISED
#[no_mangle]
pub unsafe extern "C" fn mbm_master_setBlocking(master: *mut mbm_master, on: u8) -> u8 {
    // SAFETY: as the header demands.
    unsafe {
        with(master, |master| {
            master.non_blocking = on == 0;
            Status::OK
        })
    }
}

/// Sets your storage for counters, in which the master counts from now on. You may read and
/// zero the counters at any time, but not from an interrupt.
///
/// @param master    the object
/// @param counters  your counters, initialised with MBM_INIT; NULL stops counting
/// @return MBM_OK, MBM_INVALID_ARGUMENT or MBM_NOT_INITIALISED
#[no_mangle]
pub unsafe extern "C" fn mbm_master_setCounters(
    master: *mut mbm_master,
    counters: *mut mbm_counters,
) -> u8 {
    // SAFETY: as the header demands.
    unsafe {
        with(master, |master| {
            master.core.storage().counters = counters;
            master.core.set_counting();
            Status::OK
        })
    }
}

/// Reports when another user of the line, for example another object, used the line last.
/// The gap before the next request counts from that time. A time before the last use that
/// the object knows changes nothing.
///
/// @param master        the object
/// @param timeUs        the time in microseconds on the clock of the object's port, at most
///                      2^31 microseconds (36 minutes) ago
/// @return MBM_OK, MBM_INVALID_ARGUMENT or MBM_NOT_INITIALISED
#[no_mangle]
pub unsafe extern "C" fn mbm_master_lineUsedAt(master: *mut mbm_master, timeUs: u32) -> u8 {
    // SAFETY: as the header demands.
    unsafe {
        with(master, |master| {
            master.core.line_used_at(timeUs);
            Status::OK
        })
    }
}

/// Reports that another user of the line has just used it: as mbm_master_lineUsedAt with the
/// present time.
///
/// @param master  the object
/// @return MBM_OK, MBM_INVALID_ARGUMENT or MBM_NOT_INITIALISED
#[no_mangle]
pub unsafe extern "C" fn mbm_master_lineUsed(master: *mut mbm_master) -> u8 {
    // SAFETY: as the header demands.
    unsafe {
        let status = check(master);
        if status == Status::OK {
            with_hooks(master, Core::line_used);
        }
        status.code()
    }
}
