//! What a client is asked to do: a request, its data, and where the response's
//! data go.

use super::means::Means;
use crate::error::Status;
use crate::pdu::outline::Outline;
use crate::time::elapsed;
use crate::FIRMWARE;

/// Where a request stands.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
#[repr(u8)]
pub(super) enum Stage {
    /// Waits to be sent.
    Queued,
    /// Waits for its response.
    Sent,
    /// Was on its way when the link was lost.
    Lost,
    /// Waits for its response; another unit answered in its place.
    Strayed,
    /// Was given back.
    Ended,
}

/// What the client keeps of a request. The public fields are the caller's: those
/// above `length` are set before the request is queued, the others are read when
/// it has ended.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct Ticket {
    /// Bytes that the response's data may have.
    pub capacity: u16,
    /// The caller's own number for it.
    pub transaction: u16,
    /// Whom it is for.
    pub unit: u8,
    /// [`Status::PENDING`] from being queued to its end, then how it ended.
    pub status: Status,
    /// The raw exception code of the response; 0 if it was none.
    pub exception: u8,
    /// Bytes of data received.
    pub length: u8,
    stage: Stage,
    /// How often it was asked again.
    pub(super) retries: u8,
    /// Its number on the wire, for TCP.
    pub(super) wire: u16,
    /// It is due when `wait` has passed since `since`.
    pub(super) since: u32,
    pub(super) wait: u32,
    /// What is asked.
    pub outline: Outline,
}

impl Ticket {
    /// Nothing asked of nobody.
    pub const NONE: Ticket = Ticket {
        capacity: 0,
        transaction: 0,
        unit: 0,
        status: Status::OK,
        exception: 0,
        length: 0,
        stage: Stage::Queued,
        retries: 0,
        wire: 0,
        since: 0,
        wait: 0,
        outline: Outline::NONE,
    };

    /// The transaction identifier of the TCP frame that it was sent in last; 0 if it was
    /// not sent yet.
    pub const fn wire(&self) -> u16 {
        self.wire
    }

    /// True if a client gave it back and none took it since. False does not tell.
    pub fn has_ended(&self) -> bool {
        self.is(Stage::Ended)
    }

    /// Gives it back.
    pub(super) fn end(&mut self, status: Status) {
        self.stage = Stage::Ended;
        self.status = status;
    }

    pub(super) fn is(&self, stage: Stage) -> bool {
        self.stage == stage
    }

    /// True if its response is waited for.
    pub fn is_sent(&self) -> bool {
        matches!(self.stage, Stage::Sent | Stage::Strayed)
    }

    /// How long it is not due yet.
    #[cfg_attr(target_os = "none", inline(never))]
    #[cfg_attr(not(target_os = "none"), inline(always))]
    pub(super) fn remains(&self, now: u32, means: &mut impl Means) -> u32 {
        let wait = match self.wait {
            0 => 0,
            wait => wait.saturating_sub(elapsed(now, self.since)),
        };
        if self.is(Stage::Queued) {
            wait.max(means.rest(self.unit, now))
        } else {
            wait
        }
    }

    /// Notes that another unit answered in its place.
    pub(super) fn stray(&mut self) {
        self.stage = Stage::Strayed;
    }

    /// Enters a stage at the time `now`, to be looked at again after `wait`.
    pub(super) fn enter(&mut self, stage: Stage, now: u32, wait: u32) {
        self.stage = stage;
        self.since = now;
        self.wait = wait;
    }
}

/// A request that a client is given and gives back when it has ended.
pub trait Job {
    /// What the client keeps of it.
    fn ticket(&self) -> &Ticket;

    /// As [`Job::ticket`].
    fn ticket_mut(&mut self) -> &mut Ticket;

    /// A byte of the data to send, as on the wire.
    fn byte(&self, index: usize) -> u8;

    /// Takes a byte of the response's data, as on the wire. Called for the
    /// indices below [`Ticket::capacity`] only.
    fn put(&mut self, index: usize, byte: u8);

    /// Takes all of the response's data, from the first byte on.
    fn put_all(&mut self, bytes: &[u8]) {
        for (index, byte) in bytes.iter().enumerate() {
            self.put(index, *byte);
        }
    }

    /// True if the response's data are wanted at all.
    fn wants_data(&self) -> bool {
        true
    }
}

/// True if a request that ended so was answered, with data or an exception.
pub(super) fn is_answer(ended: Status) -> bool {
    ended.code() < 0x80
}

/// Hands the data of `pdu`, a complete response, to the job.
#[cfg_attr(not(target_os = "none"), inline(always))]
pub(super) fn deliver<J: Job>(job: &mut J, pdu: &[u8]) -> Status {
    let at = usize::from(job.ticket().outline.data_at());
    match pdu.get(at..) {
        Some(data) if at > 0 => take(job, data),
        _ => Status::OK,
    }
}

/// Hands the data of a response to the job.
#[cfg_attr(not(target_os = "none"), inline(always))]
pub(super) fn take<J: Job>(job: &mut J, data: &[u8]) -> Status {
    if !job.wants_data() {
        return Status::OK;
    }
    let ticket = job.ticket_mut();
    if data.len() > usize::from(ticket.capacity) {
        return Status::BUFFER_TOO_SMALL;
    }
    ticket.length = data.len() as u8;
    let words = ticket.outline.takes_words();
    // The bits behind the last one are zero.
    if FIRMWARE {
        let mask = ticket.outline.mask();
        for (index, byte) in data.iter().enumerate() {
            let is_last = index + 1 == data.len();
            job.put(index, if is_last { *byte & mask } else { *byte });
        }
        return Status::OK;
    }
    job.put_all(data);
    if words {
        return Status::OK;
    }
    let mask = job.ticket().outline.mask();
    if mask != 0xFF {
        if let Some((last, before)) = data.split_last() {
            job.put(before.len(), *last & mask);
        }
    }
    Status::OK
}

/// What gives the bytes of a job to send. (One type, so one function for all who ask.)
pub(super) fn bytes<J: Job>(job: &J) -> impl Fn(usize) -> u8 + '_ {
    |index| job.byte(index)
}
