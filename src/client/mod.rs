//! A client that never waits: requests are queued, `poll` moves them on and
//! gives each back when it has ended.
//!
//! A serial line carries one request at a time, a TCP stream as many as the
//! queue holds. What a request is, with its data, is a [`Job`](crate::client::Job) of the caller's;
//! nothing is copied until it goes to the wire, or comes from it.

mod job;
mod policy;
mod serial;
mod shared;
mod tcp;
mod units;

pub use job::{Asked, Job, Ticket};
pub use policy::{again, Backoff, Policy};
pub use serial::Serial;
pub use shared::Shared;
pub use tcp::Tcp;
pub use units::{note, rest, Means, Unit};

use crate::error::Status;
use crate::time::millis;
use crate::transaction::BROADCAST;
use job::Stage;

/// What is a pause in a TCP stream that carries the frames of a serial line.
pub const STREAM_SILENCE: u32 = millis(20);

/// The pause within an ASCII frame that ends it (serial line guide V1.02, 2.5.2.1).
pub const ASCII_SILENCE: u32 = millis(1000);

/// How soon to look again whether a port takes bytes that it did not take.
const FULL_PORT: u32 = millis(1);

/// How requests travel.
pub trait Line<J> {
    /// The most requests under way at once.
    const MOST: usize;

    /// Whether a caller's number must tell one request from another.
    const HAS_IDS: bool;

    /// True if unit 0 is everybody.
    fn broadcasts(&self) -> bool;

    /// How many requests it holds outside of the queue.
    fn held(&self) -> usize;

    /// True if nothing is under way.
    fn is_idle(&self) -> bool;

    /// Says that a job was taken out of the queue.
    fn released(&mut self, _job: &J) {}

    /// True if it holds a job outside of the queue that `is` the one.
    fn holds(&mut self, is: impl FnOnce(&J) -> bool) -> bool;

    /// Moves on to the time `now`; gives a job back that ended. `fresh` at the
    /// first of the calls that one poll makes, when there may be something new.
    fn advance<const N: usize>(
        &mut self,
        shared: &mut Shared<J, N>,
        now: u32,
        fresh: bool,
    ) -> Option<J>;

    /// Gives up the job that `is` the one, if the line holds it.
    fn withdraw(&mut self, is: impl FnOnce(&J) -> bool) -> Option<J>;

    /// Forgets what is half received or half sent; what is under way is lost.
    fn interrupt<const N: usize>(&mut self, shared: &mut Shared<J, N>);

    /// How long there is nothing to do; `None` if that depends on the queue.
    fn delay(&mut self, now: u32) -> Option<u32>;
}

/// A client of a [`Line`] for up to `N` requests, waiting or under way.
#[repr(C)]
pub struct Client<L, J, const N: usize> {
    shared: Shared<J, N>,
    lent: bool,
    /// How requests travel.
    pub line: L,
}

impl<L, J, const N: usize> Client<L, J, N> {
    /// A client without requests.
    pub const fn new(line: L) -> Self {
        Client {
            shared: Shared::new(),
            line,
            lent: false,
        }
    }

    /// Turns zeroed storage into a client without requests, but for the line.
    pub fn preset(&mut self) {
        self.shared.connected = true;
    }

    /// When requests are asked again.
    pub fn policy(&mut self) -> &mut Policy {
        &mut self.shared.policy
    }

    /// Policy and line at once.
    pub fn parts(&mut self) -> (&mut Policy, &mut L) {
        (&mut self.shared.policy, &mut self.line)
    }

    /// False from a lost link on, until a reply arrives or
    /// [`Client::set_connected`] or [`Client::reconnect`] says otherwise.
    pub const fn is_connected(&self) -> bool {
        self.shared.connected
    }

    /// Says whether there is a link. [`Client::reconnect`] assumes that there is.
    pub fn set_connected(&mut self, connected: bool) {
        self.shared.connected = connected;
    }

    /// Ends what [`Client::lend`] began.
    pub fn take_back(&mut self) {
        self.lent = false;
    }

    /// True while somebody else uses the line.
    pub const fn is_lent(&self) -> bool {
        self.lent
    }
}

impl<L: Line<J>, J: Job, const N: usize> Client<L, J, N> {
    /// Holds at compile time that the line carries `M` requests at once and the
    /// queue has room for them: 1 on a serial line, which is half duplex.
    ///
    /// ```
    /// # use mbm::client::*;
    /// fn one_at_a_time<J: Job, P: mbm::port::Port, S: Means>(client: Client<Serial<P, S, J>, J, 4>) {
    ///     client.in_flight::<1>();
    /// }
    /// # struct P; impl mbm::port::Port for P {
    /// #     fn read(&mut self, _: &mut [u8]) -> i16 { 0 }
    /// #     fn write(&mut self, _: &[u8]) -> i16 { 0 }
    /// #     fn micros(&mut self) -> u32 { 0 }
    /// # }
    /// # struct J; impl Job for J {
    /// #     fn ticket(&self) -> &Ticket { &Ticket::NONE }
    /// #     fn ticket_mut(&mut self) -> &mut Ticket { unreachable!() }
    /// #     fn byte(&self, _: usize) -> u8 { 0 }
    /// #     fn put(&mut self, _: usize, _: u8) {}
    /// # }
    /// # struct S; impl Means for S {}
    /// # impl mbm::transaction::Storage for S {
    /// #     fn frame(&mut self) -> &mut [u8] { &mut [] }
    /// # }
    /// # fn main() { one_at_a_time::<J, P, S>(Client::new(Serial::new(P, S))); }
    /// ```
    ///
    /// Two do not compile:
    ///
    /// ```compile_fail
    /// # use mbm::client::*;
    /// fn two_at_once<J: Job, P: mbm::port::Port, S: Means>(client: Client<Serial<P, S, J>, J, 4>) {
    ///     client.in_flight::<2>();
    /// }
    /// # struct P; impl mbm::port::Port for P {
    /// #     fn read(&mut self, _: &mut [u8]) -> i16 { 0 }
    /// #     fn write(&mut self, _: &[u8]) -> i16 { 0 }
    /// #     fn micros(&mut self) -> u32 { 0 }
    /// # }
    /// # struct J; impl Job for J {
    /// #     fn ticket(&self) -> &Ticket { &Ticket::NONE }
    /// #     fn ticket_mut(&mut self) -> &mut Ticket { unreachable!() }
    /// #     fn byte(&self, _: usize) -> u8 { 0 }
    /// #     fn put(&mut self, _: usize, _: u8) {}
    /// # }
    /// # struct S; impl Means for S {}
    /// # impl mbm::transaction::Storage for S {
    /// #     fn frame(&mut self) -> &mut [u8] { &mut [] }
    /// # }
    /// # fn main() { two_at_once::<J, P, S>(Client::new(Serial::new(P, S))); }
    /// ```
    #[must_use]
    pub fn in_flight<const M: usize>(self) -> Self {
        const { assert!(M >= 1 && M <= L::MOST && M <= N) }
        self
    }

    /// How many requests wait or are under way.
    pub fn pending(&self) -> usize {
        self.shared.queue.len() + self.line.held()
    }

    /// True if a job that `is` the one waits or is under way.
    pub fn holds(&mut self, is: impl Fn(&J) -> bool) -> bool {
        self.shared.queue.iter().any(&is) || self.line.holds(is)
    }

    /// Has a job done; it is given back by [`Client::poll`].
    ///
    /// # Errors
    /// The job, its status [`Status::QUEUE_FULL`],
    /// [`Status::BROADCAST_NOT_ALLOWED`], or on TCP
    /// [`Status::DUPLICATE_TRANSACTION`] for a number other than 0 that another
    /// pending request has.
    pub fn queue(&mut self, mut job: J) -> Result<(), J> {
        let status = self.readiness(&job);
        let ticket = job.ticket_mut();
        ticket.status = status;
        if status != Status::PENDING {
            return Err(job);
        }
        ticket.exception = 0;
        ticket.length = 0;
        ticket.retries = 0;
        ticket.enter(Stage::Queued, 0, 0);
        self.shared.look = true;
        self.shared.queue.push(job)
    }

    /// [`Status::PENDING`] if a job may be queued, else why not.
    fn readiness(&self, job: &J) -> Status {
        let ticket = job.ticket();
        let everybody = ticket.unit == BROADCAST;
        if self.pending() >= N {
            Status::QUEUE_FULL
        } else if everybody && !(self.line.broadcasts() && ticket.outline.may_be_broadcast()) {
            Status::BROADCAST_NOT_ALLOWED
        } else if L::HAS_IDS && ticket.transaction != 0 && self.has(ticket.transaction) {
            Status::DUPLICATE_TRANSACTION
        } else {
            Status::PENDING
        }
    }

    fn has(&self, transaction: u16) -> bool {
        let mut queue = self.shared.queue.iter();
        queue.any(|job| job.ticket().transaction == transaction)
    }

    /// Moves on to the time `now`, without waiting; gives a job back that has
    /// ended. Call it until there is none, `fresh` at first.
    pub fn poll(&mut self, now: u32, fresh: bool) -> Option<J> {
        if self.lent {
            return None;
        }
        self.line.advance(&mut self.shared, now, fresh)
    }

    /// How long, in microseconds from `now`, poll will find nothing to do unless
    /// a byte arrives; the greatest value if there is no request, and then no byte is
    /// taken either. While a TCP port does not take what is to be sent, 1000.
    pub fn poll_delay(&mut self, now: u32) -> u32 {
        match self.line.delay(now) {
            _ if self.lent => u32::MAX,
            Some(delay) => delay,
            None => self.shared.delay(now),
        }
    }

    /// Gives up the job that `is` the one, and gives it back; `None` if it is not
    /// pending.
    pub fn cancel(&mut self, is: impl Fn(&J) -> bool) -> Option<J> {
        let held = self.line.withdraw(&is);
        let mut job = match held {
            Some(job) => job,
            None => {
                let at = self.shared.place(|job| is(job))?;
                self.shared.remove(at)?
            }
        };
        self.line.released(&job);
        self.shared.look = true;
        job.ticket_mut().status = Status::CANCELLED;
        Some(job)
    }

    /// Says that the link is a new one: what was half received is forgotten, and
    /// what was under way is given back as lost by the next polls. What still
    /// waited goes over the new link.
    pub fn reconnect(&mut self) {
        self.line.interrupt(&mut self.shared);
        self.shared.connected = true;
    }

    /// Lets somebody else use the line until [`Client::take_back`]; false if a
    /// request is under way or the line is lent already.
    pub fn lend(&mut self) -> bool {
        let free = !self.lent && self.line.is_idle();
        self.lent |= free;
        free
    }
}
