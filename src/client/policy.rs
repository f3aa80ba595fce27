//! How often a client retries a request, and how long it waits before each retry.

use super::request::RequestState;
use crate::error::Status;
use crate::time::{millis, Micros};

/// How the wait before a retry grows from one retry to the next. `wait` and `most` are
/// the arguments of [`Waits::set_backoff`].
///
/// ```
/// # include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/doc/pump.rs"));
/// # fn main() -> Result<(), mbm::Error> {
/// # let mut client = mbm::client::BlockingClient::tcp(tcp());
/// use mbm::client::Backoff;
///
/// // 100 ms before the first retry, then 200 and 400 ms, at most 500 ms.
/// client.policy().retries = 4;
/// client.policy().waits.set_backoff(Backoff::Exponential, 100_000, 500_000);
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
#[repr(u8)]
pub enum Backoff {
    /// No wait.
    None,
    /// Always `wait`, at most `most`.
    Fixed,
    /// `wait` times 1, 2, 3 and so on, at most `most`.
    Linear,
    /// `wait` times 1, 2, 4 and so on, at most `most`.
    Exponential,
}

impl Backoff {
    /// The backoff for a number from C; `None` if the number is not 0 to 3.
    // For the C API; it may change in any version.
    #[doc(hidden)]
    pub const fn from_code(code: u8) -> Option<Backoff> {
        match code {
            0 => Some(Backoff::None),
            1 => Some(Backoff::Fixed),
            2 => Some(Backoff::Linear),
            3 => Some(Backoff::Exponential),
            _ => None,
        }
    }
}

/// Computes the wait before a retry. The arguments are the waits, the number of the
/// retry (from 1 on), and a random number for the jitter.
type Grow = fn(&Waits, u8, u32) -> u32;

/// How long to wait before each retry. Times are in microseconds.
///
/// ```
/// use mbm::client::{Backoff, Policy};
///
/// let mut waits = Policy::DEFAULT.waits;
/// waits.set_backoff(Backoff::Linear, 100_000, 250_000);
/// assert_eq!([1, 2, 3].map(|retry| waits.wait(retry, || 0)), [100_000, 200_000, 250_000]);
/// // Up to a fifth less, at random, so that many clients do not repeat at the same time.
/// assert!(waits.set_jitter(20, true));
/// ```
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct Waits {
    /// The wait before the first retry.
    wait: Micros,
    /// The longest wait.
    max_wait: Micros,
    /// Computes the wait; `None` if there is no wait. (A pointer, so that firmware
    /// without a backoff does not contain its code.)
    grow: Option<Grow>,
    /// How the wait grows; `grow` uses it.
    backoff: Backoff,
    /// Up to this part of the wait, in 256ths, is subtracted at random.
    pub jitter: u8,
}

/// How many retries a request gets, and how long the client waits before each.
///
/// ```
/// # include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/doc/pump.rs"));
/// # fn main() -> Result<(), mbm::Error> {
/// # let mut client = mbm::client::BlockingClient::tcp(tcp());
/// let policy = client.policy();
/// policy.retries = 2;
/// policy.busy_retries = 5;
/// policy.busy_wait_ms = 200;
/// # Ok(())
/// # }
/// ```
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct Policy {
    /// The wait before each retry after a failure.
    pub waits: Waits,
    /// Greatest number of retries of one request, 0 to 255.
    pub retries: u8,
    /// Greatest number of retries of one request that a busy device refuses, 0 to 255.
    pub busy_retries: u8,
    /// The wait before each of these retries, in milliseconds.
    pub busy_wait_ms: u16,
}

impl Policy {
    /// No retries.
    pub const DEFAULT: Policy = Policy {
        waits: Waits {
            wait: 0,
            max_wait: 0,
            grow: None,
            backoff: Backoff::None,
            jitter: 0,
        },
        retries: 0,
        busy_retries: 0,
        busy_wait_ms: 0,
    };
}

impl Waits {
    /// Sets the wait before the first retry, how it grows, and the longest wait `most`.
    pub fn set_backoff(&mut self, backoff: Backoff, wait: u32, most: u32) {
        self.grow = Some(Waits::grown_wait);
        self.backoff = backoff;
        self.wait = wait;
        self.max_wait = most;
    }

    /// Sets the largest part of a wait that is subtracted at random, in percent. False, with
    /// nothing changed, for more than 100, or if there is no random number and `percent` is not
    /// 0.
    pub fn set_jitter(&mut self, percent: u8, has_random: bool) -> bool {
        let allowed = percent <= 100 && (has_random || percent == 0);
        if allowed {
            self.jitter = ((u16::from(percent) * 163) >> 6).min(255) as u8;
        }
        allowed
    }

    /// The wait before retry number `retry`, counted from 1. `random` returns a random
    /// number, which decides how much jitter is subtracted.
    pub fn wait(&self, retry: u8, random: impl FnOnce() -> u32) -> u32 {
        match self.grow {
            Some(grow) => grow(self, retry, random()),
            None => 0,
        }
    }

    fn grown_wait(&self, retry: u8, random: u32) -> u32 {
        // A sum, because a product would need a 64-bit multiplication.
        let (mut wait, mut step) = (0, self.wait);
        for count in 0..retry {
            if self.backoff == Backoff::None || (self.backoff == Backoff::Fixed && count > 0) {
                break;
            }
            if self.backoff == Backoff::Exponential && count > 0 {
                step = wait;
            }
            wait = step.saturating_add(wait).min(self.max_wait);
        }
        wait - fraction(
            fraction(wait, u16::from(self.jitter) << 8),
            mix_bits(random),
        )
    }
}

/// Mixes `random` into 16 bits. Each of them depends on all lower bits of `random`, so the
/// result covers its whole range, whichever bits of `random` vary. (The factor is 2^32 divided
/// by the golden ratio, which spreads consecutive numbers evenly.)
fn mix_bits(random: u32) -> u16 {
    (random.wrapping_mul(0x9E37_79B1) >> 16) as u16
}

/// `part` 65536ths of a time. (Computed in two steps, without a 64-bit multiplication.)
fn fraction(time: u32, part: u16) -> u32 {
    let part = u32::from(part);
    (time >> 16) * part + (((time & 0xFFFF) * part) >> 16)
}

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
    Some(policy.waits.wait(retries + 1, random))
}

/// Microseconds to wait before the next retry of a request that ended with `status`, the
/// exception of a busy device; `None` if the request is not retried. Exception 06 says that
/// the device refused the request. Exception 05 says that the device carries the request
/// out, so only a request that changes nothing may be sent again.
pub fn again_when_busy(policy: &Policy, state: &RequestState, status: Status) -> Option<u32> {
    let may_be_repeated = match status {
        Status::ACKNOWLEDGE => state.only_reads(),
        status => status == Status::SERVER_DEVICE_BUSY,
    };
    (may_be_repeated && state.busy_retries < policy.busy_retries)
        .then_some(millis(policy.busy_wait_ms))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn waits(backoff: Backoff) -> [u32; 5] {
        let mut policy = Policy::DEFAULT;
        policy.waits.set_backoff(backoff, 1000, 3500);
        [1, 2, 3, 4, 255].map(|retry| policy.waits.wait(retry, || 0))
    }

    #[test]
    fn waits_grow_as_the_backoff_says_up_to_the_longest_wait() {
        assert_eq!(waits(Backoff::None), [0; 5]);
        assert_eq!(waits(Backoff::Fixed), [1000; 5]);
        assert_eq!(waits(Backoff::Linear), [1000, 2000, 3000, 3500, 3500]);
        assert_eq!(waits(Backoff::Exponential), [1000, 2000, 3500, 3500, 3500]);
    }

    /// Divides the range of the jitter into ten equal parts, and counts the numbers that
    /// fall into each part, in per mille.
    fn tenths(numbers: impl Iterator<Item = u32>) -> [u32; 10] {
        let mut policy = Policy::DEFAULT;
        policy
            .waits
            .set_backoff(Backoff::Fixed, 1_000_000, 1_000_000);
        policy.waits.jitter = 128;
        let (mut counts, mut all) = ([0; 10], 0);
        for number in numbers {
            let off = 1_000_000 - policy.waits.wait(1, || number);
            counts[(off / 50_000) as usize] += 1000;
            all += 1;
        }
        counts.map(|count| count / all)
    }

    fn assert_even(tenths: [u32; 10]) {
        assert!(
            tenths.iter().all(|tenth| (80..=120).contains(tenth)),
            "{tenths:?}"
        );
    }

    #[test]
    fn jitter_subtracts_at_most_its_part() {
        let mut policy = Policy::DEFAULT;
        policy.waits.set_backoff(Backoff::Fixed, 1000, 1000);
        policy.waits.jitter = 77;
        assert_eq!(policy.waits.wait(1, || 0), 1000);
        assert_eq!(policy.waits.wait(1, || 1 << 31), 850);
        let least = (0..0x8000)
            .map(|number| policy.waits.wait(1, || number))
            .min();
        assert_eq!(least, Some(701));
    }

    #[test]
    fn jitter_is_spread_evenly_whichever_bits_of_the_random_number_vary() {
        let numbers = |bits: u32, shift: u32| (0..1 << bits).map(move |number| number << shift);
        assert_even(tenths(numbers(15, 0)));
        assert_even(tenths(numbers(16, 0)));
        assert_even(tenths(numbers(16, 16)));
        assert_even(tenths(numbers(15, 16)));
        assert_even(tenths(numbers(10, 0)));
        assert_even(tenths(numbers(10, 22)));
        assert_even(tenths(numbers(8, 24)));
        // A 32-bit generator: multiples of 65521, and numbers whose two halves are equal.
        assert_even(tenths((0..65_000).map(|number| number * 65_521)));
        assert_even(tenths((0..65_536).map(|number| number * 0x1_0001)));
    }
}
