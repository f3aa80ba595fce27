//! A client's serial line, or a stream that carries the frames of one: one
//! request at a time.

use super::job::{deliver, Asked, Job, Stage};
use super::shared::Shared;
use super::units::Means;
use super::Line;
use crate::error::Status;
use crate::frame::rtu::Window;
use crate::frame::Search;
use crate::port::Port;
use crate::transaction::{Counter, Transaction};

/// One request at a time, in RTU frames, or with [`crate::frame::ascii_window`]
/// in ASCII frames.
#[repr(C)]
pub struct Serial<P, S, J, W = Window> {
    broadcasts: bool,
    engine: Transaction<P, S, Asked<J>, W>,
}

impl<P, S, J: Job, W: Search> Serial<P, S, J, W> {
    /// A serial line, where unit 0 is everybody.
    pub const fn new(port: P, means: S) -> Self {
        Serial {
            broadcasts: true,
            engine: Transaction::new(port, means),
        }
    }

    /// The frames of a serial line in a TCP stream: no gap between them, and
    /// nobody to broadcast to.
    pub const fn over_tcp(port: P, means: S) -> Self {
        let mut line = Self::new(port, means);
        line.broadcasts = false;
        line.engine.settings.gap = 0;
        line.engine.settings.silence = super::STREAM_SILENCE;
        line
    }
}

impl<P: Port, S: Means, J: Job, W: Search> Serial<P, S, J, W> {
    /// Says whether unit 0 is everybody.
    pub fn set_broadcasts(&mut self, on: bool) {
        self.broadcasts = on;
    }

    /// The transactions under it.
    pub fn transaction(&mut self) -> &mut Transaction<P, S, Asked<J>, W> {
        &mut self.engine
    }

    /// Moves the request under way on.
    fn step(&mut self, now: u32) -> Status {
        self.engine.poll(now)
    }

    /// Takes and drops the bytes that arrive while requests wait to be sent again. A
    /// program that sleeps until bytes are there would not sleep otherwise.
    fn drop_late<const N: usize>(&mut self, shared: &mut Shared<J, N>) {
        let heard = self.engine.port.read(self.engine.storage.frame());
        if heard < 0 {
            shared.lose();
        } else if heard > 0 {
            let counter = Counter::BytesReceived;
            self.engine.storage.count(counter, heard as u16);
            self.engine.line_used();
        }
    }

    fn received(&mut self, job: &mut J, status: Status) -> Status {
        job.ticket_mut().exception = self.engine.exception_code();
        // 0 if nothing answered: the request was a broadcast, or of that kind.
        let length = usize::from(self.engine.request().length);
        match self.engine.reply().get(..length) {
            Some(pdu) if status == Status::OK && length > 0 => deliver(job, pdu),
            _ => status,
        }
    }
}

impl<P: Port, S: Means, J: Job, W: Search> Line<J> for Serial<P, S, J, W> {
    const MOST: usize = 1;
    const HAS_IDS: bool = false;

    fn broadcasts(&self) -> bool {
        self.broadcasts
    }

    fn held(&self) -> usize {
        usize::from(self.engine.is_pending())
    }

    fn is_idle(&self) -> bool {
        !self.engine.is_pending()
    }

    fn holds(&mut self, is: impl FnOnce(&J) -> bool) -> bool {
        self.engine.request().job.as_ref().is_some_and(is)
    }

    fn advance<const N: usize>(
        &mut self,
        shared: &mut Shared<J, N>,
        now: u32,
        fresh: bool,
    ) -> Option<J> {
        let started = if !self.engine.is_pending() {
            let Some(job) = shared.take_due(now, &mut self.engine.storage) else {
                if fresh && !shared.queue.is_empty() {
                    self.drop_late(shared);
                }
                return None;
            };
            if job.ticket().is(Stage::Lost) {
                return shared.conclude(job, Status::LINK_LOST, now, &mut self.engine.storage);
            }
            let unit = job.ticket().unit;
            self.engine.forget();
            self.engine.request().job = Some(job);
            self.engine.request().length = 0;
            self.engine.start(unit)
        } else {
            Status::PENDING
        };
        let status = match started {
            Status::PENDING => self.step(now),
            refused => refused,
        };
        if status == Status::PENDING {
            return None;
        }
        let mut job = self.engine.request().job.take()?;
        let status = self.received(&mut job, status);
        if status == Status::LINK_LOST {
            shared.lose();
        } else if !status.is_failure() {
            shared.connected = true;
        }
        // There is room: it came out of the queue, and was counted as if in it.
        shared.conclude(job, status, now, &mut self.engine.storage)
    }

    fn withdraw(&mut self, is: impl FnOnce(&J) -> bool) -> Option<J> {
        if !self.holds(is) {
            return None;
        }
        self.engine.cancel();
        self.engine.request().job.take()
    }

    fn interrupt<const N: usize>(&mut self, shared: &mut Shared<J, N>) {
        self.engine.cancel();
        if let Some(mut job) = self.engine.request().job.take() {
            job.ticket_mut().enter(Stage::Lost, 0, 0);
            shared.put_first(job);
            shared.look = true;
        }
    }

    fn delay(&mut self, now: u32) -> Option<u32> {
        let is_pending = self.engine.is_pending();
        is_pending.then(|| self.engine.poll_delay(now))
    }
}
