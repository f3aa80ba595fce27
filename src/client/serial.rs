//! A client's serial line, or a TCP stream that carries the frames of a serial line. One
//! request is in flight at a time.

use super::active::ClientEngine;
use super::job::{deliver, is_answer, Job, Stage};
use super::line::Line;
use super::means::Means;
use super::shared::Shared;
use super::{Client, ASCII_SILENCE, STREAM_SILENCE};
use crate::engine::Engine;
use crate::error::Status;
use crate::frame::{ascii, rtu};
use crate::port::Port;

/// One request at a time, in RTU or ASCII frames.
#[repr(C)]
pub struct Serial<P, S: Means, J> {
    /// The engine that sends the request and finds the reply.
    pub engine: ClientEngine<P, S, J>,
}

impl<P, S: Means, J: Job> Serial<P, S, J> {
    /// A serial line with RTU frames.
    pub const fn new(port: P, means: S) -> Self {
        Serial {
            engine: Engine::new(port, means),
        }
    }

    /// A serial line with ASCII frames.
    pub fn ascii(port: P, means: S) -> Self {
        let mut line = Serial::new(port, means);
        line.set_ascii();
        line
    }

    /// Changes the line to ASCII frames: no silence before a request, and one second
    /// without a character ends an incomplete frame.
    pub fn set_ascii(&mut self) {
        self.engine.request().set_ascii(ascii::END);
        self.engine.settings.gap = 0;
        self.engine.settings.silence = ASCII_SILENCE;
    }

    /// Changes the line to a TCP stream: no silence before a request, and
    /// [`STREAM_SILENCE`] ends a frame.
    pub fn set_stream(&mut self) {
        self.engine.settings.gap = 0;
        self.engine.settings.silence = STREAM_SILENCE;
    }
}

impl<P: Port, S: Means, J: Job, const N: usize> Client<Serial<P, S, J>, J, N> {
    /// A client that sends RTU frames through a TCP stream, without a silence between
    /// frames and without broadcasts.
    pub fn over_tcp(port: P, means: S) -> Self {
        let mut client = Client::new(Serial::new(port, means));
        client.shared.broadcasts = false;
        client.line.set_stream();
        client
    }
}

impl<P: Port, S: Means, J: Job> Serial<P, S, J> {
    /// Reads and discards bytes that arrive while all requests only wait. If they stayed in
    /// the port, a program that sleeps until bytes arrive would wake up at once.
    #[cold]
    #[inline(never)]
    fn drop_late_bytes<const N: usize>(&mut self, shared: &mut Shared<J, N>, now: u32) {
        if self.engine.drop_received(now) < 0 {
            shared.disconnect();
        }
    }

    /// Passes a request to the engine and starts it.
    fn start(&mut self, job: J) -> Status {
        let unit = job.ticket().unit;
        self.engine.forget();
        self.engine.request().begin(job);
        self.engine.start(unit)
    }

    /// Stores the response in the request, and returns the status of the request.
    fn received(&mut self, job: &mut J, status: Status) -> Status {
        job.ticket_mut().exception = self.engine.exception_code();
        // The length is 0 after a broadcast or another request that has no response.
        let length = self.engine.request.length;
        if status != Status::OK || length == 0 {
            return status;
        }
        deliver(
            job,
            self.engine.storage.slice(rtu::PDU as u16, length.into()),
        )
    }
}

impl<P: Port, S: Means, J: Job> Line<J> for Serial<P, S, J> {
    const MAX_IN_FLIGHT: usize = 1;
    const BROADCASTS: bool = true;
    const HAS_IDS: bool = false;

    fn advance<const N: usize>(
        &mut self,
        shared: &mut Shared<J, N>,
        now: u32,
        fresh: bool,
    ) -> Option<J> {
        // The engine has the request only during this call.
        let mut status = Status::PENDING;
        if let Some(job) = shared.active.take() {
            self.engine.request().job = Some(job);
        } else {
            let Some(job) = shared.take_due(now, &mut self.engine.storage) else {
                if fresh && !shared.queue.is_empty() {
                    self.drop_late_bytes(shared, now);
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
            shared.disconnect();
        } else if is_answer(status) {
            shared.connected = true;
        }
        // The queue has space: the active request has always counted as part of it.
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
