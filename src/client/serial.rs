//! A client's serial line, or a stream that carries the frames of one: one
//! request at a time.

use super::job::{deliver, is_answer, Asked, Job, Stage};
use super::shared::Shared;
use super::units::Means;
use super::{Client, Line};
use crate::error::Status;
use crate::frame::rtu::Window;
use crate::frame::Search;
use crate::port::Port;
use crate::transaction::{Counter, Transaction};

/// One request at a time, in RTU frames, or with [`crate::frame::ascii_window`]
/// in ASCII frames.
#[repr(C)]
pub struct Serial<P, S, J, W = Window> {
    /// The request under way.
    pub engine: Transaction<P, S, Asked<J>, W>,
}

impl<P, S, J: Job, W: Search> Serial<P, S, J, W> {
    /// A serial line.
    pub const fn new(port: P, means: S) -> Self {
        Serial {
            engine: Transaction::new(port, means),
        }
    }

    /// The transactions under it.
    pub fn transaction(&mut self) -> &mut Transaction<P, S, Asked<J>, W> {
        &mut self.engine
    }
}

impl<P: Port, S: Means, J: Job, W: Search, const N: usize> Client<Serial<P, S, J, W>, J, N> {
    /// A client that sends the frames of a serial line through a TCP stream: no gap
    /// between them, and nobody to broadcast to.
    pub fn over_tcp(port: P, means: S) -> Self {
        let mut client = Client::new(Serial::new(port, means));
        client.shared.broadcasts = false;
        client.line.engine.settings.gap = 0;
        client.line.engine.settings.silence = super::STREAM_SILENCE;
        client
    }
}

impl<P: Port, S: Means, J: Job, W: Search> Serial<P, S, J, W> {
    /// Takes and drops the bytes that arrive while requests wait to be sent again. A
    /// program that sleeps until bytes are there would not sleep otherwise.
    #[cold]
    #[inline(never)]
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

    /// Hands the engine a job, and starts its request.
    fn start(&mut self, job: J) -> Status {
        let unit = job.ticket().unit;
        self.engine.forget();
        let request = self.engine.request();
        request.job = Some(job);
        request.length = 0;
        self.engine.start(unit)
    }

    /// How the request ended: its response is taken.
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
    const BROADCASTS: bool = true;
    const HAS_IDS: bool = false;

    fn advance<const N: usize>(
        &mut self,
        shared: &mut Shared<J, N>,
        now: u32,
        fresh: bool,
    ) -> Option<J> {
        // The engine has the job while it works, no longer.
        let mut status = Status::PENDING;
        if let Some(job) = shared.active.take() {
            self.engine.request().job = Some(job);
        } else {
            let Some(job) = shared.take_due(now, &mut self.engine.storage) else {
                if fresh && !shared.queue.is_empty() {
                    self.drop_late(shared);
                }
                return None;
            };
            if job.ticket().is(Stage::Lost) {
                return shared.conclude(job, Status::LINK_LOST, now, &mut self.engine.storage);
            }
            status = self.start(job);
        }
        if status == Status::PENDING {
            status = self.engine.poll(now);
        }
        let mut job = self.engine.request().job.take()?;
        if status == Status::PENDING {
            shared.active = Some(job);
            return None;
        }
        let status = self.received(&mut job, status);
        if status == Status::LINK_LOST {
            shared.lose();
        } else if is_answer(status) {
            shared.connected = true;
        }
        // There is room: it came out of the queue, and was counted as if in it.
        shared.conclude(job, status, now, &mut self.engine.storage)
    }

    fn release(&mut self, _: Option<&J>) {
        self.engine.cancel();
    }

    fn delay(&mut self, now: u32) -> Option<u32> {
        let is_pending = self.engine.is_pending();
        is_pending.then(|| self.engine.poll_delay(now))
    }
}
