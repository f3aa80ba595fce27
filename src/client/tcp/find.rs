//! Finds responses in the received bytes of a TCP stream.

use super::rules::Rules;
use super::Tcp;
use crate::bytes::move_to_front;
use crate::client::queue::RequestQueue;
use crate::client::request::{is_answer, ClientRequest};
use crate::client::storage::ClientStorage;
use crate::engine::Counter;
use crate::error::{Error, Status};
use crate::frame::tcp;
use crate::port::Port;

impl<P: Port, S: ClientStorage> Tcp<P, S> {
    /// Moves the bytes that were not searched yet to the start of the buffer.
    #[cold]
    pub(super) fn compact(&mut self) {
        move_to_front(self.storage.bytes(0, self.end), self.start.into());
        self.end -= self.start;
        self.start = 0;
    }

    /// Ends the request at the index `at`, which was answered, with `status`.
    #[inline(always)]
    fn end_answered<J: ClientRequest, const N: usize>(
        &mut self,
        queue: &mut RequestQueue<J, N>,
        at: usize,
        status: Status,
        now: u32,
    ) -> Option<J> {
        self.resyncing = false;
        self.in_flight = self.in_flight.wrapping_sub(1);
        if self.sent < self.filled {
            // The bytes that wait for the port may be this request: the response is a false one.
            self.remove_unsent(queue.queue.get(at)?.state().wire);
        }
        queue.note_answered(self.in_flight);
        if is_answer(status) {
            self.storage.count(Counter::Replies, 1);
            if status != Status::OK {
                self.storage.count(Counter::Exceptions, 1);
            }
        }
        queue.end(at, status, now, &mut self.storage)
    }

    /// Finds the next response in the received bytes. Returns a request that has ended.
    #[cold]
    pub(super) fn find<J: ClientRequest, const N: usize>(
        &mut self,
        queue: &mut RequestQueue<J, N>,
        now: u32,
        rules: &mut impl Rules,
    ) -> Option<J> {
        loop {
            if self.skip > 0 {
                self.skip_frame();
            }
            let space = usize::from(self.storage.capacity());
            let rest = self.storage.bytes(self.start, self.end - self.start);
            let header = match tcp::header(rest) {
                Ok(header) => header,
                Err(Error::IncompleteFrame) => return None,
                Err(_) => {
                    self.skip_byte();
                    continue;
                }
            };
            let mut requests = queue.queue.iter_mut().enumerate();
            let asked = requests.find(|(_, request)| rules.matches(request.state(), &header));
            if asked.is_none() && self.resyncing {
                self.start += 1;
                continue;
            }
            let is_whole = header.total <= rest.len();
            if !is_whole && header.total <= space {
                return None;
            }
            let Some((at, request)) = asked else {
                if self.in_flight == 0 {
                    queue.changed |= rules.note_frame();
                }
                self.skip = header.total as u16;
                self.note_foreign_frame(queue, header.transaction);
                continue;
            };
            let mut status = Status::BUFFER_TOO_SMALL;
            if is_whole {
                let pdu = rest.get_mut(tcp::PDU..header.total);
                status = rules.validate(request, pdu.unwrap_or_default());
                if self.resyncing && !is_answer(status) && status != Status::BUFFER_TOO_SMALL {
                    // These bytes only look like a header.
                    self.start += 1;
                    continue;
                }
            }
            // Bytes of the frame that did not fit are skipped as they arrive.
            self.skip = header.total as u16;
            let fits = is_whole && (is_answer(status) || status == Status::BUFFER_TOO_SMALL);
            if !fits && rules.is_doubtful(request.state(), &header) {
                self.note_foreign_frame(queue, header.transaction);
                continue;
            }
            self.skip_frame();
            queue.changed |= rules.note_frame();
            rules.note_end(now);
            if let Some(request) = self.end_answered(queue, at, status, now) {
                return Some(request);
            }
        }
    }

    /// Skips the received bytes of a frame that is finished with.
    #[cfg_attr(target_os = "none", inline(never))]
    fn skip_frame(&mut self) {
        let skipped = self.skip.min(self.end - self.start);
        self.start += skipped;
        self.skip -= skipped;
    }

    /// Skips one byte that does not begin a frame, and notes that the frame boundaries are
    /// lost.
    #[cold]
    pub(super) fn skip_byte(&mut self) {
        self.start += 1;
        if !self.resyncing {
            self.resyncing = true;
            self.storage.count(Counter::Resynchronisations, 1);
        }
    }

    /// Counts a frame that answers no request. If it has the number of a request, records
    /// there that another unit answered.
    #[inline(always)]
    fn note_foreign_frame<J: ClientRequest, const N: usize>(
        &mut self,
        queue: &mut RequestQueue<J, N>,
        transaction: u16,
    ) {
        self.storage.count(Counter::ForeignFrames, 1);
        for request in queue.queue.iter_mut() {
            let state = request.state_mut();
            if state.is_sent() && state.wire == transaction {
                state.note_other_unit();
            }
        }
    }
}
