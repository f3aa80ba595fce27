//! Requests arrive on their connections, and responses leave.

use super::object::{Gateway, PATH_UNAVAILABLE};
use super::route::{Route, ALL_LINES, LOCAL};
use super::state::{Stage, NONE};
use super::storage::GatewayStorage;
use crate::error::{Error, Status};
use crate::frame::tcp;

/// Most reads of a connection in one poll, so that a client whose requests need no response
/// does not hold up the others.
const MOST_READS: u8 = 64;

/// Bytes of the shortest frame. The gateway reads them first, and then up to the end of the
/// frame, so that no bytes of the next frame arrive.
const SHORTEST: u16 = tcp::PDU as u16 + 1;

impl<S: GatewayStorage> Gateway<S> {
    /// Reads requests from an open connection, until it has no more bytes or no place for them.
    pub(super) fn receive(&mut self, connection: u8) {
        self.storage.connection_mut(connection).is_held = false;
        for _ in 0..MOST_READS {
            if !self.storage.connection_mut(connection).is_open() {
                return;
            }
            let Some(request) = self.place(connection) else {
                self.storage.connection_mut(connection).is_held = true;
                return;
            };
            let have = self.storage.request(request).length;
            let until = self.total(request, have).max(SHORTEST);
            match self.storage.read(connection, request, have, until) {
                0 => {
                    if have == 0 {
                        // Another connection may need the place.
                        self.storage.connection_mut(connection).receiving = NONE;
                        self.release(request);
                    }
                    return;
                }
                ..0 => self.lose(connection, Status::LINK_LOST),
                count => self.take_bytes(connection, request, have.saturating_add(count as u16)),
            }
        }
    }

    /// Length of the frame whose first `have` bytes have arrived; 0 if it is not known yet.
    fn total(&mut self, request: u16, have: u16) -> u16 {
        let bytes = self.storage.frame(request).get(..have.into());
        match tcp::header(bytes.unwrap_or_default()) {
            Ok(header) => header.total as u16,
            Err(_) => 0,
        }
    }

    /// The place for the request that arrives on a connection.
    fn place(&mut self, connection: u8) -> Option<u16> {
        let receiving = self.storage.connection(connection).receiving;
        if receiving < self.storage.request_count() {
            return Some(receiving);
        }
        if !self.may_have_more(connection) {
            return None;
        }
        for request in 0..self.storage.request_count() {
            let state = self.storage.request(request);
            if state.stage == Stage::Free {
                state.stage = Stage::Receiving;
                state.connection = connection;
                state.length = 0;
                let state = self.storage.connection_mut(connection);
                state.receiving = request;
                state.requests = state.requests.saturating_add(1);
                return Some(request);
            }
        }
        None
    }

    /// Takes the bytes of a frame. The first `have` bytes are there now.
    fn take_bytes(&mut self, connection: u8, request: u16, have: u16) {
        self.storage.request(request).length = have;
        let bytes = self.storage.frame(request).get(..have.into());
        match tcp::header(bytes.unwrap_or_default()) {
            Ok(header) if have >= header.total as u16 => {
                self.storage.connection_mut(connection).receiving = NONE;
                self.route(connection, request, header.unit);
            }
            Err(Error::MalformedFrame) => self.lose(connection, Status::MALFORMED_FRAME),
            _ => {}
        }
    }

    /// Sends a complete request to the line or unit of its unit id.
    fn route(&mut self, connection: u8, request: u16, unit: u8) {
        let Some(to) = Route::find(self.storage.routes(), unit) else {
            return self.refuse(request, PATH_UNAVAILABLE);
        };
        let order = self.next_order();
        let since = match self.queue_time {
            0 => 0,
            _ => self.storage.now(connection),
        };
        let lines = self.storage.line_count();
        let state = self.storage.request(request);
        state.unit = to.unit;
        state.order = order;
        state.since = since;
        state.is_for_all = to.line == ALL_LINES;
        state.line = if state.is_for_all { 0 } else { to.line };
        if to.line == LOCAL {
            state.stage = Stage::Local;
            self.serve(request);
        } else if lines == 0 {
            // A broadcast, but there is no line.
            self.release(request);
        } else {
            state.stage = Stage::Queued;
        }
    }

    /// Lets the gateway's own units serve a request, again until they have finished.
    pub(super) fn serve(&mut self, request: u16) {
        let state = self.storage.request(request);
        let (connection, unit, length) = (state.connection, state.unit, state.length);
        let unit_on_tcp = self.replace_unit(request, unit);
        let response = self.storage.serve(connection, request, length);
        self.replace_unit(request, unit_on_tcp);
        match response {
            None => {}
            Some(0) => self.release(request),
            Some(length) => self.set_response(request, length),
        }
    }

    /// Writes a unit id into a frame. Returns the one that was there.
    fn replace_unit(&mut self, request: u16, unit: u8) -> u8 {
        let place = self.storage.frame(request).get_mut(tcp::HEADER);
        place.map_or(0, |place| core::mem::replace(place, unit))
    }
}

impl<S: GatewayStorage> Gateway<S> {
    /// Sends the responses of a connection, until there are no more or the connection takes
    /// no more bytes.
    pub(super) fn send(&mut self, connection: u8) {
        while let Some(request) = self.next_response(connection) {
            self.storage.connection_mut(connection).sending = request;
            let state = self.storage.request(request);
            let (sent, length) = (state.sent, state.length);
            let count = self.storage.write(connection, request, sent, length);
            if count < 0 {
                return self.lose(connection, Status::LINK_LOST);
            }
            let sent = sent.saturating_add(count as u16);
            self.storage.request(request).sent = sent;
            if sent < length {
                return;
            }
            self.storage.connection_mut(connection).sending = NONE;
            self.release(request);
        }
    }

    /// The response of a connection to send next: one that was sent in part, else the one that
    /// was known first.
    fn next_response(&mut self, connection: u8) -> Option<u16> {
        let sending = self.storage.connection(connection).sending;
        if sending < self.storage.request_count() {
            return Some(sending);
        }
        let mut found: Option<(u32, u16)> = None;
        for request in 0..self.storage.request_count() {
            let state = *self.storage.request(request);
            let is_older = |(order, _): (u32, u16)| order.wrapping_sub(state.order) as i32 > 0;
            if state.stage == Stage::Answered
                && state.connection == connection
                && found.is_none_or(is_older)
            {
                found = Some((state.order, request));
            }
        }
        found.map(|(_, request)| request)
    }
}
