//! How a client's requests travel.

use super::job::Job;
use super::shared::Shared;

/// A serial line, or a TCP stream.
pub trait Line<J> {
    /// The most requests under way at once.
    const MOST: usize;

    /// Whether unit 0 is everybody.
    const BROADCASTS: bool;

    /// Whether a caller's number must tell one request from another.
    const HAS_IDS: bool;

    /// Moves on to the time `now`; gives a job back that ended. `fresh` at the
    /// first of the calls that one poll makes, when there may be something new.
    fn advance<const N: usize>(
        &mut self,
        shared: &mut Shared<J, N>,
        now: u32,
        fresh: bool,
    ) -> Option<J>;

    /// Forgets a job that was under way, or with `None` all, with what is half
    /// received or half sent.
    fn release(&mut self, job: Option<&J>);

    /// True if nothing is left to be sent of requests that were given up.
    fn is_idle(&self) -> bool {
        true
    }

    /// How long there is nothing to do; `None` if that depends on the queue.
    fn delay(&mut self, now: u32) -> Option<u32>;

    /// See [`Client::lend`](super::Client::lend).
    fn lend<const N: usize>(&self, shared: &mut Shared<J, N>) -> bool
    where
        J: Job,
    {
        let free = !shared.lent && shared.is_idle() && self.is_idle();
        shared.lent |= free;
        free
    }

    /// See [`Client::poll_delay`](super::Client::poll_delay).
    fn poll_delay<const N: usize>(&mut self, shared: &Shared<J, N>, now: u32) -> u32
    where
        J: Job,
    {
        match self.delay(now) {
            _ if shared.lent => u32::MAX,
            Some(delay) => delay,
            None => shared.delay(now),
        }
    }
}
