//! The settings that say which requests a client repeats, how often and when.

use super::object::mbm_client;
use super::settings::{set, Parts};
use super::storage::ClientBuffers;
use core::ffi::c_void;
use mbm::client::{
    again, again_when_busy, Backoff, ClientStorage as _, Policy, RequestState, Waits, NO_RETRIES,
};
use mbm::error::Status;
use mbm::time::timeout;

/// `retryLimit` of mbm_clientRequest and mbm_clientUnit: no repetitions.
pub const MBM_NO_RETRIES: u8 = 255;
const _: () = assert!(MBM_NO_RETRIES == NO_RETRIES);

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

/// Sets how often the client repeats a request whose response is missing, damaged or
/// malformed, or that the port did not accept. It does not repeat a request that was
/// answered with an exception (but see mbm_client_setBusyRetries), one that a lost link
/// interrupted, or one whose response is too long for a buffer. `retryLimit` of a request or
/// of a unit replaces this number.
///
/// @param retries  0 to 255; the default is 0
#[no_mangle]
pub unsafe extern "C" fn mbm_client_setRetries(client: *mut mbm_client, retries: u8) -> u8 {
    set(client, |parts| {
        parts.queue.policy.retries = retries;
        allow_retries(parts);
        Status::OK
    })
}

/// Lets the client repeat requests whose limit of retries is not 0.
pub(super) fn allow_retries(parts: Parts) {
    parts.queue.may_retry = true;
    parts.storage.again.get_or_insert(again_after_failure);
}

/// As [`again`].
fn again_after_failure(
    storage: &mut ClientBuffers,
    policy: &Policy,
    state: &RequestState,
    status: Status,
) -> Option<u32> {
    let limit = match storage.unit_records {
        Some(unit_records) => (unit_records.retry_limit)(storage, state.unit()),
        None => 0,
    };
    again(policy, state, limit, status, || storage.random())
}

/// Makes the client repeat a request that a busy device refuses (V1.1b3, 7): any request that
/// the device answers with exception 06 (SERVER DEVICE BUSY), and a request that only reads
/// that it answers with exception 05 (ACKNOWLEDGE). Without this setting both are the result of
/// the request, as every exception is.
///
/// After exception 06 the device has not carried out the request, so the client repeats any
/// request. After exception 05 the device is carrying out the request, so a repetition would
/// let it do the work again: the client repeats only functions 01 to 04, 07, 0B, 0C, 11, 14
/// and 18, and 2B with MEI type 0E. A request that writes ends with the status 5; ask the
/// device in your own way when the work is done.
///
/// These repetitions are counted apart from those of mbm_client_setRetries. Meanwhile the
/// client sends other requests, also to this unit.
///
/// @param retries  the most repetitions of one request for this reason, 0 (the default) to 255; the
///                 request then ends with the status 5 or 6
/// @param waitMs   the wait before each repetition in milliseconds, 0 to 65535
#[no_mangle]
pub unsafe extern "C" fn mbm_client_setBusyRetries(
    client: *mut mbm_client,
    retries: u8,
    waitMs: u32,
) -> u8 {
    set(client, |parts| {
        let Ok(wait) = u16::try_from(waitMs) else {
            return Status::INVALID_ARGUMENT;
        };
        parts.queue.policy.busy_retries = retries;
        parts.queue.policy.busy_wait_ms = wait;
        parts.storage.again = Some(|storage, policy, state, status| {
            again_when_busy(policy, state, status)
                .or_else(|| again_after_failure(storage, policy, state, status))
        });
        parts.queue.may_retry = true;
        Status::OK
    })
}

functions! {
    (client: *mut mbm_client)

    /// Sets how long a request waits before the client repeats it. Meanwhile the client sends
    /// other requests.
    ///
    /// @param backoff     MBM_BACKOFF_NONE (the default) to MBM_BACKOFF_EXPONENTIAL
    /// @param delayMs     the wait before the first repetition, in milliseconds, 0 to 1000000
    /// @param maxDelayMs  the longest wait, in milliseconds, 0 to 1000000
    fn mbm_client_setBackoff(backoff: u8, delayMs: u32, maxDelayMs: u32)
        = set(|parts| {
            set_backoff(&mut parts.queue.policy.waits, backoff, delayMs, maxDelayMs)
        });
}

/// Sets `waits`, with the arguments of [`mbm_client_setBackoff`].
pub(crate) fn set_backoff(waits: &mut Waits, backoff: u8, delay_ms: u32, most_ms: u32) -> Status {
    let Some(backoff) = Backoff::from_code(backoff) else {
        return Status::INVALID_ARGUMENT;
    };
    let (Some(wait), Some(most)) = (timeout(delay_ms), timeout(most_ms)) else {
        return Status::INVALID_ARGUMENT;
    };
    waits.set_backoff(backoff, wait, most);
    Status::OK
}

/// Shortens each wait before a repetition by a random part, so that several clients do not
/// repeat their requests at the same time.
///
/// @param percent  0 (the default) to 100: the largest part of the wait by which the client
///                 shortens it
/// @param random   returns a new random number at each call, for example that of rand(). It may
///                 have 32 bits, 15 bits, or random bits in its upper half only. A function that it
///                 calls on the client returns MBM_BUSY. NULL only if `percent` is 0
/// @param context  your pointer, passed to `random`; may be NULL
#[no_mangle]
pub unsafe extern "C" fn mbm_client_setJitter(
    client: *mut mbm_client,
    percent: u8,
    random: Option<unsafe extern "C" fn(context: *mut c_void) -> u32>,
    context: *mut c_void,
) -> u8 {
    set(client, |parts| {
        if !parts
            .queue
            .policy
            .waits
            .set_jitter(percent, random.is_some())
        {
            return Status::INVALID_ARGUMENT;
        }
        parts.storage.random = random;
        parts.storage.random_context = context;
        Status::OK
    })
}
