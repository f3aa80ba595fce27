//! Finds responses in the received bytes of a TCP stream.

use super::Tcp;
use crate::bytes::move_to_front;
use crate::client::job::{data_of, deliver, is_answer, store_data, Job, Stage};
use crate::client::means::Means;
use crate::client::shared::Shared;
use crate::engine::Counter;
use crate::error::Status;
use crate::frame::tcp::{self, Header};
use crate::port::Port;

/// Index of the data in the response frame of a read, after function code and byte count.
const READ_DATA: usize = tcp::PDU + 2;

impl<P: Port, S: Means> Tcp<P, S> {
    /// Moves the bytes that were not searched yet to the start of the buffer.
    #[cold]
    pub(super) fn compact(&mut self) {
        move_to_front(self.means.bytes(0, self.end), self.start.into());
        self.end -= self.start;
        self.start = 0;
    }

    /// As [`Tcp::find`], but finds only the most frequent response: a complete, right one to
    /// the first request in the queue, if that request is a read.
    #[inline]
    pub(super) fn find_read<J: Job, const N: usize>(
        &mut self,
        shared: &mut Shared<J, N>,
        now: u32,
    ) -> Option<J> {
        let job = shared.queue.first_mut()?;
        let ticket = job.ticket();
        let asked = ticket.outline.data_of_read()?;
        let total = READ_DATA + usize::from(asked);
        let begin = usize::from(self.start);
        if usize::from(self.end) - begin < total {
            return None;
        }
        let frame = self.means.slice(self.start, total as u16);
        let (start, rest) = frame.split_first_chunk()?;
        let (count, data) = rest.split_first()?;
        let function = ticket.outline.function();
        if u64::from_be_bytes(*start) != tcp::start(ticket.wire, asked + 2, ticket.unit, function)
            || *count != asked
            || self.skip > 0
            || !ticket.is(Stage::Sent)
            || store_data(job, data) != Status::OK
        {
            return None;
        }
        self.start += total as u16;
        self.answered(shared, 0, Status::OK, now)
    }

    /// Ends the request at the index `at`, which was answered, with `status`.
    #[cfg_attr(not(target_os = "none"), inline(always))]
    fn answered<J: Job, const N: usize>(
        &mut self,
        shared: &mut Shared<J, N>,
        at: usize,
        status: Status,
        now: u32,
    ) -> Option<J> {
        self.astray = false;
        self.flying = self.flying.wrapping_sub(1);
        shared.connected = true;
        if is_answer(status) {
            self.means.count(Counter::Replies, 1);
            if status != Status::OK {
                self.means.count(Counter::Exceptions, 1);
            }
        }
        shared.end(at, status, now, &mut self.means)
    }

    /// Finds the next response in the received bytes. Returns a request that has ended.
    #[cold]
    pub(super) fn find<J: Job, const N: usize>(
        &mut self,
        shared: &mut Shared<J, N>,
        now: u32,
    ) -> Option<J> {
        loop {
            if self.skip > 0 {
                self.skip_frame();
            }
            let room = usize::from(self.means.room());
            let rest = self.means.bytes(self.start, self.end - self.start);
            let header = match tcp::header(rest) {
                Ok(header) => header,
                Err(Status::INCOMPLETE_FRAME) => return None,
                Err(_) => {
                    self.skip_byte();
                    continue;
                }
            };
            let mut jobs = shared.queue.iter_mut().enumerate();
            let asked = jobs.find(|(_, job)| is_answered_by(*job, &header));
            if asked.is_none() && self.astray {
                self.start += 1;
                continue;
            }
            let is_whole = header.total <= rest.len();
            if !is_whole && header.total <= room {
                return None;
            }
            let Some((at, job)) = asked else {
                self.skip = header.total as u16;
                self.note_foreign_frame(shared, &header);
                continue;
            };
            let mut status = Status::BUFFER_TOO_SMALL;
            if is_whole {
                status = judge(job, rest.get(tcp::PDU..header.total).unwrap_or_default());
                if self.astray && !is_answer(status) && status != Status::BUFFER_TOO_SMALL {
                    // These bytes only look like a header.
                    self.start += 1;
                    continue;
                }
            }
            // Bytes of the frame that did not fit are skipped as they arrive.
            self.skip = header.total as u16;
            if let Some(job) = self.answered(shared, at, status, now) {
                return Some(job);
            }
        }
    }

    /// Skips the received bytes of a frame that is finished with.
    #[cold]
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
        if !self.astray {
            self.astray = true;
            self.means.count(Counter::Resynchronisations, 1);
        }
    }

    /// Counts a frame that answers no request. If it has the number of a request, records
    /// there that another unit answered.
    #[cold]
    fn note_foreign_frame<J: Job, const N: usize>(
        &mut self,
        shared: &mut Shared<J, N>,
        header: &Header,
    ) {
        self.means.count(Counter::ForeignFrames, 1);
        for job in shared.queue.iter_mut() {
            let ticket = job.ticket_mut();
            if ticket.is_sent() && ticket.wire == header.transaction {
                ticket.note_other_unit();
            }
        }
    }
}

/// True if a response with this header answers the request.
fn is_answered_by<J: Job>(job: &J, header: &Header) -> bool {
    let ticket = job.ticket();
    ticket.is_sent() && ticket.wire == header.transaction && ticket.unit == header.unit
}

/// Checks the response `pdu` and stores its data in the request. Returns the status of the
/// request.
fn judge<J: Job>(job: &mut J, pdu: &[u8]) -> Status {
    let outline = &job.ticket().outline;
    if outline.is_repeated_by(pdu) {
        return deliver(job, pdu);
    }
    let [function, ..] = *pdu else {
        return Status::MALFORMED_REPLY;
    };
    if function & 0x7F != outline.function() {
        return Status::INVALID_FUNCTION;
    }
    let expected = outline.expected(pdu, pdu.len());
    if expected.map(|length| length.get().into()) != Some(pdu.len()) {
        return Status::MALFORMED_REPLY;
    }
    let status = outline.judge(pdu, data_of(job));
    if let [function, code, ..] = *pdu {
        if function & 0x80 != 0 {
            job.ticket_mut().exception = code;
        }
    }
    match status {
        Status::OK => deliver(job, pdu),
        other => other,
    }
}
