//! When a request is asked again that was not answered.

use crate::error::Status;

/// How the wait grows from one retry to the next.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
#[repr(u8)]
pub enum Backoff {
    /// Asked again at once.
    None,
    /// Always the same wait, or the most if that is less.
    Fixed,
    /// Once, twice, three times the wait, up to the most.
    Linear,
    /// Once, twice, four times the wait, up to the most.
    Exponential,
}

impl Backoff {
    /// The backoff of a number that C hands in.
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

/// The wait before a retry of a number, given any number for the jitter.
type Grow = fn(&Policy, u8, u32) -> u32;

/// How long to wait before a retry. Times are in microseconds.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct Policy {
    /// The wait before the first retry.
    wait: u32,
    /// The longest wait.
    most: u32,
    /// How the wait grows: `None` for not at all. (A pointer, so that firmware
    /// without a backoff carries none.)
    grow: Option<Grow>,
    /// How the wait grows, for that.
    backoff: Backoff,
    /// How much of the wait is left to chance, in parts of 256.
    pub jitter: u8,
    /// How often a request is repeated that was not answered.
    pub retries: u8,
}

impl Policy {
    /// No retries.
    pub const DEFAULT: Policy = Policy {
        wait: 0,
        most: 0,
        grow: None,
        backoff: Backoff::None,
        jitter: 0,
        retries: 0,
    };

    /// Sets how the wait grows.
    pub fn set_backoff(&mut self, backoff: Backoff, wait: u32, most: u32) {
        self.grow = Some(Policy::grown);
        self.backoff = backoff;
        self.wait = wait;
        self.most = most;
    }

    /// The wait before retry number `retry`, from 1 on; `random` gives any number,
    /// which decides how much of the jitter is taken off.
    #[inline]
    pub fn wait(&self, retry: u8, random: impl FnOnce() -> u32) -> u32 {
        match self.grow {
            Some(grow) => grow(self, retry, random()),
            None => 0,
        }
    }

    fn grown(&self, retry: u8, random: u32) -> u32 {
        // Added up, for a product would be a wide one.
        let (mut wait, mut step) = (0, self.wait);
        for count in 0..retry {
            if self.backoff == Backoff::None || (self.backoff == Backoff::Fixed && count > 0) {
                break;
            }
            if self.backoff == Backoff::Exponential && count > 0 {
                step = wait;
            }
            wait = step.saturating_add(wait).min(self.most);
        }
        wait - share(share(wait, u16::from(self.jitter) << 8), mixed(random))
    }
}

/// How long a request that ended with `status` waits to be asked again; `None` if it
/// is not. It was asked again `retries` times; `random` gives any number.
pub fn again(
    policy: &Policy,
    retries: u8,
    status: Status,
    random: impl FnOnce() -> u32,
) -> Option<u32> {
    if retries >= policy.retries || !status.may_be_repeated() {
        return None;
    }
    Some(policy.wait(retries + 1, random))
}

/// Sixteen bits of which each depends on all bits of `random` below it, so that
/// they vary over their whole range whichever bits of `random` vary. (The factor is
/// 2^32 divided by the golden ratio, which spreads numbers in a row evenly.)
fn mixed(random: u32) -> u16 {
    (random.wrapping_mul(0x9E37_79B1) >> 16) as u16
}

/// So many 65536ths of a time. (In steps, which need no wide multiplication.)
fn share(time: u32, part: u16) -> u32 {
    let part = u32::from(part);
    (time >> 16) * part + (((time & 0xFFFF) * part) >> 16)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn waits(backoff: Backoff) -> [u32; 5] {
        let mut policy = Policy::DEFAULT;
        policy.set_backoff(backoff, 1000, 3500);
        [1, 2, 3, 4, 255].map(|retry| policy.wait(retry, || 0))
    }

    #[test]
    fn waits_grow_as_the_backoff_says_and_not_beyond_the_most() {
        assert_eq!(waits(Backoff::None), [0; 5]);
        assert_eq!(waits(Backoff::Fixed), [1000; 5]);
        assert_eq!(waits(Backoff::Linear), [1000, 2000, 3000, 3500, 3500]);
        assert_eq!(waits(Backoff::Exponential), [1000, 2000, 3500, 3500, 3500]);
    }

    /// The share of each tenth of the jitter, in per mille of the numbers.
    fn tenths(numbers: impl Iterator<Item = u32>) -> [u32; 10] {
        let mut policy = Policy::DEFAULT;
        policy.set_backoff(Backoff::Fixed, 1_000_000, 1_000_000);
        policy.jitter = 128;
        let (mut counts, mut all) = ([0; 10], 0);
        for number in numbers {
            let off = 1_000_000 - policy.wait(1, || number);
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
    fn jitter_takes_off_up_to_its_share() {
        let mut policy = Policy::DEFAULT;
        policy.set_backoff(Backoff::Fixed, 1000, 1000);
        policy.jitter = 77;
        assert_eq!(policy.wait(1, || 0), 1000);
        assert_eq!(policy.wait(1, || 1 << 31), 850);
        let least = (0..0x8000).map(|number| policy.wait(1, || number)).min();
        assert_eq!(least, Some(701));
    }

    #[test]
    fn jitter_is_even_whichever_bits_of_the_random_number_vary() {
        let numbers = |bits: u32, shift: u32| (0..1 << bits).map(move |number| number << shift);
        assert_even(tenths(numbers(15, 0)));
        assert_even(tenths(numbers(16, 0)));
        assert_even(tenths(numbers(16, 16)));
        assert_even(tenths(numbers(15, 16)));
        assert_even(tenths(numbers(10, 0)));
        assert_even(tenths(numbers(10, 22)));
        assert_even(tenths(numbers(8, 24)));
        // A generator of 32 bits: every 65521st of its numbers, and both halves alike.
        assert_even(tenths((0..65_000).map(|number| number * 65_521)));
        assert_even(tenths((0..65_536).map(|number| number * 0x1_0001)));
    }
}
