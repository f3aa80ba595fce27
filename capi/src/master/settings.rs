//! How a master behaves.

use super::with_hooks;
use super::{mbm_master, Core};
use crate::pointers::{check, read, with};
use crate::storage::mbm_counters;
use mbm::error::Status;
use mbm::time::millis;

/// Makes a change that an archive may lack the code for: then it is refused.
#[inline(always)]
fn if_built_in(built_in: bool, change: impl FnOnce()) -> Status {
    if built_in {
        change();
        Status::OK
    } else {
        Status::INVALID_ARGUMENT
    }
}

/// Sets the unit that later requests go to.
///
/// @param master  the object
/// @param slave   1 to 247; 248 to 255 are sent as they are, 0 is broadcast
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

/// The unit that requests go to.
///
/// @param master  the object
/// @return the unit id, 1 until somebody says otherwise; 0 for an object that is
///         not ready for settings
#[no_mangle]
pub unsafe extern "C" fn mbm_master_getSlaveID(master: *const mbm_master) -> u8 {
    // SAFETY: as the header demands.
    unsafe { read(master, 0, |master| master.core.slave()) }
}

/// Sets how long a reply may take, from the last bit of the request to the last
/// byte of the reply.
///
/// @param master        the object
/// @param timeoutMs     0 to 65535; 2000 at first
/// @return MBM_OK, MBM_INVALID_ARGUMENT or MBM_NOT_INITIALISED
#[no_mangle]
pub unsafe extern "C" fn mbm_master_setResponseTimeout(
    master: *mut mbm_master,
    timeoutMs: u16,
) -> u8 {
    // SAFETY: as the header demands.
    unsafe {
        with(master, |master| {
            master.core.settings().response_timeout = millis(timeoutMs);
            Status::OK
        })
    }
}

/// Tells the baud rate of the line, from which the gap before a request (t3.5,
/// serial line guide V1.02, 2.5.1.1) and the length of a character follow. It
/// sets nothing on the line. Untold, the gap is 4 ms, which is safe from 9600 up.
///
/// @param master  the object
/// @param baud    bits per second; 0 goes back to untold
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

/// Sets the silence before a request, in place of t3.5: 0 where nothing but the
/// master's own traffic needs it, more for devices that are slow to listen again.
/// A later mbm_master_setBaudRate sets it back to t3.5.
///
/// @param master        the object
/// @param gapUs         counted from the last byte seen or sent; more than 2^31
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

/// Sets how long a broadcast takes, since nobody answers it (serial line guide
/// V1.02, 2.4.1).
///
/// @param master        the object
/// @param delayMs       0 to 65535; 100 at first
/// @return MBM_OK, MBM_INVALID_ARGUMENT or MBM_NOT_INITIALISED
#[no_mangle]
pub unsafe extern "C" fn mbm_master_setTurnaroundDelay(
    master: *mut mbm_master,
    delayMs: u16,
) -> u8 {
    // SAFETY: as the header demands.
    unsafe {
        with(master, |master| {
            master.core.settings().turnaround_delay = millis(delayMs);
            Status::OK
        })
    }
}

/// Sets the quiet time, which keeps a late reply from being taken for the answer
/// to a later request. RTU itself cannot tell them apart if unit, function and
/// length are the same, or if the late reply is an exception to the same function.
///
/// After a request without a right reply, two things happen. The line is left alone
/// for this time before the next request, and bytes that arrive are dropped. Then the
/// next reply of that unit is held until nothing has arrived for this time. A second
/// reply takes the place of the held one, for a device answers in order; if the
/// second one is damaged, the request fails. So a request after a failure takes one
/// quiet time longer, all others take no longer.
///
/// The time must be longer than the device takes for an answer. If it is shorter, the
/// second reply may come after the held one was taken for the answer.
///
/// @param master        the object
/// @param quietMs       0 to 65535; 100 at first; 0 holds no reply
/// @return MBM_OK, MBM_INVALID_ARGUMENT or MBM_NOT_INITIALISED
#[no_mangle]
pub unsafe extern "C" fn mbm_master_setQuietTime(master: *mut mbm_master, quietMs: u16) -> u8 {
    // SAFETY: as the header demands.
    unsafe {
        with(master, |master| {
            master.core.settings().quiet_time = millis(quietMs);
            Status::OK
        })
    }
}

/// Sets how often a request is repeated whose reply is missing, damaged or
/// malformed. Exceptions are replies and are not repeated.
///
/// @param master   the object
/// @param retries  0 to 255; 0 at first
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

/// Tells that the receiver hears what the driver sends, so each request comes back
/// before its reply and is to be dropped.
///
/// @param master  the object
/// @param on      0 (at first) or 1
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
/// - A reply with the right unit, function and CRC is accepted although it repeats another
///   address, value or quantity, or carries more or fewer data than were requested. It
///   is accepted at the end of the response timeout, if no right reply has come.
///   mbm_master_available says how many words came.
/// - A read of more words than the response words hold succeeds and fills all of them.
///   (Such a reply that the frame buffer does not hold must not follow noise directly.)
/// - Requests that read are sent to unit 0 too, and a reply from unit 0 is accepted.
///
/// Set a short response timeout (mbm_master_setResponseTimeout) if the device deviates in
/// each reply.
///
/// @param master  the object
/// @param on      0 (at first) or 1
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

/// Holds the driver on after the port's flush, for platforms whose flush returns
/// before the last bit has left.
///
/// @param master      the object
/// @param characters  times one character of the told baud rate (9600 if untold);
///                    0 at first
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

/// Chooses between functions that return when the request has ended (at first) and
/// functions that return MBM_PENDING at once, for mbm_master_poll to end them.
///
/// @param master  the object
/// @param on      1 blocking, 0 non-blocking; holds from the next request on
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

/// Counts into storage of yours from now on. Read and zero it as you like, but not
/// from an interrupt.
///
/// @param master    the object
/// @param counters  zeroed by you; NULL stops counting
/// @return MBM_OK, MBM_INVALID_ARGUMENT or MBM_NOT_INITIALISED
#[no_mangle]
pub unsafe extern "C" fn mbm_master_setCounters(
    master: *mut mbm_master,
    counters: *mut mbm_counters,
) -> u8 {
    // SAFETY: as the header demands.
    unsafe {
        with(master, |master| {
            if_built_in(cfg!(feature = "counters") || counters.is_null(), || {
                master.core.storage().counters = counters;
            })
        })
    }
}

/// Says when somebody else used the line, another object for example: the gap before
/// the next request counts from then. A time before the last use that the object knows
/// of changes nothing.
///
/// @param master        the object
/// @param timeUs        by the clock of its port, at most 2^31 ago
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

/// Says that somebody else has just used the line, as mbm_master_lineUsedAt with the
/// time of now.
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
