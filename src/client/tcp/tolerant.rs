//! A TCP stream to a device that deviates from the standard, or that needs time between requests.
//!
//! Some devices answer with another unit than they were asked, or with another transaction
//! identifier: always 0, or a count of their own. The identifier is what tells a late response from
//! the right one. So a response with another one is accepted only by this rule:
//!
//! - One request is in flight, and the response has its function code and answers it: byte count, or
//!   repeated address and value. Any other frame is skipped, and the request goes on.
//! - The device owes no response to an earlier request of this connection. After a request that ended
//!   without an answer it owes one. No request is sent until that response has come, or until two
//!   response timeouts and the quiet time have passed since that request was sent, or until the
//!   connection is a new one: over that no late response can come.
//! - What has arrived before a request is sent is no response to it.

use super::rules::{is_answered_by, validate, Rules};
use super::Tcp;
use crate::client::queue::RequestQueue;
use crate::client::request::{store_response, ClientRequest, RequestState};
use crate::client::storage::ClientStorage;
use crate::client::Transport;
use crate::engine::Settings;
use crate::error::Status;
use crate::frame::tcp::Header;
use crate::port::Port;
use crate::time::{clamped, elapsed, Micros};

/// [`TolerantTcp::set_accept`]: a response of another unit than the request's is accepted.
pub const ACCEPT_UNIT: u8 = 1;
/// [`TolerantTcp::set_accept`]: a response with another transaction identifier is accepted.
pub const ACCEPT_TRANSACTION: u8 = 2;

/// A [`Tcp`] stream with settings for devices that deviate. Without a setting it behaves as [`Tcp`].
///
/// ```
/// # include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/doc/pump.rs"));
/// # fn main() -> Result<(), mbm::Error> {
/// use mbm::client::{BlockingClient, TcpBuffers, TolerantTcp, ACCEPT_UNIT};
///
/// let mut line = TolerantTcp::new(tcp(), TcpBuffers::new([0; 260], [0; 260]));
/// line.set_accept(ACCEPT_UNIT);
/// line.set_lenient(true);
/// // The device needs 20 ms between two requests.
/// line.set_message_wait(20_000);
/// let mut client: BlockingClient<_> = BlockingClient::new(line);
/// assert_eq!(client.holding_registers(17, 107), Ok([555, 100]));
/// # Ok(())
/// # }
/// ```
#[repr(C)]
#[derive(Debug)]
pub struct TolerantTcp<P, S> {
    /// The stream.
    pub tcp: Tcp<P, S>,
    tolerance: Tolerance,
}

/// The settings, and what they need to know.
#[repr(C)]
#[derive(Debug)]
struct Tolerance {
    /// [`ACCEPT_UNIT`] and [`ACCEPT_TRANSACTION`].
    accept: u8,
    is_lenient: bool,
    /// A request was sent, and no answer has come since.
    is_owed: bool,
    /// The message wait may not be over.
    is_pausing: bool,
    /// The least time from the end of a request to the next one.
    message_wait: Micros,
    /// When the last request was sent, and for how long a late response to it may come.
    sent: Micros,
    owed_for: Micros,
    /// When the last request ended.
    ended: Micros,
}

impl<P, S> TolerantTcp<P, S> {
    /// A stream that is open or will be opened.
    pub const fn new(port: P, storage: S) -> Self {
        TolerantTcp {
            tcp: Tcp::new(port, storage),
            tolerance: Tolerance {
                accept: 0,
                is_lenient: false,
                is_owed: false,
                is_pausing: false,
                message_wait: 0,
                sent: 0,
                owed_for: 0,
                ended: 0,
            },
        }
    }

    /// Sets which responses are accepted that deviate in their header: [`ACCEPT_UNIT`],
    /// [`ACCEPT_TRANSACTION`], both or 0. False, with nothing changed, for any other number, and for
    /// [`ACCEPT_TRANSACTION`] if more than one request may be in flight.
    pub fn set_accept(&mut self, accept: u8) -> bool {
        let is_single = accept & ACCEPT_TRANSACTION != 0 || self.tolerance.message_wait > 0;
        let is_allowed = accept <= ACCEPT_UNIT | ACCEPT_TRANSACTION && self.set_single(is_single);
        if is_allowed {
            self.tolerance.accept = accept;
        }
        is_allowed
    }

    /// Sets whether a response is accepted that has more data than was requested, of which the first
    /// count, or that repeats another address or value than a write.
    pub fn set_lenient(&mut self, is_lenient: bool) {
        self.tolerance.is_lenient = is_lenient;
    }

    /// Sets the least time from the end of a request to the next one, in microseconds. False, with
    /// nothing changed, if it is not 0 and more than one request may be in flight.
    pub fn set_message_wait(&mut self, wait: u32) -> bool {
        let is_single = wait > 0 || self.tolerance.accept & ACCEPT_TRANSACTION != 0;
        let is_allowed = self.set_single(is_single);
        if is_allowed {
            self.tolerance.message_wait = clamped(wait);
        }
        is_allowed
    }

    /// Allows one request in flight only. False if more are allowed already.
    fn set_single(&mut self, is_single: bool) -> bool {
        let is_allowed = !is_single || self.tcp.more_in_flight == 0;
        if is_allowed {
            self.tcp.is_single = is_single;
        }
        is_allowed
    }
}

impl Tolerance {
    fn accepts(&self, what: u8) -> bool {
        self.accept & what != 0
    }
}

impl Rules for Tolerance {
    fn matches(&self, state: &RequestState, header: &Header) -> bool {
        let has_unit = self.accepts(ACCEPT_UNIT) || state.unit() == header.unit;
        let has_transaction =
            self.accepts(ACCEPT_TRANSACTION) || state.wire() == header.transaction;
        state.is_sent() && has_unit && has_transaction
    }

    fn validate<J: ClientRequest>(&self, request: &mut J, pdu: &mut [u8]) -> Status {
        let status = validate(request, pdu);
        if status != Status::MALFORMED_REPLY || !self.is_lenient {
            return status;
        }
        let counts = request.state().counted_length(pdu).into();
        match pdu.get(..counts) {
            Some(pdu) if counts > 0 => store_response(request, pdu),
            _ => status,
        }
    }

    fn is_doubtful(&self, state: &RequestState, header: &Header) -> bool {
        !is_answered_by(state, header)
    }

    fn reads_first(&self) -> bool {
        self.accepts(ACCEPT_TRANSACTION)
    }

    fn rest(&mut self, now: u32) -> u32 {
        let owed = match self.accepts(ACCEPT_TRANSACTION) && self.is_owed {
            true => self.owed_for.saturating_sub(elapsed(now, self.sent)),
            false => 0,
        };
        let pause = match self.is_pausing {
            true => self.message_wait.saturating_sub(elapsed(now, self.ended)),
            false => 0,
        };
        // Once a time is over, it stays so when the clock wraps.
        self.is_owed &= owed > 0;
        self.is_pausing &= pause > 0;
        owed.max(pause)
    }

    fn is_single(&self) -> bool {
        self.accepts(ACCEPT_TRANSACTION) || self.message_wait > 0
    }

    fn note_sent(&mut self, now: u32, timeout: u32, settings: &Settings, state: &RequestState) {
        self.is_owed = state.is_answered();
        self.sent = now;
        let silence = timeout.saturating_mul(2);
        self.owed_for = clamped(silence.saturating_add(settings.quiet_time.get()));
    }

    fn note_frame(&mut self) -> bool {
        core::mem::take(&mut self.is_owed)
    }

    fn note_end(&mut self, now: u32) {
        self.is_pausing = self.message_wait > 0;
        self.ended = now;
    }
}

impl<P: Port, S: ClientStorage, J: ClientRequest> Transport<J> for TolerantTcp<P, S> {
    const HAS_BROADCAST: bool = <Tcp<P, S> as Transport<J>>::HAS_BROADCAST;
    const HAS_TRANSACTION_IDS: bool = <Tcp<P, S> as Transport<J>>::HAS_TRANSACTION_IDS;

    type Port = P;
    type Storage = S;

    fn settings(&mut self) -> &mut Settings {
        &mut self.tcp.settings
    }

    fn port(&mut self) -> &mut P {
        &mut self.tcp.port
    }

    fn storage(&mut self) -> &mut S {
        &mut self.tcp.storage
    }

    fn accepted(&mut self, length: u16) -> (&mut P, &[u8]) {
        Transport::<J>::accepted(&mut self.tcp, length)
    }

    fn advance<const N: usize>(
        &mut self,
        queue: &mut RequestQueue<J, N>,
        now: u32,
        fresh: bool,
    ) -> Option<J> {
        self.tcp.advance_by(queue, now, fresh, &mut self.tolerance)
    }

    fn note_sent_late(&mut self, now: u32) {
        self.tolerance.sent = now;
    }

    fn release(&mut self, request: Option<&J>) {
        if request.is_none() {
            // Over a new connection no late response comes.
            self.tolerance.is_owed = false;
        }
        Transport::<J>::release(&mut self.tcp, request);
    }

    fn is_idle(&self) -> bool {
        Transport::<J>::is_idle(&self.tcp)
    }

    fn delay(&mut self, now: u32) -> Option<u32> {
        Transport::<J>::delay(&mut self.tcp, now)
    }
}
