//! The interface between a client and its serial line or TCP stream.

use super::queue::RequestQueue;
use super::request::ClientRequest;
use crate::engine::Settings;

/// A serial line, or a TCP stream.
pub trait Transport<J> {
    /// True if unit 0 addresses all units (broadcast).
    const HAS_BROADCAST: bool;

    /// True if the transaction numbers of pending requests must differ.
    const HAS_TRANSACTION_IDS: bool;

    /// The type of the port.
    type Port;

    /// The type of the buffers.
    type Storage;

    /// See [`Client::settings`](super::Client::settings).
    fn settings(&mut self) -> &mut Settings;

    /// See [`Client::port`](super::Client::port).
    fn port(&mut self) -> &mut Self::Port;

    /// See [`Client::storage`](super::Client::storage).
    fn storage(&mut self) -> &mut Self::Storage;

    /// Advances the requests to the time `now`, and returns one that has ended. `fresh` is
    /// true in the first call of each poll, when new bytes may have arrived.
    fn advance<const N: usize>(
        &mut self,
        queue: &mut RequestQueue<J, N>,
        now: u32,
        fresh: bool,
    ) -> Option<J>;

    /// Discards the state of one request in flight; with `None`, of all requests and of
    /// all partly received or partly sent frames.
    fn release(&mut self, request: Option<&J>);

    /// Forgets which units may still answer earlier requests: the link is a new one, on which they
    /// cannot come.
    fn forget_late_replies(&mut self) {}

    /// True if no bytes of cancelled requests wait to be sent.
    fn is_idle(&self) -> bool {
        true
    }

    /// Microseconds until the line has something to do; `None` if the queue decides.
    fn delay(&mut self, now: u32) -> Option<u32>;

    /// See [`Client::suspend`](super::Client::suspend).
    fn suspend<const N: usize>(&self, queue: &mut RequestQueue<J, N>) -> bool
    where
        J: ClientRequest,
    {
        let free = !queue.suspended && queue.is_idle() && self.is_idle();
        queue.suspended |= free;
        free
    }

    /// See [`Client::poll_delay`](super::Client::poll_delay).
    fn poll_delay<const N: usize>(&mut self, queue: &RequestQueue<J, N>, now: u32) -> u32
    where
        J: ClientRequest,
    {
        if queue.suspended {
            return u32::MAX;
        }
        match self.delay(now) {
            Some(delay) => delay,
            None => queue.delay(now),
        }
    }
}
