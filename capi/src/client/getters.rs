//! Getters of a client's settings.

use super::object::{mbm_client, transport, TcpTransport};
use crate::framing::MBM_FRAMING_TCP;
use crate::pointers::read;
use mbm::engine::Settings;
use mbm::time::to_millis;

/// Reads one of the settings; zero of an object that was never begun.
///
/// # Safety
/// As for [`read`].
#[cfg_attr(target_os = "none", inline(always))]
unsafe fn get<T: Default>(client: *const mbm_client, getter: impl FnOnce(&Settings) -> T) -> T {
    // SAFETY: as the caller promises.
    unsafe {
        read(client, T::default(), |object| {
            getter((*(*object).kind).settings(object))
        })
    }
}

/// Returns the response timeout: see mbm_client_setResponseTimeout.
///
/// @param client  the object
/// @return milliseconds; 0 for an object that was never begun
#[no_mangle]
pub unsafe extern "C" fn mbm_client_getResponseTimeout(client: *const mbm_client) -> u32 {
    // SAFETY: as the header demands.
    unsafe {
        get(client, |settings| {
            to_millis(settings.response_timeout.get())
        })
    }
}

/// Returns the silence before a request on an RTU line that is in effect: what
/// mbm_client_setGap set, or t3.5 of the rate that mbm_client_setBaudRate set, or 4 ms.
///
/// @param client  the object
/// @return microseconds; 0 for an object that was never begun
#[no_mangle]
pub unsafe extern "C" fn mbm_client_getGap(client: *const mbm_client) -> u32 {
    // SAFETY: as the header demands.
    unsafe { get(client, |settings| settings.gap.get()) }
}

/// Returns the turnaround delay: see mbm_client_setTurnaroundDelay.
///
/// @param client  the object
/// @return milliseconds; 0 for an object that was never begun
#[no_mangle]
pub unsafe extern "C" fn mbm_client_getTurnaroundDelay(client: *const mbm_client) -> u16 {
    // SAFETY: as the header demands.
    unsafe {
        get(client, |settings| {
            to_millis(settings.turnaround_delay.get()) as u16
        })
    }
}

/// Returns the quiet time: see mbm_client_setQuietTime.
///
/// @param client  the object
/// @return milliseconds; 0 for an object that was never begun
#[no_mangle]
pub unsafe extern "C" fn mbm_client_getQuietTime(client: *const mbm_client) -> u16 {
    // SAFETY: as the header demands.
    unsafe {
        get(client, |settings| {
            to_millis(settings.quiet_time.get()) as u16
        })
    }
}

/// Returns how often a request is repeated: see mbm_client_setRetries.
///
/// @param client  the object
/// @return 0 to 255; 0 for an object that was never begun
#[no_mangle]
pub unsafe extern "C" fn mbm_client_getRetries(client: *const mbm_client) -> u8 {
    // SAFETY: as the header demands.
    unsafe { read(client, 0, |object| (*object).queue.policy.retries) }
}

/// Returns whether echo discarding is on: see mbm_client_setEchoDiscard.
///
/// @param client  the object
/// @return 1 or 0; 0 for an object that was never begun
#[no_mangle]
pub unsafe extern "C" fn mbm_client_getEchoDiscard(client: *const mbm_client) -> u8 {
    // SAFETY: as the header demands.
    unsafe { get(client, |settings| settings.echo_discard.into()) }
}

/// Returns how long the driver stays on after the flush: see mbm_client_setPostFlushHold.
///
/// @param client  the object
/// @return characters; 0 for an object that was never begun
#[no_mangle]
pub unsafe extern "C" fn mbm_client_getPostFlushHold(client: *const mbm_client) -> u8 {
    // SAFETY: as the header demands.
    unsafe { get(client, |settings| settings.post_flush_hold) }
}

/// Returns how many requests may be under way at once: see mbm_client_setInFlight.
///
/// @param client  the object
/// @return 1 to 16; 1 on a serial line and in RTU over TCP; 0 for an object that was never begun
#[no_mangle]
pub unsafe extern "C" fn mbm_client_getInFlight(client: *const mbm_client) -> u8 {
    // SAFETY: as the header demands.
    unsafe {
        read(client, 0, |object| match (*(*object).kind).framing {
            MBM_FRAMING_TCP => transport::<TcpTransport>(object)
                .most()
                .min(super::MBM_CLIENT_DEPTH),
            _ => 1,
        })
    }
}
