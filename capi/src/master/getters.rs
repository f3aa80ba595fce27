//! Getters of a master's settings.

use super::mbm_master;
use crate::pointers::read;
use crate::registers::MBM_ORDER_ABCD;
use mbm::time::to_millis;

/// Returns the response timeout: see mbm_master_setResponseTimeout.
///
/// @param master  the object
/// @return milliseconds; 0 for an object that was never begun
#[no_mangle]
pub unsafe extern "C" fn mbm_master_getResponseTimeout(master: *const mbm_master) -> u32 {
    // SAFETY: as the header demands.
    unsafe {
        read(master, 0, |master| {
            to_millis(master.core.settings().response_timeout.get())
        })
    }
}

/// Returns the silence before a request that is in effect: what mbm_master_setGap set, or t3.5
/// of the rate that mbm_master_setBaudRate set, or 4 ms.
///
/// @param master  the object
/// @return microseconds; 0 for an object that was never begun
#[no_mangle]
pub unsafe extern "C" fn mbm_master_getGap(master: *const mbm_master) -> u32 {
    // SAFETY: as the header demands.
    unsafe { read(master, 0, |master| master.core.settings().gap.get()) }
}

/// Returns the turnaround delay: see mbm_master_setTurnaroundDelay.
///
/// @param master  the object
/// @return milliseconds; 0 for an object that was never begun
#[no_mangle]
pub unsafe extern "C" fn mbm_master_getTurnaroundDelay(master: *const mbm_master) -> u16 {
    // SAFETY: as the header demands.
    unsafe {
        read(master, 0, |master| {
            to_millis(master.core.settings().turnaround_delay.get()) as u16
        })
    }
}

/// Returns the quiet time: see mbm_master_setQuietTime.
///
/// @param master  the object
/// @return milliseconds; 0 for an object that was never begun
#[no_mangle]
pub unsafe extern "C" fn mbm_master_getQuietTime(master: *const mbm_master) -> u16 {
    // SAFETY: as the header demands.
    unsafe {
        read(master, 0, |master| {
            to_millis(master.core.settings().quiet_time.get()) as u16
        })
    }
}

/// Returns how often a request is repeated: see mbm_master_setRetries.
///
/// @param master  the object
/// @return 0 to 255; 0 for an object that was never begun
#[no_mangle]
pub unsafe extern "C" fn mbm_master_getRetries(master: *const mbm_master) -> u8 {
    // SAFETY: as the header demands.
    unsafe { read(master, 0, |master| master.core.settings().retries) }
}

/// Returns whether echo discarding is on: see mbm_master_setEchoDiscard.
///
/// @param master  the object
/// @return 1 or 0; 0 for an object that was never begun
#[no_mangle]
pub unsafe extern "C" fn mbm_master_getEchoDiscard(master: *const mbm_master) -> u8 {
    // SAFETY: as the header demands.
    unsafe {
        read(master, 0, |master| {
            master.core.settings().echo_discard.into()
        })
    }
}

/// Returns whether deviating replies are accepted: see mbm_master_setLenient.
///
/// @param master  the object
/// @return 1 or 0; 0 for an object that was never begun
#[no_mangle]
pub unsafe extern "C" fn mbm_master_getLenient(master: *const mbm_master) -> u8 {
    // SAFETY: as the header demands.
    unsafe { read(master, 0, |master| master.core.is_lenient().into()) }
}

/// Returns how long the driver stays on after the flush: see mbm_master_setPostFlushHold.
///
/// @param master  the object
/// @return characters; 0 for an object that was never begun
#[no_mangle]
pub unsafe extern "C" fn mbm_master_getPostFlushHold(master: *const mbm_master) -> u8 {
    // SAFETY: as the header demands.
    unsafe { read(master, 0, |master| master.core.settings().post_flush_hold) }
}

/// Returns whether requests block: see mbm_master_setBlocking.
///
/// @param master  the object
/// @return 1 for blocking, 0 for non-blocking; 0 for an object that was never begun
#[no_mangle]
pub unsafe extern "C" fn mbm_master_getBlocking(master: *const mbm_master) -> u8 {
    // SAFETY: as the header demands.
    unsafe { read(master, 0, |master| (!master.non_blocking).into()) }
}

/// Returns the order of values: see mbm_master_setWordOrder.
///
/// @param master  the object
/// @return one of MBM_ORDER_...; MBM_ORDER_ABCD for an object that was never begun
#[no_mangle]
pub unsafe extern "C" fn mbm_master_getWordOrder(master: *const mbm_master) -> u8 {
    // SAFETY: as the header demands.
    let order = unsafe { read(master, 0, |master| master.order) };
    // 0 in a master whose order was never set.
    order.max(MBM_ORDER_ABCD)
}
