//! A client's serial line, or a TCP stream that carries the frames of a serial line. One
//! request is in flight at a time.

use super::queue::RequestQueue;
use super::request::{is_answer, store_response, ClientRequest, RequestState, Stage};
use super::storage::ClientStorage;
use super::transaction::Serial;
use super::Transport;
use super::{Client, ASCII_SILENCE, STREAM_SILENCE};
use crate::engine::{LateUnits, MicrosSetting, Settings};
use crate::error::Status;
use crate::frame::{ascii, rtu};
use crate::port::Port;

impl<P: Port, S: ClientStorage, J: ClientRequest> Serial<P, S, J> {
    /// A serial line with ASCII frames.
    pub const fn ascii(port: P, storage: S) -> Self {
        let mut line = Serial::new(port, storage);
        line.set_ascii();
        line
    }

    /// Changes the line to ASCII frames: no silence before a request, and one second
    /// without a character ends an incomplete frame.
    pub const fn set_ascii(&mut self) {
        self.request().set_ascii(ascii::END);
        self.settings.gap = MicrosSetting::new(0);
        self.settings.silence = MicrosSetting::new(ASCII_SILENCE);
    }

    /// Changes the line to a TCP stream: no silence before a request, and
    /// [`STREAM_SILENCE`] ends a frame.
    pub const fn set_stream(&mut self) {
        self.settings.gap = MicrosSetting::new(0);
        self.settings.silence = MicrosSetting::new(STREAM_SILENCE);
    }
}

impl<P: Port, S: ClientStorage, J: ClientRequest, const N: usize> Client<Serial<P, S, J>, J, N> {
    /// A client that sends RTU frames through a TCP stream, without a silence between
    /// frames and without broadcasts.
    ///
    /// ```
    /// # include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/doc/pump.rs"));
    /// # fn main() -> Result<(), mbm::Error> {
    /// use mbm::client::{Client, Frame, Request};
    /// use mbm::server::SimulatedPort;
    ///
    /// let port = SimulatedPort::rtu_over_tcp(unit());
    /// let mut client: Client<_, Request, 4> = Client::over_tcp(port, Frame::new([0; 256]));
    /// client.queue(Request::write_single_coil(17, 0, true)?)?;
    /// assert_eq!(client.pending(), 1);
    /// # Ok(())
    /// # }
    /// ```
    pub const fn over_tcp(port: P, storage: S) -> Self {
        let mut client = Client::new(Serial::new(port, storage));
        client.queue.has_broadcast = false;
        client.line.set_stream();
        client
    }
}

impl<P: Port, S: ClientStorage, J: ClientRequest> Serial<P, S, J> {
    /// Reads and discards bytes that arrive while all requests only wait. If they stayed in
    /// the port, a program that sleeps until bytes arrive would wake up at once.
    #[cold]
    fn drop_late_bytes<const N: usize>(&mut self, queue: &mut RequestQueue<J, N>, now: u32) {
        let is_rtu = !self.request().is_ascii();
        match self.drop_received(now, is_rtu) {
            0 => {}
            ..0 => queue.disconnect(),
            // A unit may owe nothing any more, so a request may be due.
            _ => queue.changed = true,
        }
    }

    /// Passes a request to the engine and starts it.
    fn start_request(&mut self, request: J) -> Status {
        let unit = request.state().unit();
        // A refused request begins no search, which would clear it.
        self.exception = 0;
        self.request().begin(request);
        self.start(unit)
    }

    /// Stores the response in the request, and returns the status of the request.
    fn store_reply(&mut self, request: &mut J, status: Status) -> Status {
        request.state_mut().exception = self.exception_code();
        // The content is empty after a broadcast or another request that has no response.
        let content = self.content;
        if status != Status::OK || content == 0 {
            return status;
        }
        let pdu = rtu::PDU as u16;
        store_response(request, self.storage.slice(pdu, content - pdu))
    }
}

/// Microseconds for which a line leaves a unit alone, because it may still answer a request that
/// was cancelled. `now` is the time.
pub fn late_rest(
    state: &RequestState,
    late_units: &mut LateUnits,
    settings: &Settings,
    now: u32,
) -> u32 {
    if settings.quiet_time.get() == 0 || !state.has_reply() {
        return 0;
    }
    late_units.rest(state.unit(), now)
}

impl<P: Port, S: ClientStorage, J: ClientRequest> Transport<J> for Serial<P, S, J> {
    const HAS_BROADCAST: bool = true;
    const HAS_TRANSACTION_IDS: bool = false;

    type Port = P;
    type Storage = S;

    fn settings(&mut self) -> &mut Settings {
        &mut self.settings
    }

    fn port(&mut self) -> &mut P {
        &mut self.port
    }

    fn storage(&mut self) -> &mut S {
        &mut self.storage
    }

    fn accepted(&mut self, length: u16) -> (&mut P, &[u8]) {
        (&mut self.port, self.storage.slice(0, length))
    }

    fn advance<const N: usize>(
        &mut self,
        queue: &mut RequestQueue<J, N>,
        now: u32,
        fresh: bool,
    ) -> Option<J> {
        // The engine has the request only during this call.
        let mut status = Status::PENDING;
        if let Some(request) = queue.active.take() {
            self.request().client_request = Some(request);
        } else {
            let (late_units, settings) = (&mut self.late_units, &self.settings);
            let rest = |state: &RequestState| late_rest(state, late_units, settings, now);
            let due = match queue.is_held {
                true => None,
                false => queue.take_due(now, &mut self.storage, rest),
            };
            let Some(request) = due else {
                if fresh && !queue.queue.is_empty() {
                    self.drop_late_bytes(queue, now);
                }
                return None;
            };
            if request.state().is(Stage::Lost) {
                return queue.conclude(request, Status::LINK_LOST, now, &mut self.storage);
            }
            status = self.start_request(request);
        }
        if status == Status::PENDING {
            status = self.poll(now);
        }
        let mut request = self.request().client_request.take()?;
        if status == Status::PENDING {
            queue.active = Some(request);
            return None;
        }
        let status = self.store_reply(&mut request, status);
        if status == Status::LINK_LOST {
            queue.disconnect();
        } else if is_answer(status) {
            queue.note_answered(0);
        }
        // The queue has space: the active request has always counted as part of it.
        queue.conclude(request, status, now, &mut self.storage)
    }

    fn note_sent_late(&mut self, now: u32) {
        self.note_sent_late(now);
    }

    fn release(&mut self, request: Option<&J>) {
        let engine = self;
        let line = engine.settings.response_timeout;
        if let Some(request) = request {
            // The engine does not have the request now, so it takes the timeout of the line.
            let timeout = request
                .state()
                .response_timeout(&engine.storage, line.get());
            engine.settings.response_timeout = MicrosSetting::new(timeout);
        }
        engine.cancel();
        engine.settings.response_timeout = line;
    }

    fn forget_late_replies(&mut self) {
        self.forget_late_replies();
    }

    fn delay(&mut self, now: u32) -> Option<u32> {
        let is_pending = self.is_pending();
        is_pending.then(|| self.poll_delay(now))
    }
}
