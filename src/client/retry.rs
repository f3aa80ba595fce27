//! Decides which requests a client retries.

use super::policy::Policy;
use super::request::RequestState;
use crate::error::Status;
use crate::time::millis;

/// In [`RequestState::retry_limit`] and [`UnitRecord::retry_limit`](super::UnitRecord): no
/// retries.
pub const NO_RETRIES: u8 = 255;

/// Microseconds to wait before the next retry of a request that ended with `status` without
/// an answer; `None` if the request is not retried. `unit_limit` is the limit of its unit, 0
/// for that of the policy. `random` returns a random number for the jitter.
pub fn again(
    policy: &Policy,
    state: &RequestState,
    unit_limit: u8,
    status: Status,
    random: impl FnOnce() -> u32,
) -> Option<u32> {
    let limit = match (state.retry_limit, unit_limit) {
        (0, 0) => policy.retries,
        (NO_RETRIES, _) | (0, NO_RETRIES) => 0,
        (0, limit) | (limit, _) => limit,
    };
    let retries = state.retries;
    if retries >= limit || !status.may_be_repeated() {
        return None;
    }
    Some(policy.wait(retries + 1, random))
}

/// Microseconds to wait before the next retry of a request that ended with `status`, the
/// exception of a busy device; `None` if the request is not retried. Exception 06 says that
/// the device refused the request. Exception 05 says that the device carries the request
/// out, so only a request that changes nothing may be sent again.
pub fn again_when_busy(policy: &Policy, state: &RequestState, status: Status) -> Option<u32> {
    let may_be_repeated = match status {
        Status::ACKNOWLEDGE => state.header.only_reads(),
        status => status == Status::SERVER_DEVICE_BUSY,
    };
    (may_be_repeated && state.busy_retries < policy.busy_retries)
        .then_some(millis(policy.busy_wait_ms))
}
