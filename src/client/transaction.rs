//! The request in flight on a serial line, in the form that the engine needs.

use super::request::{data_of, ClientRequest, RequestState};
use super::storage::ClientStorage;
use crate::engine::{ascii, Engine, Transaction};
use crate::error::Status;
use crate::frame::{ascii as characters, rtu};
use crate::pdu::MAX_PDU;
use crate::port::Port;
use core::num::NonZeroU8;

/// A client's serial line: the engine, which has one request at a time, in RTU or ASCII frames.
pub type Serial<P, S, J> = Engine<P, S, ClientTransaction<P, S, J>>;

/// The functions that write and find ASCII frames. (Pointers, so that firmware without an
/// ASCII line does not contain them.)
#[derive(Debug)]
struct Ascii<P, S: ClientStorage, J> {
    encode: fn(&mut Serial<P, S, J>, content: u16),
    search: fn(&mut Serial<P, S, J>, received: u16) -> bool,
}

/// The request in flight.
#[derive(Debug)]
pub struct ClientTransaction<P, S: ClientStorage, J> {
    pub(super) client_request: Option<J>,
    /// `None` on an RTU line.
    ascii: Option<Ascii<P, S, J>>,
    /// The character that ends ASCII frames (function 08, sub-function 03).
    delimiter: u8,
    function: u8,
}

impl<P: Port, S: ClientStorage, J: ClientRequest> ClientTransaction<P, S, J> {
    /// Sends requests in ASCII frames, which end with the character `delimiter`.
    pub const fn set_ascii(&mut self, delimiter: u8) {
        self.delimiter = delimiter;
        self.ascii = Some(Ascii {
            encode,
            search: search_ascii,
        });
    }
}

impl<P, S: ClientStorage, J: ClientRequest> ClientTransaction<P, S, J> {
    /// Stores the request to be sent next.
    pub(super) fn begin(&mut self, client_request: J) {
        self.function = client_request.state().function();
        self.client_request = Some(client_request);
    }

    /// True if the line has ASCII frames.
    pub(super) fn is_ascii(&self) -> bool {
        self.ascii.is_some()
    }

    fn state(&self) -> Option<&RequestState> {
        self.client_request.as_ref().map(J::state)
    }

    /// Length of the request PDU; 0 if there is no request.
    fn request_length(&self) -> u8 {
        self.state().map_or(0, RequestState::request_length)
    }

    /// Writes the request PDU.
    fn emit(&self, pdu: &mut [u8]) {
        let Some(client_request) = &self.client_request else {
            return;
        };
        let state = client_request.state();
        state.emit(pdu, data_of(client_request));
    }
}

impl<P, S: ClientStorage, J: ClientRequest> Transaction<P, S> for ClientTransaction<P, S, J> {
    const NONE: Self = ClientTransaction {
        client_request: None,
        ascii: None,
        delimiter: 0,
        function: 0,
    };
    const IS_OF_MASTER: bool = false;

    fn function(&self) -> u8 {
        self.function
    }

    fn may_be_broadcast(&self) -> bool {
        self.state().is_some_and(RequestState::may_be_broadcast)
    }

    fn is_answered(&self) -> bool {
        self.state().is_none_or(RequestState::is_answered)
    }

    fn has_unique_reply(&self) -> bool {
        self.state().is_some_and(RequestState::returns_query_data)
    }

    fn response_timeout(engine: &Serial<P, S, J>) -> u32 {
        let line = engine.settings.response_timeout.get();
        match &engine.request.client_request {
            Some(request) => request.state().response_timeout(&engine.storage, line),
            None => line,
        }
    }

    fn fits(&self, space: u16) -> bool {
        let length = self.request_length();
        let frame = match self.ascii {
            Some(_) => ascii::frame_length(length),
            None => u16::from(length) + rtu::OVERHEAD as u16,
        };
        frame <= space
    }

    fn write(engine: &mut Serial<P, S, J>) {
        write(engine);
    }

    fn reply_length(&self) -> u16 {
        match self.state().map_or(0, RequestState::fixed_length) {
            // The end character ends an ASCII frame, so its length need not be known.
            _ if self.ascii.is_some() => u16::MAX,
            0 => 0,
            length => u16::from(length) + rtu::OVERHEAD as u16,
        }
    }

    fn is_reply(engine: &Serial<P, S, J>, front: u16, length: u16) -> bool {
        let whole = length - rtu::OVERHEAD as u16;
        let pdu = engine.storage.slice(front + rtu::PDU as u16, whole);
        let Some(client_request) = &engine.request.client_request else {
            return false;
        };
        let state = client_request.state();
        state.validate(pdu, data_of(client_request)) != Status::MALFORMED_REPLY
    }

    fn is_echo(engine: &Serial<P, S, J>, front: u16) -> bool {
        let Some(state) = engine.request.state() else {
            return false;
        };
        let length = u16::from(state.request_length());
        state.matches_echo(engine.storage.slice(front + rtu::PDU as u16, length))
    }

    fn find_ending_reply(engine: &mut Serial<P, S, J>, is_silent: bool) -> u16
    where
        P: Port,
    {
        // The buffer may be larger than any frame.
        let mut length = (engine.end() - engine.content).min(rtu::MAX_FRAME as u16);
        while length >= rtu::MIN_FRAME.into() {
            if engine.would_end(length, is_silent)
                && engine.check_end(length, engine.request.function)
            {
                return length;
            }
            length -= 1;
        }
        0
    }

    fn search(engine: &mut Serial<P, S, J>, first: u16, received: u16) -> bool
    where
        P: Port,
    {
        match &engine.request.ascii {
            Some(ascii) => (ascii.search)(engine, received),
            None => engine.search(first, received),
        }
    }
}

impl<P, S: ClientStorage, J: ClientRequest> Serial<P, S, J> {
    /// True if the last `length` bytes may be the frame of the reply, as far as their first bytes
    /// tell its length.
    fn would_end(&self, length: u16, is_silent: bool) -> bool {
        let front = self.end() - length;
        if self.storage.byte(front) != self.unit {
            return false;
        }
        let pdu = self
            .storage
            .slice(front + rtu::PDU as u16, length - rtu::PDU as u16);
        let whole = usize::from(length) - rtu::OVERHEAD;
        let end = if is_silent { whole } else { MAX_PDU + 1 };
        let expected = self
            .request
            .state()
            .and_then(|state| state.expected(pdu, end));
        usize::from(expected.map_or(0, NonZeroU8::get)) == whole
    }
}

/// Writes the frame of the request.
fn write<P, S: ClientStorage, J: ClientRequest>(engine: &mut Serial<P, S, J>) {
    let length = u16::from(engine.request.request_length());
    engine.storage.set_byte(0, engine.unit);
    engine.request.emit(engine.storage.bytes(1, length));
    let content = length + 1;
    match &engine.request.ascii {
        Some(ascii) => (ascii.encode)(engine, content),
        None => engine.append_crc(content),
    }
}

/// Converts unit and PDU at the front of the frame buffer into an ASCII frame.
fn encode<P, S: ClientStorage, J: ClientRequest>(engine: &mut Serial<P, S, J>, content: u16) {
    let space = engine.storage.capacity();
    let frame = engine.storage.bytes(0, space);
    // The frame fits: `fits` was checked when the request was started.
    let written = characters::encode(frame, content.into(), engine.request.delimiter);
    engine.set_frame_length(written.unwrap_or_default() as u16);
}

fn search_ascii<P: Port, S: ClientStorage, J: ClientRequest>(
    engine: &mut Serial<P, S, J>,
    received: u16,
) -> bool {
    engine.search_ascii(received, engine.request.delimiter)
}
