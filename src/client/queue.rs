//! The queue of a client, and the steps after the end of a request. Serial lines and TCP
//! streams use the same queue, so a program contains its code once.

use super::policy::{Policy, NO_RETRIES};
use super::request::{ClientRequest, RequestState, Stage};
use super::storage::ClientStorage;
use crate::engine::BROADCAST;
use crate::error::Status;
use crate::time::{elapsed, has_elapsed, Micros, LONGEST};
use heapless::Vec;

/// The requests and the policy of a client.
#[repr(C)]
#[derive(Debug)]
pub struct RequestQueue<J, const N: usize> {
    /// The queue has changed: `since` and `wait` do not hold, a request may be due now.
    pub(super) changed: bool,
    /// The link is up.
    pub connected: bool,
    /// Another user of the port has the line, see [`Client::suspend`](super::Client::suspend).
    pub suspended: bool,
    /// Unit 0 addresses all units (broadcast).
    pub has_broadcast: bool,
    /// Transaction numbers of pending requests must differ, except 0.
    pub has_transaction_ids: bool,
    /// Requests may have their own limit of retries.
    pub may_retry: bool,
    /// Requests in flight go on, but no other one is sent.
    pub is_held: bool,
    /// Requests in a row that timed out or that the port did not accept, up to 127. After an answer
    /// it is the number of requests in flight below 0, since these do not count.
    pub unanswered: i8,
    /// No request is due until `wait` microseconds have passed since `since`.
    since: Micros,
    wait: Micros,
    /// The policy for retries.
    pub policy: Policy,
    /// The request in flight on a serial line. It is not in `queue`, but still counts, so
    /// that `queue` has space to take it back.
    pub(super) active: Option<J>,
    pub(super) queue: Vec<J, N>,
}

impl<J, const N: usize> RequestQueue<J, N> {
    pub(super) const fn new() -> Self {
        RequestQueue {
            changed: false,
            connected: true,
            suspended: false,
            has_broadcast: false,
            has_transaction_ids: false,
            may_retry: true,
            is_held: false,
            unanswered: 0,
            since: 0,
            wait: u32::MAX,
            policy: Policy::DEFAULT,
            active: None,
            queue: Vec::new(),
        }
    }

    /// True if no request is pending.
    pub fn is_empty(&self) -> bool {
        self.queue.is_empty() && self.active.is_none()
    }

    /// Number of pending requests: queued or in flight.
    pub fn pending(&self) -> usize {
        self.queue.len() + usize::from(self.active.is_some())
    }

    /// True if `matches` returns true for a pending request.
    pub fn holds(&self, matches: impl Fn(&J) -> bool) -> bool {
        self.active.as_ref().is_some_and(&matches) || self.queue.iter().any(&matches)
    }
}

impl<J: ClientRequest, const N: usize> RequestQueue<J, N> {
    /// See [`Client::queue`](super::Client::queue).
    pub fn enqueue(&mut self, mut request: J) -> Result<(), J> {
        let status = self.readiness(&request);
        let state = request.state_mut();
        state.status = status;
        if status != Status::PENDING {
            return Err(request);
        }
        state.exception = 0;
        state.length = 0;
        state.retries = 0;
        state.busy_retries = 0;
        state.enter(Stage::Queued, 0, 0);
        self.changed = true;
        // `readiness` has checked that the queue is not full.
        let _ = self.queue.push(request);
        Ok(())
    }

    /// [`Status::PENDING`] if the request may be queued, otherwise the error.
    fn readiness(&self, request: &J) -> Status {
        let state = request.state();
        if self.pending() >= N {
            Status::QUEUE_FULL
        } else if !state.is_in_range() {
            Status::INVALID_ARGUMENT
        } else if state.unit() == BROADCAST
            // In TCP frames unit 0 is a unit (messaging on TCP/IP guide V1.0b, 4.4.1.2).
            && !self.has_transaction_ids
            && !(self.has_broadcast && state.may_be_broadcast())
        {
            Status::BROADCAST_NOT_ALLOWED
        } else if self.has_transaction_ids
            && state.transaction != 0
            && self.has_transaction(state.transaction)
        {
            Status::DUPLICATE_TRANSACTION
        } else if !matches!(state.retry_limit, 0 | NO_RETRIES) && !self.may_retry {
            Status::INVALID_ARGUMENT
        } else {
            Status::PENDING
        }
    }

    fn has_transaction(&self, transaction: u16) -> bool {
        let mut queue = self.queue.iter();
        queue.any(|request| request.state().transaction == transaction)
    }

    /// Takes the active request and marks it as sent, because the caller may have
    /// overwritten its state.
    fn take_active(&mut self) -> Option<J> {
        let mut request = self.active.take()?;
        request.state_mut().enter(Stage::Sent, 0, 0);
        Some(request)
    }

    /// Removes the first request for which `matches` returns true, with the status
    /// [`Status::CANCELLED`].
    pub fn cancel_one(&mut self, matches: impl Fn(&J) -> bool) -> Option<J> {
        let mut request = if self.active.as_ref().is_some_and(&matches) {
            self.take_active()?
        } else {
            let at = self.queue.iter().position(matches)?;
            self.remove(at)?
        };
        self.changed = true;
        request.state_mut().status = Status::CANCELLED;
        Some(request)
    }

    /// Gives all requests the status [`Status::CANCELLED`]. They stay in the queue, which the
    /// caller clears.
    pub fn cancel_all(&mut self) {
        if let Some(request) = &mut self.active {
            request.state_mut().status = Status::CANCELLED;
        }
        for request in self.queue.iter_mut() {
            request.state_mut().status = Status::CANCELLED;
        }
    }

    /// Notes that a request was answered while `in_flight` others wait for their answer.
    pub(super) fn note_answered(&mut self, in_flight: u8) {
        self.connected = true;
        self.unanswered = below_zero(in_flight);
    }

    /// Number of requests in flight.
    pub fn in_flight(&self) -> u8 {
        let queue = self.queue.iter();
        let sent = queue.filter(|request| request.state().is_sent()).count();
        (sent + usize::from(self.active.is_some())) as u8
    }

    /// Notes that bytes have arrived.
    pub fn note_received(&mut self) {
        self.unanswered = below_zero(self.in_flight());
    }

    /// True if a request waits to be sent.
    pub fn has_waiting(&self) -> bool {
        let mut queue = self.queue.iter();
        queue.any(|request| request.state().is(Stage::Queued))
    }

    /// True if the next poll may send a request.
    pub fn may_send(&self, now: u32) -> bool {
        self.active.is_none() && self.delay(now) == 0
    }

    /// Marks the requests as lost that have waited for the link, from `since` on, for their
    /// response timeout. `timeout` is that of the client.
    pub fn fail_overdue(
        &mut self,
        now: u32,
        since: u32,
        timeout: u32,
        storage: &mut impl ClientStorage,
    ) {
        self.mark_lost(|request| {
            let state = request.state();
            // Finds the timeout of the unit, too.
            let _ = state.remaining_wait(now, storage);
            has_elapsed(state.response_timeout(storage, timeout), now, since)
        });
    }

    /// Notes that the link was opened anew. The next polls end the requests in flight with
    /// [`Status::LINK_LOST`].
    pub fn interrupt(&mut self) {
        if let Some(request) = self.take_active() {
            self.put_first(request);
        }
        self.mark_lost(|request| request.state().is_sent());
    }

    /// How often all pending requests together were repeated.
    pub fn retries(&self) -> u32 {
        let pending = self.active.iter().chain(&self.queue);
        pending.map(|one| u32::from(one.state().retries)).sum()
    }

    /// True if no request is in flight.
    pub fn is_idle(&self) -> bool {
        self.active.is_none() && !self.queue.iter().any(|request| request.state().is_sent())
    }

    /// Microseconds until a request is due.
    pub(crate) fn delay(&self, now: u32) -> u32 {
        if self.queue.is_empty() {
            u32::MAX
        } else if self.changed {
            0
        } else {
            self.wait.saturating_sub(elapsed(now, self.since))
        }
    }

    /// Removes the request at the index `at` from the queue.
    pub(super) fn remove(&mut self, at: usize) -> Option<J> {
        let mut moved = self.queue.pop()?;
        for place in self.queue.get_mut(at..)?.iter_mut().rev() {
            core::mem::swap(place, &mut moved);
        }
        Some(moved)
    }

    /// Inserts a request at the front of the queue, which has space for it.
    pub(super) fn put_first(&mut self, mut request: J) {
        for place in self.queue.iter_mut() {
            core::mem::swap(place, &mut request);
        }
        let _ = self.queue.push(request);
    }

    /// Removes the first request that is due from the queue. If there is none, records when
    /// the next request is due. `rest` returns how long the line leaves the request's unit alone.
    pub(super) fn take_due<S: ClientStorage>(
        &mut self,
        now: u32,
        storage: &mut S,
        mut rest: impl FnMut(&RequestState) -> u32,
    ) -> Option<J> {
        let mut least = u32::MAX;
        let found = self.queue.iter().position(|request| {
            let state = request.state();
            let mut wait = state.remaining_wait(now, storage);
            if state.is(Stage::Queued) {
                wait = wait.max(rest(state));
            }
            least = least.min(wait);
            wait == 0
        });
        let Some(at) = found else {
            self.set_next_due(now, least);
            return None;
        };
        self.remove(at)
    }

    /// Records that no request is due until `wait` microseconds after `now`.
    pub fn set_next_due(&mut self, now: u32, wait: u32) {
        self.changed = false;
        self.since = now;
        self.wait = wait;
    }

    /// Ends the request at the index `at` with `status`: returns it, or leaves it there for
    /// a retry.
    pub(super) fn end(
        &mut self,
        at: usize,
        status: Status,
        now: u32,
        storage: &mut impl ClientStorage,
    ) -> Option<J> {
        self.note_end(status);
        let request = self.queue.get_mut(at)?;
        if end_or_retry(&self.policy, request, status, now, storage) {
            return self.remove(at);
        }
        None
    }

    /// Ends a request that was removed from the queue: returns it, or puts it at the front
    /// of the queue for a retry.
    pub(super) fn conclude(
        &mut self,
        mut request: J,
        status: Status,
        now: u32,
        storage: &mut impl ClientStorage,
    ) -> Option<J> {
        self.note_end(status);
        if end_or_retry(&self.policy, &mut request, status, now, storage) {
            return Some(request);
        }
        self.put_first(request);
        None
    }

    /// Notes that a request ends with `status`, if only for now.
    fn note_end(&mut self, status: Status) {
        self.changed = true;
        if matches!(
            status,
            Status::RESPONSE_TIMED_OUT | Status::LINE_BUSY | Status::CONNECT_TIMED_OUT
        ) {
            self.unanswered = self.unanswered.saturating_add(1);
        }
    }

    /// Notes that the link is lost. The next polls end all requests with
    /// [`Status::LINK_LOST`].
    pub(super) fn disconnect(&mut self) {
        self.connected = false;
        self.mark_lost(|_| true);
    }

    /// Ends a request that [`RequestQueue::fail_all`] or [`RequestQueue::interrupt`] marked as
    /// lost; `None` if there is none.
    #[inline(always)]
    pub fn end_lost(&mut self, now: u32, storage: &mut impl ClientStorage) -> Option<J> {
        // With `position`, a client with a link takes 62 bytes more on a Cortex-M0+.
        let mut at = 0;
        while !is_lost(self.queue.get(at)?) {
            at += 1;
        }
        self.end(at, Status::LINK_LOST, now, storage)
    }

    /// True if [`RequestQueue::end_lost`] will return a request.
    pub fn has_lost(&self) -> bool {
        self.queue.iter().any(is_lost)
    }

    /// Marks all requests as lost. None of them is in flight.
    pub fn fail_all(&mut self) {
        self.mark_lost(|_| true);
    }

    /// Puts a placeholder, which is never due, into the empty queue. While the queue has it,
    /// the client reads and drops all bytes that arrive.
    pub fn begin_idle(&mut self, mut placeholder: J, now: u32) {
        placeholder.state_mut().enter(Stage::Queued, now, LONGEST);
        self.set_next_due(now, LONGEST);
        let _ = self.queue.push(placeholder);
    }

    /// Removes the placeholder.
    pub fn end_idle(&mut self) {
        self.queue.clear();
        self.changed = true;
    }

    /// Marks the requests for which `which` returns true as lost. The next polls end them
    /// with [`Status::LINK_LOST`].
    pub(super) fn mark_lost(&mut self, mut which: impl FnMut(&J) -> bool) {
        for request in self.queue.iter_mut() {
            if which(request) {
                request.state_mut().enter(Stage::Lost, 0, 0);
            }
        }
        self.changed = true;
    }
}

/// 0 - `count`, at least -128. (A saturating subtraction takes more flash.)
fn below_zero(count: u8) -> i8 {
    (count.min(128) as i8).wrapping_neg()
}

fn is_lost(request: &impl ClientRequest) -> bool {
    request.state().is(Stage::Lost)
}

/// Ends a request with `status`, or prepares its retry. Returns true if it has ended,
/// false if it waits for a retry.
fn end_or_retry(
    policy: &Policy,
    request: &mut impl ClientRequest,
    status: Status,
    now: u32,
    storage: &mut impl ClientStorage,
) -> bool {
    // No reference that may write the request's state exists while `storage` may call a hook.
    let again = storage.again(policy, request.state(), status);
    storage.note(request.state().unit(), status, again.is_some(), now);
    let state = request.state_mut();
    let Some(wait) = again else {
        state.end(status);
        return true;
    };
    if status.is_exception() {
        state.busy_retries += 1;
    } else {
        state.retries += 1;
    }
    state.enter(Stage::Queued, now, wait);
    false
}
