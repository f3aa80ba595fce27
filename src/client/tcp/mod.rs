//! A client's TCP stream: many requests at once, told apart by the number in
//! their header.

mod find;

use super::job::{bytes, Job, Stage};
use super::line::Line;
use super::means::Means;
use super::shared::Shared;
use crate::bytes::move_to_front;
use crate::engine::{Counter, Settings};
use crate::error::Status;
use crate::frame::tcp;
use crate::port::Port;
use crate::FIRMWARE;

/// As many requests at once as the queue holds, in TCP frames. Received bytes
/// stand in the frame buffer, those to send in [`Means::outgoing`].
#[repr(C)]
pub struct Tcp<P, S> {
    /// Requests under way, and the most of them.
    flying: u8,
    most: u8,
    /// What arrived and was not looked at yet.
    start: u16,
    end: u16,
    /// The number of the next request. (Amid what [`Tcp::clear`] zeroes, which would be
    /// a call of memset else: 200 bytes of libc on a Cortex-M0+.)
    next: u16,
    /// What is to be sent, of which so much was.
    filled: u16,
    sent: u16,
    /// Bytes to come of a frame that the buffer cannot hold.
    skip: u16,
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
    #[cfg_attr(not(target_os = "none"), inline(always))]
    fn hear(&mut self) -> bool {
        if self.start == self.end {
            self.start = 0;
            self.end = 0;
        } else if self.start > 0 {
            self.gather();
        }
        let length = self.means.room() - self.end;
        let room = self.means.bytes(self.end, length);
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

    /// Ends what is overdue, and sends what may be; gives back a job that ended.
    #[inline]
    fn send<J: Job, const N: usize>(&mut self, shared: &mut Shared<J, N>, now: u32) -> Option<J> {
        let mut stuck = false;
        if self.flying == 0 && self.sent < self.filled {
            let Some(is_stuck) = self.push_half(shared) else {
                return self.lose(shared, now);
            };
            stuck = is_stuck;
        }
        let mut reads = u8::MAX;
        while shared.delay(now) == 0 {
            let Some((at, status)) = self.tend(shared, now, stuck) else {
                break;
            };
            if let Some(job) = self.conclude(shared, at, status, now, &mut reads) {
                return Some(job);
            }
        }
        if !self.flush(shared) {
            return self.lose(shared, now);
        }
        None
    }

    /// What becomes of a request that [`Tcp::tend`] found. So many `reads` are left
    /// before it is given up.
    #[cold]
    fn conclude<J: Job, const N: usize>(
        &mut self,
        shared: &mut Shared<J, N>,
        at: usize,
        mut status: Status,
        now: u32,
        reads: &mut u8,
    ) -> Option<J> {
        if status == Status::PENDING {
            // As the deadline passes, all that has arrived is looked at, even if the
            // buffer cannot hold it at once.
            let had = self.end - self.start;
            if *reads > 0 && !self.hear() {
                return self.lose(shared, now);
            }
            *reads = reads.saturating_sub(1);
            if self.start < self.end {
                if self.end - self.start == had {
                    // What began to arrive may hide the response.
                    self.stray();
                }
                return self.find(shared, now);
            }
            self.flying = self.flying.wrapping_sub(1);
            status = self.overdue(shared.queue.get(at)?);
        }
        shared.end(at, status, now, &mut self.means)
    }

    /// Sends what is to be sent; gives the place of a request that has ended, and
    /// how: [`Status::PENDING`] if its time is over. What has no room waits for it,
    /// unless what is before it is `stuck`.
    fn tend<J: Job, const N: usize>(
        &mut self,
        shared: &mut Shared<J, N>,
        now: u32,
        stuck: bool,
    ) -> Option<(usize, Status)> {
        let mut least = u32::MAX;
        self.blocked = false;
        let mut at = 0;
        let ended = loop {
            let Some(job) = shared.queue.get_mut(at) else {
                shared.rest(now, least);
                return None;
            };
            at += 1;
            let ticket = job.ticket();
            let mut wait = ticket.remains(now, &mut self.means);
            if wait == 0 {
                if ticket.is_sent() {
                    break Status::PENDING;
                }
                if !ticket.is(Stage::Queued) {
                    break Status::LINK_LOST;
                }
                match self.encode(job, now, stuck) {
                    Status::OK => {
                        wait = job.ticket().wait;
                        if self.next as u8 == 0 {
                            self.skip_numbers_in_use(&shared.queue);
                        }
                    }
                    Status::BUSY => {
                        self.blocked = true;
                        continue;
                    }
                    refused => break refused,
                }
            }
            least = least.min(wait);
        };
        Some((at - 1, ended))
    }

    /// Moves `next`, the first of 256 numbers, to the first of 256 that no pending
    /// request has. At most 255 requests are pending, so there are such numbers, and
    /// the other 255 need no look at the queue.
    #[cold]
    fn skip_numbers_in_use<J: Job>(&mut self, queue: &[J]) {
        while queue.iter().any(|job| {
            let ticket = job.ticket();
            ticket.is_sent() && ticket.wire >> 8 == self.next >> 8
        }) {
            self.next = self.next.wrapping_add(256);
        }
    }

    /// Puts a request behind those that are to be sent; [`Status::BUSY`] if it has
    /// to wait for others, [`Status::LINE_BUSY`] if those are `stuck`,
    /// [`Status::BUFFER_TOO_SMALL`] if it never fits.
    fn encode<J: Job>(&mut self, job: &mut J, now: u32, stuck: bool) -> Status {
        if self.flying >= self.most {
            return Status::BUSY;
        }
        let ticket = job.ticket();
        let (unit, outline) = (ticket.unit, &ticket.outline);
        let begin = usize::from(self.filled);
        let Some(room) = self.means.outgoing().get_mut(begin..) else {
            return Status::BUSY;
        };
        let length = match (outline.two_words(), room.first_chunk_mut()) {
            (Some(words), Some(frame)) => {
                let start = tcp::start(self.next, 5, unit, outline.function());
                *frame = tcp::short(start, *words);
                frame.len()
            }
            _ => match emit(job, room, self.next) {
                Ok(length) => length,
                Err(refused) if begin == 0 => return refused,
                Err(_) if stuck => return Status::LINE_BUSY,
                Err(_) => return Status::BUSY,
            },
        };
        let ticket = job.ticket_mut();
        let wait = if ticket.outline.is_answered() {
            self.settings.response_timeout
        } else {
            self.settings.turnaround_delay
        };
        ticket.wire = self.next;
        ticket.enter(Stage::Sent, now, wait);
        self.filled += length as u16;
        self.next = self.next.wrapping_add(1);
        self.flying += 1;
        self.means.count(Counter::Requests, 1);
        Status::OK
    }

    /// Hands over what is to be sent; false if the link is lost.
    fn flush<J: Job, const N: usize>(&mut self, shared: &mut Shared<J, N>) -> bool {
        if self.sent >= self.filled {
            return true;
        }
        let bytes = self.means.to_send(self.sent, self.filled);
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

    /// Takes a request back that was not sent, so that it is not sent later. True if
    /// it was not, or only half.
    #[cold]
    fn unsend(&mut self, wire: u16) -> bool {
        let (bytes, mut at) = (self.means.to_send(0, self.filled), 0);
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
                move_to_front(rest, header.total);
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

    /// The request was not answered in time: what that means.
    #[cold]
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

    /// The link is lost, and with it all that waits for it.
    #[cold]
    fn lose<J: Job, const N: usize>(&mut self, shared: &mut Shared<J, N>, now: u32) -> Option<J> {
        self.clear();
        shared.lose();
        shared.end(0, Status::LINK_LOST, now, &mut self.means)
    }
}

/// Writes the frame of a request, whatever it is.
#[cold]
fn emit<J: Job>(job: &J, place: &mut [u8], wire: u16) -> Result<usize, Status> {
    let ticket = job.ticket();
    let outline = &ticket.outline;
    tcp::emit(place, wire, ticket.unit, |pdu| {
        let length = usize::from(outline.request_length());
        let pdu = pdu.get_mut(..length).ok_or(Status::BUFFER_TOO_SMALL)?;
        outline.emit(pdu, bytes(job));
        Ok(length)
    })
}

impl<P: Port, S: Means, J: Job> Line<J> for Tcp<P, S> {
    const MOST: usize = u8::MAX as usize;
    const BROADCASTS: bool = false;
    const HAS_IDS: bool = true;

    fn advance<const N: usize>(
        &mut self,
        shared: &mut Shared<J, N>,
        now: u32,
        fresh: bool,
    ) -> Option<J> {
        if shared.queue.is_empty() {
            return None;
        }
        // What comes late is taken too, for who waits in select would not sleep.
        let mut fresh = fresh && (self.flying > 0 || shared.delay(now) > 0);
        loop {
            if self.start < self.end {
                if !FIRMWARE {
                    if let Some(job) = self.find_read(shared, now) {
                        return Some(job);
                    }
                }
                if let Some(job) = self.find(shared, now) {
                    return Some(job);
                }
            }
            if !fresh {
                return self.send(shared, now);
            }
            if !self.hear() {
                return self.lose(shared, now);
            }
            fresh = false;
        }
    }

    fn release(&mut self, job: Option<&J>) {
        let Some(job) = job else {
            return self.clear();
        };
        self.flying = self.flying.wrapping_sub(1);
        self.unsend(job.ticket().wire);
    }

    fn is_idle(&self) -> bool {
        self.filled == 0
    }

    fn delay(&mut self, _: u32) -> Option<u32> {
        (self.sent < self.filled).then_some(super::FULL_PORT)
    }
}
