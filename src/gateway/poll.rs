//! One round of the gateway, and the time until the next.

use super::object::Gateway;
use super::state::Stage;
use super::storage::GatewayStorage;
use crate::time;

/// Time until the next poll if only a connection or a unit can bring progress.
const EXTERNAL_POLL_DELAY: u32 = time::millis(1);

impl<S: GatewayStorage> Gateway<S> {
    /// Moves all lines and connections on, without waiting.
    pub fn poll(&mut self) {
        for line in 0..self.storage.line_count() {
            self.collect(line);
        }
        for request in 0..self.storage.request_count() {
            if self.storage.request(request).stage == Stage::Local {
                self.serve(request);
            }
        }
        for connection in 0..self.storage.connection_count() {
            // Sending first makes places free.
            self.send_if_open(connection);
            self.receive(connection);
        }
        for line in 0..self.storage.line_count() {
            self.start(line);
        }
        for connection in 0..self.storage.connection_count() {
            self.send_if_open(connection);
        }
    }

    /// Microseconds until a queued request has waited too long for its line, or long enough for
    /// its unit.
    fn delay_in_queue(&mut self, request: u16) -> u32 {
        let mut delay = u32::MAX;
        if self.queue_time != 0 {
            delay = self.left_in_queue(request);
        }
        let state = self.storage.request(request);
        let (line, unit) = (state.line, state.unit);
        match self.storage.rest(line, unit) {
            0 => delay,
            rest => delay.min(rest),
        }
    }

    fn send_if_open(&mut self, connection: u8) {
        if self.storage.connection_mut(connection).is_open() {
            self.send(connection);
        }
    }

    /// Microseconds for which poll has nothing to do, unless a byte arrives on a line, or on a
    /// connection that it reads. 1000 while a connection does not take a response, and while
    /// a unit of the gateway has not finished.
    pub fn poll_delay(&mut self) -> u32 {
        let mut delay = u32::MAX;
        for line in 0..self.storage.line_count() {
            delay = delay.min(self.storage.line_delay(line));
        }
        for request in 0..self.storage.request_count() {
            let own = match self.storage.request(request).stage {
                // If a response is not sent completely, the connection did not take the rest.
                Stage::Local | Stage::Answered => EXTERNAL_POLL_DELAY,
                Stage::Queued => self.delay_in_queue(request),
                _ => u32::MAX,
            };
            delay = delay.min(own);
        }
        for connection in 0..self.storage.connection_count() {
            // A place for another request became free after the connection was last read.
            if self.storage.connection_mut(connection).is_held && self.may_have_more(connection) {
                delay = 0;
            }
        }
        delay
    }
}
