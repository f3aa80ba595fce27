//! The request in flight on a serial line, in the form that the engine needs.

use super::request::{data_of, ClientRequest};
use super::storage::ClientStorage;
use crate::engine::{ascii, Engine, Match, RequestSpec, RxFault};
use crate::error::Status;
use crate::frame::{ascii as characters, rtu};
use crate::pdu::diagnostics::REPORT_SERVER_ID;
use crate::pdu::header::RequestHeader;
use crate::pdu::limits::MAX_PDU;
use crate::pdu::reply;
use crate::FIRMWARE;
use core::num::NonZeroU8;

/// The engine of a client on a serial line.
pub type ClientEngine<P, S, J> = Engine<P, S, ActiveRequest<P, S, J>>;

/// The functions that write and find ASCII frames. (Pointers, so that firmware without an
/// ASCII line does not contain them.)
struct Ascii<P, S: ClientStorage, J> {
    encode: fn(&mut ClientEngine<P, S, J>, content: u16),
    find_reply: fn(&mut ClientEngine<P, S, J>) -> bool,
}

/// The request in flight.
pub struct ActiveRequest<P, S: ClientStorage, J> {
    pub(super) client_request: Option<J>,
    /// `None` on an RTU line.
    ascii: Option<Ascii<P, S, J>>,
    /// The character that ends ASCII frames (function 08, sub-function 03).
    delimiter: u8,
    function: u8,
    /// The received frame is over: the line is silent, or its end character arrived.
    frame_ended: bool,
    /// Length of the response PDU in bytes; 0 if there is no response.
    pub(super) length: u8,
}

impl<P, S: ClientStorage, J: ClientRequest> ActiveRequest<P, S, J> {
    /// Sends requests in ASCII frames, which end with the character `delimiter`.
    pub fn set_ascii(&mut self, delimiter: u8) {
        self.delimiter = delimiter;
        self.ascii = Some(Ascii {
            encode,
            find_reply: find_ascii_reply,
        });
    }

    /// Stores the request to be sent next.
    pub(super) fn begin(&mut self, client_request: J) {
        self.function = client_request.state().header.function();
        self.client_request = Some(client_request);
        self.length = 0;
    }

    fn header(&self) -> &RequestHeader {
        match &self.client_request {
            Some(client_request) => &client_request.state().header,
            None => &RequestHeader::NONE,
        }
    }

    /// Writes the request PDU.
    fn emit(&self, pdu: &mut [u8]) {
        if let Some(client_request) = &self.client_request {
            client_request
                .state()
                .header
                .emit(pdu, data_of(client_request));
        }
    }
}

impl<P, S: ClientStorage, J: ClientRequest> RequestSpec<P, S> for ActiveRequest<P, S, J> {
    const NONE: Self = ActiveRequest {
        client_request: None,
        ascii: None,
        delimiter: 0,
        function: 0,
        frame_ended: false,
        length: 0,
    };
    const HAS_FIXED_REPLY: bool = false;

    fn function(&self) -> u8 {
        self.function
    }

    fn may_be_broadcast(&self) -> bool {
        self.header().may_be_broadcast()
    }

    fn is_answered(&self) -> bool {
        self.header().is_answered()
    }

    fn has_unique_reply(&self) -> bool {
        self.header().returns_query_data()
    }

    #[cfg_attr(target_os = "none", inline(never))]
    fn response_timeout(engine: &mut ClientEngine<P, S, J>) -> u32 {
        let line = engine.settings.response_timeout;
        match &engine.request.client_request {
            Some(request) => request.state().response_timeout(&mut engine.storage, line),
            None => line,
        }
    }

    fn fits(&self, space: u16) -> bool {
        let length = self.header().request_length();
        let frame = match self.ascii {
            Some(_) => ascii::frame_length(length),
            None => u16::from(length) + rtu::OVERHEAD as u16,
        };
        frame <= space
    }

    #[inline(always)]
    fn write(engine: &mut ClientEngine<P, S, J>) {
        match engine.request.header().two_words() {
            Some(words) if !FIRMWARE && engine.request.ascii.is_none() => {
                engine.write_short(*words);
            }
            _ => write_any(engine),
        }
    }

    fn reply_length(&self, _: u16) -> u16 {
        0
    }

    #[cfg_attr(target_os = "none", inline(never))]
    fn expected_length(engine: &mut ClientEngine<P, S, J>, front: u16, have: u16) -> u16 {
        let frame_ended = engine.request.frame_ended;
        if !frame_ended && engine.request.function == REPORT_SERVER_ID {
            // If the CRC is right, the reply is as long as its byte count says. If not,
            // more bytes may belong to it.
            let counted = engine.reply_frame(front, have, 0);
            if counted > 0 && counted <= have && engine.has_right_crc(front, counted) {
                return counted;
            }
        }
        let pdu = usize::from(have) - rtu::PDU;
        let length = engine.reply_frame(
            front,
            have,
            if frame_ended {
                // The last two bytes are the CRC.
                pdu.saturating_sub(rtu::CRC.into())
            } else {
                // While more bytes may arrive, only a PDU of the greatest length is complete.
                pdu.min(MAX_PDU)
            },
        );
        if length > engine.storage.capacity() + engine.held {
            engine.note_fault(RxFault::TOO_LONG);
            return 0;
        }
        // The next byte may determine the length.
        length.min(have + 1)
    }

    fn validate(engine: &mut ClientEngine<P, S, J>, front: u16, content: u16) -> Match {
        let pdu = engine.storage.slice(front + 1, content - 1);
        let request = &mut engine.request;
        request.length = pdu.len() as u8;
        let Some(client_request) = &request.client_request else {
            return Match::Unrelated;
        };
        let header = &client_request.state().header;
        if cfg!(feature = "echo")
            && engine.echo
            && request.length == header.request_length()
            && header.matches_echo(pdu)
        {
            engine.echo = false;
            return Match::Echo;
        }
        engine.exception = reply::exception_code(pdu).unwrap_or(0);
        match header.validate(pdu, data_of(client_request)) {
            Status::MALFORMED_REPLY => Match::Unrelated,
            _ => Match::Reply,
        }
    }

    #[cfg_attr(not(target_os = "none"), inline(always))]
    fn find_reply(engine: &mut ClientEngine<P, S, J>) -> bool {
        if let Some(ascii) = &engine.request.ascii {
            return (ascii.find_reply)(engine);
        }
        engine.request.frame_ended = false;
        if !FIRMWARE {
            if let Some(data) = engine.request.header().data_of_read() {
                if engine.has_read(data) {
                    engine.request.length = data + 2;
                    return true;
                }
            }
        }
        engine.find_rtu_reply::<false>()
    }

    fn find_reply_in_silence(engine: &mut ClientEngine<P, S, J>) -> bool {
        if engine.request.ascii.is_some() {
            return false;
        }
        engine.request.frame_ended = true;
        engine.resync(0)
    }

    fn content(&self, length: u16) -> u16 {
        match self.ascii {
            Some(_) => ascii::content(length),
            None => length - u16::from(rtu::CRC),
        }
    }
}

impl<P, S: ClientStorage, J: ClientRequest> ClientEngine<P, S, J> {
    /// The length of the reply's frame, which begins with the `have` bytes at `front`. While
    /// these bytes do not determine the length, the least possible length; 0 if no reply
    /// begins with them. For a reply whose length only its end shows, `whole` is the length
    /// of its PDU.
    fn reply_frame(&self, front: u16, have: u16, whole: usize) -> u16 {
        let pdu = self
            .storage
            .slice(front + rtu::PDU as u16, have - rtu::PDU as u16);
        let header = self.request.header();
        let length = if cfg!(feature = "echo") && self.echo && header.matches_echo(pdu) {
            header.request_length()
        } else {
            header.expected(pdu, whole).map_or(0, NonZeroU8::get)
        };
        if length == 0 {
            return 0;
        }
        u16::from(length) + rtu::OVERHEAD as u16
    }
}

/// Writes the frame of any request.
#[inline(never)]
fn write_any<P, S: ClientStorage, J: ClientRequest>(engine: &mut ClientEngine<P, S, J>) {
    let length = u16::from(engine.request.header().request_length());
    engine.storage.set_byte(0, engine.unit);
    engine.request.emit(engine.storage.bytes(1, length));
    let content = length + 1;
    match &engine.request.ascii {
        Some(ascii) => (ascii.encode)(engine, content),
        None => engine.append_crc(content),
    }
}

/// Converts unit and PDU at the front of the frame buffer into an ASCII frame.
fn encode<P, S: ClientStorage, J: ClientRequest>(engine: &mut ClientEngine<P, S, J>, content: u16) {
    let space = engine.storage.capacity();
    let frame = engine.storage.bytes(0, space);
    // The frame fits: `fits` was checked when the request was started.
    let written = characters::encode(frame, content.into(), engine.request.delimiter);
    engine.set_frame_length(written.unwrap_or_default() as u16);
}

fn find_ascii_reply<P, S: ClientStorage, J: ClientRequest>(
    engine: &mut ClientEngine<P, S, J>,
) -> bool {
    engine.request.frame_ended = true;
    engine.find_ascii_reply(engine.request.delimiter)
}
