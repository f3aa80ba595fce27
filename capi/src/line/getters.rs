//! Getters of a line's settings.

use super::mbm_line;
use crate::pointers::read;
use mbm::time::to_millis;

/// Returns the silence before a request that is in effect: what mbm_line_setGap set, or t3.5
/// of the rate that mbm_line_setBaudRate set, or 4 ms.
///
/// @param line  the object
/// @return microseconds; 0 for an object that was never begun
#[no_mangle]
pub unsafe extern "C" fn mbm_line_getGap(line: *const mbm_line) -> u32 {
    // SAFETY: as the header demands.
    unsafe { read(line, 0, |line| line.settings.gap.get()) }
}

/// Returns the turnaround delay: see mbm_line_setTurnaroundDelay.
///
/// @param line  the object
/// @return milliseconds; 0 for an object that was never begun
#[no_mangle]
pub unsafe extern "C" fn mbm_line_getTurnaroundDelay(line: *const mbm_line) -> u16 {
    // SAFETY: as the header demands.
    unsafe {
        read(line, 0, |line| {
            to_millis(line.settings.turnaround_delay.get()) as u16
        })
    }
}

/// Returns the quiet time: see mbm_line_setQuietTime.
///
/// @param line  the object
/// @return milliseconds; 0 for an object that was never begun
#[no_mangle]
pub unsafe extern "C" fn mbm_line_getQuietTime(line: *const mbm_line) -> u16 {
    // SAFETY: as the header demands.
    unsafe {
        read(line, 0, |line| {
            to_millis(line.settings.quiet_time.get()) as u16
        })
    }
}

/// Returns how often a request is repeated: see mbm_line_setRetries.
///
/// @param line  the object
/// @return 0 to 255; 0 for an object that was never begun
#[no_mangle]
pub unsafe extern "C" fn mbm_line_getRetries(line: *const mbm_line) -> u8 {
    // SAFETY: as the header demands.
    unsafe { read(line, 0, |line| line.settings.retries) }
}

/// Returns whether echo discarding is on: see mbm_line_setEchoDiscard.
///
/// @param line  the object
/// @return 1 or 0; 0 for an object that was never begun
#[no_mangle]
pub unsafe extern "C" fn mbm_line_getEchoDiscard(line: *const mbm_line) -> u8 {
    // SAFETY: as the header demands.
    unsafe { read(line, 0, |line| line.settings.echo_discard.into()) }
}

/// Returns how long the driver stays on after the flush: see mbm_line_setPostFlushHold.
///
/// @param line  the object
/// @return characters; 0 for an object that was never begun
#[no_mangle]
pub unsafe extern "C" fn mbm_line_getPostFlushHold(line: *const mbm_line) -> u8 {
    // SAFETY: as the header demands.
    unsafe { read(line, 0, |line| line.settings.post_flush_hold) }
}
