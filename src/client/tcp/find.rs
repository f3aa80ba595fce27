//! Finding responses among what arrived.

use super::Tcp;
use crate::bytes::move_to_front;
use crate::client::job::{bytes, deliver, is_answer, take, Job, Stage};
use crate::client::means::Means;
use crate::client::shared::Shared;
use crate::engine::Counter;
use crate::error::Status;
use crate::frame::tcp::{self, Header};
use crate::port::Port;

/// Where the data stand in a frame that answers a read: behind function code and
/// byte count.
const READ_DATA: usize = tcp::PDU + 2;

impl<P: Port, S: Means> Tcp<P, S> {
    /// Moves what was not looked at yet to the start of the buffer.
    #[cold]
    pub(super) fn gather(&mut self) {
        move_to_front(self.means.bytes(0, self.end), self.start.into());
        self.end -= self.start;
        self.start = 0;
    }

    /// As [`Tcp::find`], of what is there most often: the whole and right response
    /// to a read, which is the first request.
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
            || take(job, data) != Status::OK
        {
            return None;
        }
        self.start += total as u16;
        self.answered(shared, 0, Status::OK, now)
    }

    /// A request was answered: what becomes of it.
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

    /// Finds the next response among what arrived; gives back a job that ended.
    #[cold]
    pub(super) fn find<J: Job, const N: usize>(
        &mut self,
        shared: &mut Shared<J, N>,
        now: u32,
    ) -> Option<J> {
        loop {
            if self.skip > 0 {
                self.pass();
            }
            let room = usize::from(self.means.room());
            let rest = self.means.bytes(self.start, self.end - self.start);
            let header = match tcp::header(rest) {
                Ok(header) => header,
                Err(Status::INCOMPLETE_FRAME) => return None,
                Err(_) => {
                    self.stray();
                    continue;
                }
            };
            let mut jobs = shared.queue.iter_mut().enumerate();
            let asked = jobs.find(|(_, job)| answers(*job, &header));
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
                self.note(shared, &header);
                continue;
            };
            let mut status = Status::BUFFER_TOO_SMALL;
            if is_whole {
                status = judge(job, rest.get(tcp::PDU..header.total).unwrap_or_default());
                if self.astray && !is_answer(status) && status != Status::BUFFER_TOO_SMALL {
                    // It only looked like that.
                    self.start += 1;
                    continue;
                }
            }
            // What does not fit is passed over as it arrives.
            self.skip = header.total as u16;
            if let Some(job) = self.answered(shared, at, status, now) {
                return Some(job);
            }
        }
    }

    /// Passes over what is left of a frame that is known already.
    #[cold]
    fn pass(&mut self) {
        let skipped = self.skip.min(self.end - self.start);
        self.start += skipped;
        self.skip -= skipped;
    }

    /// Passes over a byte that begins no frame.
    #[cold]
    pub(super) fn stray(&mut self) {
        self.start += 1;
        if !self.astray {
            self.astray = true;
            self.means.count(Counter::Resynchronisations, 1);
        }
    }

    /// Notes that nobody, or another unit, answered a request of ours.
    #[cold]
    fn note<J: Job, const N: usize>(&mut self, shared: &mut Shared<J, N>, header: &Header) {
        self.means.count(Counter::ForeignFrames, 1);
        for job in shared.queue.iter_mut() {
            let ticket = job.ticket_mut();
            if ticket.is_sent() && ticket.wire == header.transaction {
                ticket.stray();
            }
        }
    }
}

fn answers<J: Job>(job: &J, header: &Header) -> bool {
    let ticket = job.ticket();
    ticket.is_sent() && ticket.wire == header.transaction && ticket.unit == header.unit
}

/// What the response `pdu` says to the job, which takes its data.
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
    let status = outline.judge(pdu, bytes(job));
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
