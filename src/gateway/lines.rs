//! Requests wait for their line, go to it, and end there.

use super::object::{Gateway, PATH_UNAVAILABLE, TARGET_FAILED};
use super::state::Stage;
use super::storage::{GatewayStorage, RequestResult, NO_RESPONSE};
use crate::error::Status;
use crate::time::elapsed;

impl<S: GatewayStorage> Gateway<S> {
    /// Moves the requests of a line on, and answers those that have ended.
    pub(super) fn collect(&mut self, line: u8) {
        let status = self.storage.poll_line(line);
        for request in 0..self.storage.request_count() {
            if self.storage.request(request).line() != Some(line) {
                continue;
            }
            let mut result = self.storage.result(request);
            if result.status == Status::PENDING {
                if status == Status::PENDING || status == Status::BUSY {
                    continue;
                }
                // The line was begun anew, or is no line any more.
                result.status = Status::CANCELLED;
            }
            self.end(request, result);
        }
    }

    /// Answers a request that has ended on its line.
    fn end(&mut self, request: u16, result: RequestResult) {
        let is_for_all = self.storage.request(request).is_for_all;
        match result.status {
            Status::OK if result.length == NO_RESPONSE => self.end_broadcast(request),
            _ if is_for_all => self.end_broadcast(request),
            Status::OK => self.answer(request, result.length + 1),
            _ if result.exception != 0 => self.refuse(request, result.exception),
            Status::LINK_LOST
            | Status::CONNECT_TIMED_OUT
            | Status::LINE_BUSY
            | Status::CANCELLED => {
                self.refuse(request, PATH_UNAVAILABLE);
            }
            _ => self.refuse(request, TARGET_FAILED),
        }
    }

    /// Ends a broadcast, which has no response (serial line guide V1.02, 2.1), or sends it to
    /// the next line.
    fn end_broadcast(&mut self, request: u16) {
        let (order, lines) = (self.next_order(), self.storage.line_count());
        let state = self.storage.request(request);
        let next = state.line.saturating_add(1);
        if !state.is_for_all || next >= lines {
            return self.release(request);
        }
        state.line = next;
        state.stage = Stage::Queued;
        state.order = order;
    }

    /// Gives requests that wait to a line, as many as it may have.
    pub(super) fn start(&mut self, line: u8) {
        while let Some(request) = self.next(line) {
            if !self.storage.is_ready(line) {
                self.give_back(request);
                continue;
            }
            let state = self.storage.request(request);
            let body = state.length.saturating_sub(S::BODY as u16);
            let (unit, connection) = (state.unit, state.connection);
            self.storage.line(line).last = connection;
            match self.storage.forward(line, request, unit, body) {
                Status::PENDING => self.storage.request(request).stage = Stage::OnLine,
                // A unit that stands for all units does not offer this function.
                Status::BROADCAST_NOT_ALLOWED => {
                    self.refuse(request, Status::ILLEGAL_FUNCTION.code());
                }
                refused if refused.code() <= Status::ILLEGAL_DATA_VALUE.code() => {
                    self.refuse(request, refused.code());
                }
                _ => self.give_back(request),
            }
        }
    }

    /// Answers a request that its line does not take. A broadcast to all lines goes on to the
    /// next one instead.
    fn give_back(&mut self, request: u16) {
        if self.storage.request(request).is_for_all {
            return self.end_broadcast(request);
        }
        self.refuse(request, PATH_UNAVAILABLE);
    }

    /// The request that goes to a line next; `None` if no request waits for it, or if it has
    /// as many as it may have. The connections take turns, and the oldest request of a
    /// connection is the first. Answers requests that have waited too long.
    ///
    /// A request whose unit is left alone for a while is not counted, so that the line is free
    /// for other units. The line takes such requests too, as long as it has places left,
    /// because it reads received bytes only while it has requests.
    fn next(&mut self, line: u8) -> Option<u16> {
        let last = self.storage.line(line).last;
        let mut left = self.storage.line_depth(line);
        let mut places = self.storage.line_places(line).saturating_sub(left);
        for request in 0..self.storage.request_count() {
            let state = *self.storage.request(request);
            if state.line == line && state.stage == Stage::OnLine {
                let rests = self.storage.rest(line, state.unit) > 0;
                let count = if rests { &mut places } else { &mut left };
                *count = count.saturating_sub(1);
            }
        }
        let mut found: Option<(u8, u16)> = None;
        for request in 0..self.storage.request_count() {
            let state = *self.storage.request(request);
            if state.line != line || state.stage != Stage::Queued {
                continue;
            }
            if self.queue_time != 0 && self.left_in_queue(request) == 0 {
                self.give_back(request);
                continue;
            }
            let has_place = match self.storage.rest(line, state.unit) {
                0 => left > 0,
                _ => places > 0,
            };
            if !has_place {
                continue;
            }
            // 0 is the connection after the one that had the last turn.
            let turn = state.connection.wrapping_sub(last).wrapping_sub(1);
            let is_first = match found {
                None => true,
                Some((best, _)) if turn != best => turn < best,
                Some((_, other)) => {
                    let age = self.storage.request(other).order.wrapping_sub(state.order);
                    age as i32 > 0
                }
            };
            if is_first {
                found = Some((turn, request));
            }
        }
        found.map(|(_, request)| request)
    }

    /// Microseconds for which a request may still wait for its line.
    pub(super) fn left_in_queue(&mut self, request: u16) -> u32 {
        let connection = self.connection_of(request);
        let now = self.storage.now(connection);
        let since = self.storage.request(request).since;
        self.queue_time.saturating_sub(elapsed(now, since))
    }
}
