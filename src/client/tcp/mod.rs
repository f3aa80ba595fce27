//! A client's TCP stream. One request is in flight at a time, or as many as the program allows; the
//! transaction identifier in the header shows which request a response answers.

mod find;
mod rules;
mod tolerant;

pub use tolerant::{TolerantTcp, ACCEPT_TRANSACTION, ACCEPT_UNIT};

use super::queue::RequestQueue;
use super::request::{data_of, ClientRequest, RequestState, Stage};
use super::storage::ClientStorage;
use super::Transport;
use crate::bytes::move_to_front;
use crate::engine::{Counter, Settings};
use crate::error::Status;
use crate::frame::tcp;
use crate::port::Port;
use rules::{Rules, Strict};

/// A TCP stream. One request is in flight at a time, unless [`Tcp::set_in_flight`] allows more.
/// Received bytes are in the frame buffer, bytes to send in [`ClientStorage::outgoing`].
///
/// ```
/// # include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/doc/pump.rs"));
/// # fn main() -> Result<(), mbm::Error> {
/// use mbm::client::{Client, Request, Tcp, TcpBuffers};
///
/// let mut line = Tcp::new(tcp(), TcpBuffers::new([0; 260], [0; 260]));
/// // A server that takes several requests at once answers sooner.
/// line.set_in_flight(16);
/// let client: Client<_, Request, 16> = Client::new(line);
/// # Ok(())
/// # }
/// ```
#[repr(C)]
#[derive(Debug)]
pub struct Tcp<P, S> {
    /// Number of requests in flight, and how many may be in flight beside one.
    in_flight: u8,
    more_in_flight: u8,
    /// The received bytes that were not searched yet: the indices of the first, and after
    /// the last, in the frame buffer.
    start: u16,
    end: u16,
    /// The transaction identifier of the next request. (It is between the fields that
    /// [`Tcp::clear`] zeroes. If they were contiguous, the compiler would call memset, 200
    /// bytes of libc on a Cortex-M0+.)
    next: u16,
    /// Number of bytes in the transmit buffer, and how many of them were sent.
    filled: u16,
    sent: u16,
    /// Bytes to skip: the rest of a frame that is finished with.
    skip: u16,
    /// The frame boundaries are lost. Until they are found, only a right response to a
    /// request counts as a frame.
    resyncing: bool,
    /// The port has accepted bytes, so there is or was a connection.
    accepts: bool,
    /// A queued request waits until another ends or the transmit buffer has space.
    blocked: bool,
    /// Only one request may be in flight.
    is_single: bool,
    /// The byte stream.
    pub port: P,
    /// The caller's buffers and records.
    pub storage: S,
    /// TCP uses only the response timeout, and the turnaround delay for requests without a
    /// response.
    pub settings: Settings,
}

impl<P, S> Tcp<P, S> {
    /// A stream that is open or will be opened.
    pub const fn new(port: P, storage: S) -> Self {
        Tcp {
            next: 0,
            start: 0,
            end: 0,
            skip: 0,
            filled: 0,
            sent: 0,
            in_flight: 0,
            more_in_flight: 0,
            resyncing: false,
            accepts: false,
            blocked: false,
            is_single: false,
            port,
            storage,
            settings: Settings::DEFAULT,
        }
    }

    /// Allows up to `most` requests in flight at the same time, at least 1, which is the default.
    /// More are faster, but many servers take one at a time and drop the others. False, with nothing
    /// changed, if a [`TolerantTcp`] must not have more than one.
    pub fn set_in_flight(&mut self, most: u8) -> bool {
        let more = most.saturating_sub(1);
        let is_allowed = more == 0 || !self.is_single;
        if is_allowed {
            self.more_in_flight = more;
        }
        is_allowed
    }

    fn clear(&mut self) {
        self.start = 0;
        self.end = 0;
        self.skip = 0;
        self.filled = 0;
        self.sent = 0;
        self.in_flight = 0;
        self.resyncing = false;
        self.accepts = false;
    }
}

impl<P: Port, S: ClientStorage> Tcp<P, S> {
    /// Reads the bytes that have arrived; false if the link is lost.
    fn read_bytes(&mut self) -> bool {
        if self.start == self.end {
            self.start = 0;
            self.end = 0;
        } else if self.start > 0 {
            self.compact();
        }
        let length = self.storage.capacity() - self.end;
        let space = self.storage.bytes(self.end, length);
        if space.is_empty() {
            return true;
        }
        let received = self.port.read_count(space);
        if received < 0 {
            return false;
        }
        let received = received as u16;
        self.storage.count(Counter::BytesReceived, received.into());
        self.end += received;
        true
    }

    /// As [`Transport::advance`], by these rules.
    #[inline(always)]
    fn advance_by<J: ClientRequest, const N: usize>(
        &mut self,
        queue: &mut RequestQueue<J, N>,
        now: u32,
        fresh: bool,
        rules: &mut impl Rules,
    ) -> Option<J> {
        if queue.queue.is_empty() {
            return None;
        }
        // Bytes are read also while all requests only wait. If they stayed in the port, a
        // program that waits for bytes in select would wake up at once.
        let reads =
            rules.reads_first() || self.in_flight > 0 || queue.is_held || queue.delay(now) > 0;
        let mut fresh = fresh && reads;
        loop {
            if self.start < self.end {
                if let Some(request) = self.find(queue, now, rules) {
                    return Some(request);
                }
            }
            if !fresh {
                if queue.is_held {
                    return None;
                }
                let rest = match self.in_flight {
                    0 => rules.rest(now),
                    _ => 0,
                };
                if rest == 0 {
                    return self.send(queue, now, rules);
                }
                queue.set_next_due(now, rest);
                return match self.flush(queue) {
                    true => None,
                    false => self.end_all_lost(queue, now),
                };
            }
            if !self.read_bytes() {
                return self.end_all_lost(queue, now);
            }
            fresh = false;
        }
    }

    /// Ends the requests whose time is over, and sends queued requests. Returns a request
    /// that has ended.
    fn send<J: ClientRequest, const N: usize>(
        &mut self,
        queue: &mut RequestQueue<J, N>,
        now: u32,
        rules: &mut impl Rules,
    ) -> Option<J> {
        let mut stuck = false;
        if self.in_flight == 0 && self.sent < self.filled {
            let Some(is_stuck) = self.flush_remainder(queue) else {
                return self.end_all_lost(queue, now);
            };
            stuck = is_stuck;
        }
        let mut reads_left = u8::MAX;
        while queue.delay(now) == 0 {
            let Some((at, status)) = self.advance_queue(queue, now, stuck, rules) else {
                break;
            };
            let unanswered = queue.unanswered;
            if let Some(request) = self.conclude(queue, at, status, now, &mut reads_left, rules) {
                return Some(request);
            }
            let again = queue.queue.get(at).map(ClientRequest::state);
            // The request is still in flight as long as bytes arrive that may be its response.
            if rules.is_single() && !again.is_some_and(RequestState::is_sent) {
                break;
            }
            if queue.unanswered != unanswered && again.is_some_and(|state| state.wait == 0) {
                // It is repeated in the next poll, since a link may be replaced first.
                break;
            }
        }
        if !self.flush(queue) {
            return self.end_all_lost(queue, now);
        }
        None
    }

    /// Ends the request that [`Tcp::advance_queue`] found at the index `at`. If the time of
    /// the request is over, reads the port first, as long as `reads_left` is not 0.
    #[cold]
    fn conclude<J: ClientRequest, const N: usize>(
        &mut self,
        queue: &mut RequestQueue<J, N>,
        at: usize,
        mut status: Status,
        now: u32,
        reads_left: &mut u8,
        rules: &mut impl Rules,
    ) -> Option<J> {
        if status == Status::PENDING {
            // At the deadline, all bytes that have arrived are searched, even if the
            // buffer cannot hold them at once.
            let before = self.end - self.start;
            if *reads_left > 0 && !self.read_bytes() {
                return self.end_all_lost(queue, now);
            }
            *reads_left = reads_left.saturating_sub(1);
            if self.start < self.end {
                if self.end - self.start == before {
                    // No more bytes came. The incomplete frame at the front may be noise
                    // that hides the response.
                    self.skip_byte();
                }
                return self.find(queue, now, rules);
            }
            self.in_flight = self.in_flight.wrapping_sub(1);
            status = self.expire(queue.queue.get(at)?);
            rules.note_end(now);
        }
        queue.end(at, status, now, &mut self.storage)
    }

    /// Writes the queued requests that are due into the transmit buffer. Returns the index of
    /// a request that has ended and its status, [`Status::PENDING`] if its time is over. A
    /// request for which the buffer has no space waits, unless the bytes before it are
    /// `stuck`.
    fn advance_queue<J: ClientRequest, const N: usize>(
        &mut self,
        queue: &mut RequestQueue<J, N>,
        now: u32,
        stuck: bool,
        rules: &mut impl Rules,
    ) -> Option<(usize, Status)> {
        let mut least = u32::MAX;
        self.blocked = false;
        let mut at = 0;
        let ended = loop {
            let Some(request) = queue.queue.get_mut(at) else {
                queue.set_next_due(now, least);
                return None;
            };
            at += 1;
            let state = request.state();
            let mut wait = state.remaining_wait(now, &mut self.storage);
            if wait == 0 {
                if state.is_sent() {
                    break Status::PENDING;
                }
                if !state.is(Stage::Queued) {
                    break Status::LINK_LOST;
                }
                match self.encode(request, now, stuck, rules) {
                    Status::OK => {
                        wait = request.state().wait;
                        if self.next as u8 == 0 {
                            self.skip_numbers_in_use(&queue.queue);
                        }
                    }
                    Status::BUSY => {
                        self.blocked = true;
                        continue;
                    }
                    refused => break refused,
                }
            }
            least = least.min(wait);
        };
        Some((at - 1, ended))
    }

    /// Advances `next`, a multiple of 256, to the first block of 256 numbers that no request
    /// in flight uses. At most 255 requests are in flight, so there is such a block. The
    /// other 255 numbers of the block then need no search of the queue.
    #[inline(always)]
    fn skip_numbers_in_use<J: ClientRequest>(&mut self, queue: &[J]) {
        // With `any`, a client takes 96 bytes more on an AVR.
        let mut at = 0;
        while let Some(request) = queue.get(at) {
            let state = request.state();
            at += 1;
            if state.is_sent() && state.wire >> 8 == self.next >> 8 {
                self.next = self.next.wrapping_add(256);
                at = 0;
            }
        }
    }

    /// Appends the frame of a request to the transmit buffer. Returns [`Status::BUSY`] if
    /// the request has to wait for others, [`Status::LINE_BUSY`] if the bytes before it are
    /// `stuck`, [`Status::BUFFER_TOO_SMALL`] if the buffer can never hold it.
    fn encode<J: ClientRequest>(
        &mut self,
        request: &mut J,
        now: u32,
        stuck: bool,
        rules: &mut impl Rules,
    ) -> Status {
        if self.in_flight > self.more_in_flight {
            return Status::BUSY;
        }
        let begin = usize::from(self.filled);
        let Some(end) = write_frame(request, self.storage.outgoing(), begin, self.next) else {
            return match begin {
                0 => Status::BUFFER_TOO_SMALL,
                _ if stuck => Status::LINE_BUSY,
                _ => Status::BUSY,
            };
        };
        self.storage.count(Counter::Requests, 1);
        let wait = self.time_of(request.state());
        rules.note_sent(now, wait, &self.settings, request.state());
        let state = request.state_mut();
        state.wire = self.next;
        state.enter(Stage::Sent, now, wait);
        self.filled = end as u16;
        self.next = self.next.wrapping_add(1);
        self.in_flight += 1;
        Status::OK
    }

    /// Microseconds for which a request waits when it was sent.
    #[inline(always)]
    fn time_of(&mut self, state: &RequestState) -> u32 {
        if state.is_answered() {
            state.response_timeout(&self.storage, self.settings.response_timeout.get())
        } else {
            self.settings.turnaround_delay.get()
        }
    }

    /// Writes the transmit buffer to the port; false if the link is lost.
    fn flush<J: ClientRequest, const N: usize>(&mut self, queue: &mut RequestQueue<J, N>) -> bool {
        if self.sent >= self.filled {
            return true;
        }
        let bytes = self.storage.to_send(self.sent, self.filled);
        let sent = self.port.write_count(bytes);
        if sent < 0 {
            return false;
        }
        let sent = sent as u16;
        self.accepts |= sent > 0;
        self.storage.count(Counter::BytesSent, sent.into());
        self.sent += sent;
        if self.sent == self.filled {
            self.sent = 0;
            self.filled = 0;
            queue.changed |= self.blocked;
            self.blocked = false;
        }
        true
    }

    /// Sends the rest of a request that has ended, the only bytes in the transmit buffer.
    /// Returns true if the port accepts none of them: requests that wait for their space
    /// would wait for ever. `None` if the link is lost.
    #[inline(always)]
    fn flush_remainder<J: ClientRequest, const N: usize>(
        &mut self,
        queue: &mut RequestQueue<J, N>,
    ) -> Option<bool> {
        let before = self.sent;
        if !self.flush(queue) {
            return None;
        }
        let stuck = before == self.sent;
        queue.changed |= stuck && self.blocked;
        Some(stuck)
    }

    /// Removes the frame with the transaction identifier `wire` from the transmit buffer, if
    /// none of its bytes were sent. True if the frame was not sent, or only partly.
    #[cold]
    pub(super) fn remove_unsent(&mut self, wire: u16) -> bool {
        let (bytes, mut at) = (self.storage.to_send(0, self.filled), 0);
        while let Some(rest) = bytes.get_mut(at..) {
            let Ok(header) = tcp::header(rest) else {
                break;
            };
            let end = at + header.total;
            if header.transaction != wire {
                at = end;
                continue;
            }
            if at >= usize::from(self.sent) {
                move_to_front(rest, header.total);
                self.filled -= header.total as u16;
                if self.sent == self.filled {
                    self.sent = 0;
                    self.filled = 0;
                }
            }
            return end > usize::from(self.sent);
        }
        false
    }

    /// Counts a request whose time is over, and discards its unsent bytes. Returns its status.
    #[inline(always)]
    fn expire<J: ClientRequest>(&mut self, request: &J) -> Status {
        let state = request.state();
        if !state.is_answered() {
            return Status::OK;
        }
        self.storage.count(Counter::Timeouts, 1);
        if self.remove_unsent(state.wire) {
            if self.accepts {
                Status::LINE_BUSY
            } else {
                Status::CONNECT_TIMED_OUT
            }
        } else if state.is(Stage::OtherUnit) {
            Status::INVALID_SLAVE_ID
        } else {
            Status::RESPONSE_TIMED_OUT
        }
    }

    /// Ends all requests, because the link is lost. Returns the first of them.
    #[cold]
    fn end_all_lost<J: ClientRequest, const N: usize>(
        &mut self,
        queue: &mut RequestQueue<J, N>,
        now: u32,
    ) -> Option<J> {
        self.clear();
        queue.disconnect();
        queue.end(0, Status::LINK_LOST, now, &mut self.storage)
    }
}

/// Writes the frame of any request into `buffer` from the index `begin` on, and returns the index
/// after its end; `None` if there is no space for it.
#[inline(always)]
fn write_frame<J: ClientRequest>(
    request: &J,
    buffer: &mut [u8],
    begin: usize,
    wire: u16,
) -> Option<usize> {
    let state = request.state();
    let length = usize::from(state.request_length());
    let end = begin + tcp::PDU + length;
    let (header, pdu) = buffer.get_mut(begin..end)?.split_first_chunk_mut()?;
    *header = tcp::emit_header(wire, length, state.unit());
    state.emit(pdu, data_of(request));
    Some(end)
}

impl<P: Port, S: ClientStorage, J: ClientRequest> Transport<J> for Tcp<P, S> {
    const HAS_BROADCAST: bool = false;
    const HAS_TRANSACTION_IDS: bool = true;

    type Port = P;
    type Storage = S;

    fn settings(&mut self) -> &mut Settings {
        &mut self.settings
    }

    fn port(&mut self) -> &mut P {
        &mut self.port
    }

    fn storage(&mut self) -> &mut S {
        &mut self.storage
    }

    fn accepted(&mut self, length: u16) -> (&mut P, &[u8]) {
        (&mut self.port, self.storage.to_send(0, length))
    }

    fn advance<const N: usize>(
        &mut self,
        queue: &mut RequestQueue<J, N>,
        now: u32,
        fresh: bool,
    ) -> Option<J> {
        self.advance_by(queue, now, fresh, &mut Strict)
    }

    #[inline(always)]
    fn release(&mut self, request: Option<&J>) {
        let Some(request) = request else {
            return self.clear();
        };
        self.in_flight = self.in_flight.wrapping_sub(1);
        self.remove_unsent(request.state().wire);
    }

    fn is_idle(&self) -> bool {
        self.filled == 0
    }

    fn delay(&mut self, _: u32) -> Option<u32> {
        (self.sent < self.filled).then_some(super::WRITE_RETRY_DELAY)
    }
}
