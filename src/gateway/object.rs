//! The gateway object, and what becomes of its requests.

use super::state::{LineState, Stage, NONE};
use super::storage::GatewayStorage;
use crate::error::Status;
use crate::frame::tcp;
use crate::pdu::EXCEPTION;
use crate::time::{self, Micros};

/// Index of the function code in a frame.
pub(super) const FUNCTION: usize = tcp::PDU;

/// The exception for a request that the gateway cannot pass on (V1.1b3, 7).
pub(super) const PATH_UNAVAILABLE: u8 = 0x0A;
/// The exception for a request that the device did not answer (V1.1b3, 7).
pub(super) const TARGET_FAILED: u8 = 0x0B;

/// A gateway.
///
/// ```
/// use mbm::gateway::{Gateway, GatewayStorage};
/// use mbm::Status;
///
/// // `GatewayStorage` shows a storage.
/// fn step<S: GatewayStorage>(gateway: &mut Gateway<S>, is_new: bool) -> u32 {
///     if is_new {
///         gateway.open(0);
///     }
///     gateway.poll();
///     if gateway.status(0) != Status::OK {
///         gateway.close(0);
///     }
///     let is_busy = gateway.pending(0) > 0 || !gateway.is_reading(0);
///     if is_busy { 0 } else { gateway.poll_delay() }
/// }
///
/// fn begin<S: GatewayStorage>(storage: S) -> Gateway<S> {
///     let mut gateway = Gateway::new(storage);
///     gateway.set_max_pending(4);
///     gateway.set_queue_time(2_000_000);
///     gateway.reset();
///     gateway
/// }
/// ```
#[repr(C)]
#[derive(Debug)]
pub struct Gateway<S> {
    /// The number that the next request or response gets in the order.
    pub(super) order: u32,
    /// How long a request may wait for its line, in microseconds; 0 for ever.
    pub(super) queue_time: Micros,
    /// The most requests of one connection.
    pub(super) most: u16,
    /// The caller's memory, connections, lines and units.
    pub storage: S,
}

impl<S: GatewayStorage> Gateway<S> {
    /// A gateway that has no connection yet. The storage may be used before.
    pub fn new(storage: S) -> Self {
        let mut gateway = Gateway {
            order: 0,
            queue_time: 0,
            most: u16::MAX,
            storage,
        };
        gateway.reset();
        gateway
    }

    /// Sets all that the gateway keeps to its first state. No line may have a request.
    pub fn reset(&mut self) {
        (self.order, self.queue_time, self.most) = (0, 0, u16::MAX);
        for request in 0..self.storage.request_count() {
            self.storage.request(request).stage = Stage::Free;
        }
        for connection in 0..self.storage.connection_count() {
            let state = self.storage.connection_mut(connection);
            state.clear(false, Status::OK);
        }
        for line in 0..self.storage.line_count() {
            *self.storage.line(line) = LineState::NEW;
        }
    }

    /// Sets how many requests of one connection may be pending, at least 1.
    pub fn set_max_pending(&mut self, most: u16) {
        self.most = most;
    }

    /// Sets how long a request may wait for its line, in microseconds; 0 for ever.
    pub fn set_queue_time(&mut self, microseconds: u32) {
        self.queue_time = time::clamped(microseconds);
    }

    /// Serves the connection that the storage has at this place from now on.
    pub fn open(&mut self, connection: u8) {
        self.storage
            .connection_mut(connection)
            .clear(true, Status::OK);
    }

    /// Gives up a connection and its requests. Its place is free then.
    pub fn close(&mut self, connection: u8) {
        self.lose(connection, Status::OK);
    }

    /// [`Status::OK`] while the connection is open; [`Status::LINK_LOST`] or
    /// [`Status::MALFORMED_FRAME`] if the gateway has given it up;
    /// [`Status::NOT_INITIALISED`] for a free place.
    pub fn status(&self, connection: u8) -> Status {
        let state = self.storage.connection(connection);
        match state.end {
            _ if state.is_open => Status::OK,
            Status::OK => Status::NOT_INITIALISED,
            lost => lost,
        }
    }

    /// How many requests of a connection are complete and not answered yet.
    pub fn pending(&self, connection: u8) -> u16 {
        let state = self.storage.connection(connection);
        let receiving = u16::from(state.receiving != NONE);
        state.requests.saturating_sub(receiving)
    }

    /// True if the next poll reads bytes from a connection. Otherwise it has as many pending
    /// requests as it may have.
    pub fn is_reading(&self, connection: u8) -> bool {
        let state = *self.storage.connection(connection);
        state.is_open() && (state.receiving != NONE || self.may_have_more(connection))
    }

    /// True if a connection may have another request. Each place for a connection keeps one
    /// place for a request, so that no client takes all of them.
    pub(super) fn may_have_more(&self, connection: u8) -> bool {
        let own = self.storage.connection(connection).requests;
        let (mut free, mut kept) = (self.storage.request_count(), 0);
        for other in 0..self.storage.connection_count() {
            let requests = self.storage.connection(other).requests;
            free = free.saturating_sub(requests);
            kept += u16::from(requests == 0);
        }
        own < self.most && free > 0 && (own == 0 || free > kept)
    }

    /// Gives up a connection and its requests. `status` says why, [`Status::OK`] if the caller
    /// wants it.
    pub(super) fn lose(&mut self, connection: u8, status: Status) {
        for request in 0..self.storage.request_count() {
            let state = *self.storage.request(request);
            if state.stage == Stage::Free || state.connection != connection {
                continue;
            }
            if let Some(line) = state
                .line()
                .filter(|line| *line < self.storage.line_count())
            {
                self.storage.cancel(line, request);
            }
            self.storage.request(request).stage = Stage::Free;
        }
        self.storage.connection_mut(connection).clear(false, status);
    }

    /// The connection of a request. It is checked, because the caller may let two gateways use
    /// the same requests: then one finds the number that the other wrote.
    pub(super) fn connection_of(&mut self, request: u16) -> u8 {
        let last = self.storage.connection_count().saturating_sub(1);
        self.storage.request(request).connection.min(last)
    }

    /// The next number in the order of requests and responses.
    pub(super) fn next_order(&mut self) -> u32 {
        self.order = self.order.wrapping_add(1);
        self.order
    }

    /// Frees the place of a request.
    pub(super) fn release(&mut self, request: u16) {
        self.storage.request(request).stage = Stage::Free;
        let connection = self.connection_of(request);
        let state = self.storage.connection_mut(connection);
        state.requests = state.requests.saturating_sub(1);
    }

    /// Answers a request with an exception.
    pub(super) fn refuse(&mut self, request: u16, code: u8) {
        if let Some([function, data]) = self.storage.frame(request).get_mut(FUNCTION..FUNCTION + 2)
        {
            *function |= EXCEPTION;
            *data = code;
        }
        self.answer(request, 2);
    }

    /// Answers a request with the PDU of `length` bytes in its frame. The header of the frame
    /// still has transaction identifier and unit id of the request.
    pub(super) fn answer(&mut self, request: u16, length: u16) {
        if let Some(place) = self.storage.frame(request).get_mut(4..6) {
            place.copy_from_slice(&tcp::length(length.into()));
        }
        self.set_response(request, length + tcp::PDU as u16);
    }

    /// Notes that the frame of a request has its response now, of `length` bytes.
    pub(super) fn set_response(&mut self, request: u16, length: u16) {
        let order = self.next_order();
        let state = self.storage.request(request);
        state.stage = Stage::Answered;
        state.length = length;
        state.sent = 0;
        state.order = order;
    }
}
