//! Responses leave.

use super::object::Gateway;
use super::state::{Stage, NONE};
use super::storage::GatewayStorage;
use crate::error::Status;

impl<S: GatewayStorage> Gateway<S> {
    /// Sends the responses of a connection, until there are no more or the connection takes
    /// no more bytes.
    pub(super) fn send(&mut self, connection: u8) {
        self.storage.connection(connection).is_blocked = false;
        while let Some(request) = self.next_response(connection) {
            self.storage.connection(connection).sending = request;
            let state = self.storage.request(request);
            let (sent, length) = (state.sent, state.length);
            let count = self.storage.write(connection, request, sent, length);
            if count < 0 {
                return self.lose(connection, Status::LINK_LOST);
            }
            let sent = sent.saturating_add(count as u16);
            self.storage.request(request).sent = sent;
            if sent < length {
                self.storage.connection(connection).is_blocked = true;
                return;
            }
            self.storage.connection(connection).sending = NONE;
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
