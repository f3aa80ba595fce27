//! A client's TCP stream: many requests at once, told apart by the number in
//! their header.

use super::job::{deliver, Job, Stage};
use super::shared::Shared;
use super::units::Means;
use super::Line;
use crate::error::Status;
use crate::frame::tcp::{self, Header};
use crate::pdu::diagnostics::REPORT_SERVER_ID;
use crate::port::Port;
use crate::transaction::{Counter, Settings};
use core::cell::Cell;

/// As many requests at once as the queue holds, in TCP frames. Received bytes
/// stand in the frame buffer, those to send in [`Means::outgoing`].
#[repr(C)]
pub struct Tcp<P, S> {
    /// The number of the next request.
    next: u16,
    /// What arrived and was not looked at yet.
    start: u16,
    end: u16,
    /// Bytes to come of a frame that the buffer cannot hold.
    skip: u16,
    /// What is to be sent, of which so much was.
    filled: u16,
    sent: u16,
    /// Requests under way, and the most of them.
    flying: u8,
    most: u8,
    /// The boundaries of frames are lost: only what answers is taken for one.
    astray: bool,
    /// A request waits for others to end, or for room.
    blocked: bool,
    /// The byte stream.
    pub port: P,
    /// What the caller lends.
    pub means: S,
    /// Only the response timeout counts here.
    pub settings: Settings,
}

impl<P, S> Tcp<P, S> {
    /// A stream that is open, or will be.
    pub const fn new(port: P, means: S) -> Self {
        Tcp {
            next: 0,
            start: 0,
            end: 0,
            skip: 0,
            filled: 0,
            sent: 0,
            flying: 0,
            most: u8::MAX,
            astray: false,
            blocked: false,
            port,
            means,
            settings: Settings::DEFAULT,
        }
    }

    /// Sends at most so many requests before the first is answered.
    pub fn limit(&mut self, most: u8) {
        self.most = most.max(1);
    }

    fn clear(&mut self) {
        self.start = 0;
        self.end = 0;
        self.skip = 0;
        self.filled = 0;
        self.sent = 0;
        self.flying = 0;
        self.astray = false;
    }
}

impl<P: Port, S: Means> Tcp<P, S> {
    /// Receives what there is; false if the link is lost.
    fn hear(&mut self) -> bool {
        let frame = self.means.frame();
        if self.start > 0 {
            let kept = frame.get_mut(..usize::from(self.end));
            close_up(kept.unwrap_or_default(), self.start.into());
            self.end -= self.start;
            self.start = 0;
        }
        let Some(room) = frame.get_mut(usize::from(self.end)..) else {
            return true;
        };
        if room.is_empty() {
            return true;
        }
        let heard = self.port.read(room);
        if heard < 0 {
            return false;
        }
        let heard = heard as u16;
        self.means.count(Counter::BytesReceived, heard);
        self.end += heard;
        true
    }

    /// Finds the next response among what arrived; gives back a job that ended.
    #[inline]
    fn dispatch<J: Job, const N: usize>(
        &mut self,
        shared: &mut Shared<J, N>,
        now: u32,
    ) -> Option<J> {
        self.pass();
        if self.start == self.end {
            return None;
        }
        self.find(shared, now)
    }

    /// As [`Tcp::dispatch`], of bytes that are there.
    fn find<J: Job, const N: usize>(&mut self, shared: &mut Shared<J, N>, now: u32) -> Option<J> {
        loop {
            self.pass();
            let range = usize::from(self.start)..usize::from(self.end);
            let rest = self.means.frame().get(range)?;
            let header = match tcp::header(rest) {
                Ok(header) => header,
                Err(Status::INCOMPLETE_FRAME) => return None,
                Err(_) => {
                    self.stray();
                    continue;
                }
            };
            let (arrived, room) = (rest.len(), self.means.frame().len());
            let place = shared.place(|job| answers(job, &header));
            if place.is_none() && self.astray {
                self.start += 1;
                continue;
            }
            if arrived < header.total && header.total <= room {
                return None;
            }
            let begin = usize::from(self.start) + tcp::PDU;
            let end = usize::from(self.start) + header.total;
            // What does not fit is passed over as it arrives.
            self.skip = header.total as u16;
            let Some(at) = place else {
                self.means.count(Counter::ForeignFrames, 1);
                self.note(shared, &header);
                continue;
            };
            let status = match self.means.frame().get(begin..end) {
                Some(pdu) => judge(shared.queue.get_mut(at)?, pdu),
                None => Status::BUFFER_TOO_SMALL,
            };
            if self.astray && status.is_failure() && status != Status::BUFFER_TOO_SMALL {
                // It only looked like that.
                self.skip = 1;
                continue;
            }
            self.astray = false;
            self.flying = self.flying.saturating_sub(1);
            shared.connected = true;
            if !status.is_failure() {
                self.means.count(Counter::Replies, 1);
                if status != Status::OK {
                    self.means.count(Counter::Exceptions, 1);
                }
            }
            if let Some(job) = shared.end(at, status, now, &mut self.means) {
                return Some(job);
            }
        }
    }

    /// Passes over what is left of a frame that is known already.
    fn pass(&mut self) {
        let skipped = self.skip.min(self.end - self.start);
        self.start += skipped;
        self.skip -= skipped;
    }

    /// Passes over a byte that begins no frame.
    fn stray(&mut self) {
        self.start += 1;
        if !self.astray {
            self.astray = true;
            self.means.count(Counter::Resynchronisations, 1);
        }
    }

    /// Notes that another unit answered a request of ours.
    fn note<J: Job, const N: usize>(&self, shared: &mut Shared<J, N>, header: &Header) {
        for job in shared.queue.iter_mut() {
            let ticket = job.ticket_mut();
            if ticket.is_sent() && ticket.wire == header.transaction {
                ticket.stray();
            }
        }
    }

    /// Puts a request behind those that are to be sent.
    fn encode<J: Job>(&mut self, job: &mut J, now: u32) -> Result<(), Status> {
        let wire = self.next;
        let ticket = job.ticket();
        let (unit, outline) = (ticket.unit, ticket.outline);
        let begin = usize::from(self.filled);
        let buffer = self.means.outgoing().get_mut(begin..);
        let buffer = buffer.unwrap_or_default();
        let length = tcp::emit(buffer, wire, unit, |place| {
            let length = usize::from(outline.request_length());
            let place = place.get_mut(..length).ok_or(Status::BUFFER_TOO_SMALL)?;
            outline.emit(place, |index| job.byte(index));
            Ok(length)
        })?;
        self.filled += length as u16;
        self.next = wire.wrapping_add(1);
        self.flying = self.flying.saturating_add(1);
        self.means.count(Counter::Requests, 1);
        let wait = if outline.is_answered() {
            self.settings.response_timeout
        } else {
            self.settings.turnaround_delay
        };
        let ticket = job.ticket_mut();
        ticket.wire = wire;
        ticket.enter(Stage::Sent, now, wait);
        Ok(())
    }

    /// Takes a request back that was not sent, so that it is not sent later. True if
    /// it was not, or only half.
    #[cold]
    fn unsend(&mut self, wire: u16) -> bool {
        let filled = usize::from(self.filled);
        let bytes = self.means.outgoing().get_mut(..filled);
        let (bytes, mut at) = (bytes.unwrap_or_default(), 0);
        while let Some(rest) = bytes.get_mut(at..) {
            let Ok(header) = tcp::header(rest) else {
                break;
            };
            let end = at + header.total;
            if header.transaction != wire {
                at = end;
                continue;
            }
            if at >= usize::from(self.sent) {
                close_up(rest, header.total);
                self.filled -= header.total as u16;
                if self.sent == self.filled {
                    self.sent = 0;
                    self.filled = 0;
                }
            }
            return end > usize::from(self.sent);
        }
        false
    }

    /// Hands over what is to be sent; false if the link is lost.
    fn flush<J: Job, const N: usize>(&mut self, shared: &mut Shared<J, N>) -> bool {
        if self.sent == self.filled {
            return true;
        }
        let range = usize::from(self.sent)..usize::from(self.filled);
        let Some(bytes) = self.means.outgoing().get(range) else {
            return true;
        };
        let sent = self.port.write(bytes);
        if sent < 0 {
            return false;
        }
        let sent = sent as u16;
        self.means.count(Counter::BytesSent, sent);
        self.sent += sent;
        if self.sent == self.filled {
            self.sent = 0;
            self.filled = 0;
            shared.look |= self.blocked;
            self.blocked = false;
        }
        true
    }

    /// Half of a request that was given up is all that is left to be sent: if it does
    /// not go, which is so for true, what waits for its room would wait for ever.
    /// `None` if the link is lost.
    #[cold]
    fn push_half<J: Job, const N: usize>(&mut self, shared: &mut Shared<J, N>) -> Option<bool> {
        let half = self.sent;
        if !self.flush(shared) {
            return None;
        }
        let stuck = half == self.sent;
        shared.look |= stuck && self.blocked;
        Some(stuck)
    }

    /// The request was not answered in time: what that means.
    fn overdue<J: Job>(&mut self, job: &J) -> Status {
        let ticket = job.ticket();
        if !ticket.outline.is_answered() {
            return Status::OK;
        }
        self.means.count(Counter::Timeouts, 1);
        if self.unsend(ticket.wire) {
            Status::LINE_BUSY
        } else if ticket.is(Stage::Strayed) {
            Status::INVALID_SLAVE_ID
        } else {
            Status::RESPONSE_TIMED_OUT
        }
    }

    fn lose<J: Job, const N: usize>(&mut self, shared: &mut Shared<J, N>, now: u32) -> Option<J> {
        self.clear();
        shared.lose();
        let at = shared.due(0, now, &mut self.means, |_| true)?;
        shared.end(at, Status::LINK_LOST, now, &mut self.means)
    }
}

/// Moves what stands behind the first `by` bytes over them.
#[cfg_attr(target_os = "none", inline(never))]
fn close_up(bytes: &mut [u8], by: usize) {
    let cells = Cell::from_mut(bytes).as_slice_of_cells();
    for (to, from) in cells.iter().zip(cells.get(by..).unwrap_or_default()) {
        to.set(from.get());
    }
}

fn answers<J: Job>(job: &J, header: &Header) -> bool {
    let ticket = job.ticket();
    ticket.is_sent() && ticket.wire == header.transaction && ticket.unit == header.unit
}

/// What the response `pdu` says to the job, which takes its data.
fn judge<J: Job>(job: &mut J, pdu: &[u8]) -> Status {
    let outline = &job.ticket().outline;
    match outline.expected(pdu, pdu.len()) {
        Some(length) if usize::from(length.get()) == pdu.len() => {}
        // Some devices count the id alone and send more behind it.
        Some(length)
            if pdu.first() == Some(&REPORT_SERVER_ID) && usize::from(length.get()) < pdu.len() => {}
        None if pdu.first().map(|code| code & 0x7F) != Some(outline.function()) => {
            return Status::INVALID_FUNCTION;
        }
        _ => return Status::MALFORMED_REPLY,
    }
    let status = outline.judge(pdu, |index| job.byte(index));
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

impl<P: Port, S: Means, J: Job> Line<J> for Tcp<P, S> {
    const MOST: usize = u8::MAX as usize;
    const HAS_IDS: bool = true;

    fn broadcasts(&self) -> bool {
        false
    }

    fn held(&self) -> usize {
        0
    }

    fn is_idle(&self) -> bool {
        self.flying == 0 && self.filled == 0
    }

    fn released(&mut self, job: &J) {
        let ticket = job.ticket();
        if ticket.is_sent() {
            self.flying = self.flying.saturating_sub(1);
            self.unsend(ticket.wire);
        }
    }

    fn advance<const N: usize>(
        &mut self,
        shared: &mut Shared<J, N>,
        now: u32,
        fresh: bool,
    ) -> Option<J> {
        if shared.queue.is_empty() {
            return None;
        }
        if let Some(job) = self.dispatch(shared, now) {
            return Some(job);
        }
        // What comes late is taken too, for who waits in select would not sleep.
        if fresh && (self.flying > 0 || shared.delay(now) > 0) {
            if !self.hear() {
                return self.lose(shared, now);
            }
            if let Some(job) = self.dispatch(shared, now) {
                return Some(job);
            }
        }
        let mut stuck = false;
        if self.flying == 0 && self.sent < self.filled {
            let Some(is_stuck) = self.push_half(shared) else {
                return self.lose(shared, now);
            };
            stuck = is_stuck;
        }
        let (mut from, mut blocked) = (0, false);
        let mut reads = u8::MAX;
        loop {
            let (flying, most) = (self.flying, self.most);
            let filled = usize::from(self.filled) + tcp::PDU;
            let room = self.means.outgoing().len();
            let due = shared.due(from, now, &mut self.means, |job| {
                let ticket = job.ticket();
                let length = filled + usize::from(ticket.outline.request_length());
                let fits = length <= room || filled == tcp::PDU || stuck;
                let accepted = !ticket.is(Stage::Queued) || (flying < most && fits);
                blocked |= !accepted;
                accepted
            });
            self.blocked |= blocked;
            let Some(at) = due else {
                break;
            };
            let job = shared.queue.get_mut(at)?;
            let status = if job.ticket().is(Stage::Queued) {
                match self.encode(job, now) {
                    Ok(()) => {
                        from = at;
                        continue;
                    }
                    Err(_) if stuck => Status::LINE_BUSY,
                    Err(refused) => refused,
                }
            } else if job.ticket().is_sent() {
                // As the deadline passes, all that has arrived is looked at, even if
                // the buffer cannot hold it at once.
                let had = self.end - self.start;
                if reads > 0 && !self.hear() {
                    return self.lose(shared, now);
                }
                reads = reads.saturating_sub(1);
                if self.start < self.end {
                    // What began to arrive may hide the response.
                    if self.end - self.start == had {
                        self.stray();
                    }
                    (from, blocked) = (0, false);
                    match self.dispatch(shared, now) {
                        Some(job) => return Some(job),
                        None => continue,
                    }
                }
                self.flying = self.flying.saturating_sub(1);
                self.overdue(job)
            } else {
                Status::LINK_LOST
            };
            if let Some(job) = shared.end(at, status, now, &mut self.means) {
                return Some(job);
            }
            // There may be room for those that were passed.
            (from, blocked) = (0, false);
        }
        if !self.flush(shared) {
            return self.lose(shared, now);
        }
        None
    }

    fn withdraw(&mut self, _: impl FnOnce(&J) -> bool) -> Option<J> {
        None
    }

    fn interrupt<const N: usize>(&mut self, shared: &mut Shared<J, N>) {
        self.clear();
        shared.abandon(|job| job.ticket().is_sent());
    }

    fn delay(&self, _: u32) -> Option<u32> {
        (self.sent < self.filled).then_some(super::FULL_PORT)
    }
}
