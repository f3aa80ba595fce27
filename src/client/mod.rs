//! A client that never waits: requests are queued, `poll` moves them on and
//! gives each back when it has ended.
//!
//! A serial line carries one request at a time, a TCP stream as many as the
//! queue holds. What a request is, with its data, is a [`Job`] of the caller's;
//! nothing is copied until it goes to the wire, or comes from it.

mod active;
mod job;
mod line;
mod means;
mod policy;
mod serial;
mod shared;
mod tcp;
mod units;

pub use active::{ActiveRequest, ClientEngine};
pub use job::{Job, Ticket};
pub use line::Line;
pub use means::Means;
pub use policy::{again, Backoff, Policy};
pub use serial::Serial;
pub use shared::Shared;
pub use tcp::Tcp;
pub use units::{note, rest, Unit};

#[cfg(doc)]
use crate::error::Status;
use crate::time::millis;

/// What is a pause in a TCP stream that carries the frames of a serial line.
pub const STREAM_SILENCE: u32 = millis(20);

/// The pause within an ASCII frame that ends it (serial line guide V1.02, 2.5.2.1).
pub const ASCII_SILENCE: u32 = millis(1000);

/// How soon to look again whether a port takes bytes that it did not take.
const FULL_PORT: u32 = millis(1);

/// A client of a [`Line`] for up to `N` requests, waiting or under way.
#[repr(C)]
pub struct Client<L, J, const N: usize> {
    shared: Shared<J, N>,
    /// How requests travel.
    pub line: L,
}

impl<L, J, const N: usize> Client<L, J, N> {
    /// When requests are asked again.
    pub fn policy(&mut self) -> &mut Policy {
        &mut self.shared.policy
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
        self.shared.lent = false;
    }

    /// True while somebody else uses the line.
    pub const fn is_lent(&self) -> bool {
        self.shared.lent
    }

    /// How many requests wait or are under way.
    pub fn pending(&self) -> usize {
        self.shared.pending()
    }
}

impl<L: Line<J>, J: Job, const N: usize> Client<L, J, N> {
    /// A client without requests.
    pub fn new(line: L) -> Self {
        let mut shared = Shared::new();
        shared.broadcasts = L::BROADCASTS;
        shared.has_ids = L::HAS_IDS;
        Client { shared, line }
    }

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
    /// # fn main() { one_at_a_time::<J, P, _>(Client::new(Serial::new(P, mbm::engine::Frame::new([0; 8])))); }
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
    /// # fn main() { two_at_once::<J, P, _>(Client::new(Serial::new(P, mbm::engine::Frame::new([0; 8])))); }
    /// ```
    #[must_use]
    pub fn in_flight<const M: usize>(self) -> Self {
        const { assert!(M >= 1 && M <= L::MOST && M <= N) }
        self
    }

    /// Has a job done; it is given back by [`Client::poll`].
    ///
    /// # Errors
    /// The job, its status [`Status::QUEUE_FULL`],
    /// [`Status::BROADCAST_NOT_ALLOWED`], or on TCP
    /// [`Status::DUPLICATE_TRANSACTION`] for a number other than 0 that another
    /// pending request has.
    pub fn queue(&mut self, job: J) -> Result<(), J> {
        self.shared.enqueue(job)
    }

    /// Moves on to the time `now`, without waiting; gives a job back that has
    /// ended. Call it until there is none, `fresh` at first.
    pub fn poll(&mut self, now: u32, fresh: bool) -> Option<J> {
        if self.shared.lent {
            return None;
        }
        self.line.advance(&mut self.shared, now, fresh)
    }

    /// How long, in microseconds from `now`, poll will find nothing to do unless
    /// a byte arrives; the greatest value if there is no request, and then no byte is
    /// taken either. While a TCP port does not take what is to be sent, 1000.
    pub fn poll_delay(&mut self, now: u32) -> u32 {
        self.line.poll_delay(&self.shared, now)
    }

    /// Gives up the job that `is` the one, and gives it back; `None` if it is not
    /// pending.
    pub fn cancel(&mut self, is: impl Fn(&J) -> bool) -> Option<J> {
        let job = self.shared.withdraw(is)?;
        if job.ticket().is_sent() {
            self.line.release(Some(&job));
        }
        Some(job)
    }

    /// Says that the link is a new one: what was half received is forgotten, and
    /// what was under way is given back as lost by the next polls. What still
    /// waited goes over the new link.
    pub fn reconnect(&mut self) {
        self.line.release(None);
        self.shared.interrupt();
    }

    /// Lets somebody else use the line until [`Client::take_back`]; false if a
    /// request is under way or the line is lent already.
    pub fn lend(&mut self) -> bool {
        self.line.lend(&mut self.shared)
    }
}
