//! The request in flight on a serial line, in the form that the engine needs.

use super::job::{data_of, Job};
use super::means::Means;
use crate::engine::{ascii, Engine, Request, Seen, Verdict};
use crate::error::Status;
use crate::frame::{ascii as characters, rtu};
use crate::pdu::diagnostics::REPORT_SERVER_ID;
use crate::pdu::limits::MAX_PDU;
use crate::pdu::outline::Outline;
use crate::pdu::reply;
use crate::FIRMWARE;
use core::num::NonZeroU8;

/// The engine of a client on a serial line.
pub type ClientEngine<P, S, J> = Engine<P, S, ActiveRequest<P, S, J>>;

/// The functions that write and find ASCII frames. (Pointers, so that firmware without an
/// ASCII line does not contain them.)
struct Ascii<P, S: Means, J> {
    encode: fn(&mut ClientEngine<P, S, J>, content: u16),
    search: fn(&mut ClientEngine<P, S, J>) -> bool,
}

/// The request in flight.
pub struct ActiveRequest<P, S: Means, J> {
    pub(super) job: Option<J>,
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

impl<P, S: Means, J: Job> ActiveRequest<P, S, J> {
    /// Sends requests in ASCII frames, which end with the character `delimiter`.
    pub fn set_ascii(&mut self, delimiter: u8) {
        self.delimiter = delimiter;
        self.ascii = Some(Ascii {
            encode,
            search: search_ascii,
        });
    }

    /// Stores the request to be sent next.
    pub(super) fn begin(&mut self, job: J) {
        self.function = job.ticket().outline.function();
        self.job = Some(job);
        self.length = 0;
    }

    fn outline(&self) -> &Outline {
        match &self.job {
            Some(job) => &job.ticket().outline,
            None => &Outline::NONE,
        }
    }

    /// Writes the request PDU.
    fn emit(&self, pdu: &mut [u8]) {
        if let Some(job) = &self.job {
            job.ticket().outline.emit(pdu, data_of(job));
        }
    }
}

impl<P, S: Means, J: Job> Request<P, S> for ActiveRequest<P, S, J> {
    const NONE: Self = ActiveRequest {
        job: None,
        ascii: None,
        delimiter: 0,
        function: 0,
        frame_ended: false,
        length: 0,
    };
    const IS_PLAIN: bool = false;

    fn function(&self) -> u8 {
        self.function
    }

    fn may_be_broadcast(&self) -> bool {
        self.outline().may_be_broadcast()
    }

    fn is_answered(&self) -> bool {
        self.outline().is_answered()
    }

    fn fits(&self, room: u16) -> bool {
        let length = self.outline().request_length();
        let frame = match self.ascii {
            Some(_) => ascii::frame_length(length),
            None => u16::from(length) + rtu::OVERHEAD as u16,
        };
        frame <= room
    }

    #[inline(always)]
    fn write(engine: &mut ClientEngine<P, S, J>) {
        match engine.request.outline().two_words() {
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
    fn wanted(engine: &mut ClientEngine<P, S, J>, front: u16, have: u16) -> u16 {
        let frame_ended = engine.request.frame_ended;
        if !frame_ended && engine.request.function == REPORT_SERVER_ID {
            // If the CRC is right, the reply is as long as its byte count says. If not,
            // more bytes may belong to it.
            let counted = engine.reply_frame(front, have, 0);
            if counted > 0 && counted <= have && engine.is_right(front, counted) {
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
        if length > engine.storage.room() + engine.held {
            engine.see(Seen::TOO_LONG);
            return 0;
        }
        // The next byte may determine the length.
        length.min(have + 1)
    }

    fn judge(engine: &mut ClientEngine<P, S, J>, front: u16, content: u16) -> Verdict {
        let pdu = engine.storage.slice(front + 1, content - 1);
        let request = &mut engine.request;
        request.length = pdu.len() as u8;
        let Some(job) = &request.job else {
            return Verdict::Wrong;
        };
        let outline = &job.ticket().outline;
        if cfg!(feature = "echo")
            && engine.echo
            && request.length == outline.request_length()
            && outline.agrees(pdu)
        {
            engine.echo = false;
            return Verdict::Echo;
        }
        engine.exception = reply::exception_code(pdu).unwrap_or(0);
        match outline.judge(pdu, data_of(job)) {
            Status::MALFORMED_REPLY => Verdict::Wrong,
            _ => Verdict::Right,
        }
    }

    #[cfg_attr(not(target_os = "none"), inline(always))]
    fn search(engine: &mut ClientEngine<P, S, J>) -> bool {
        if let Some(ascii) = &engine.request.ascii {
            return (ascii.search)(engine);
        }
        engine.request.frame_ended = false;
        if !FIRMWARE {
            if let Some(data) = engine.request.outline().data_of_read() {
                if engine.has_read(data) {
                    engine.request.length = data + 2;
                    return true;
                }
            }
        }
        engine.search_rtu::<false>()
    }

    fn search_silent(engine: &mut ClientEngine<P, S, J>) -> bool {
        if engine.request.ascii.is_some() {
            return false;
        }
        engine.request.frame_ended = true;
        engine.skim(0)
    }

    fn content(&self, length: u16) -> u16 {
        match self.ascii {
            Some(_) => ascii::content(length),
            None => length - u16::from(rtu::CRC),
        }
    }
}

impl<P, S: Means, J: Job> ClientEngine<P, S, J> {
    /// The length of the reply's frame, which begins with the `have` bytes at `front`. While
    /// these bytes do not determine the length, the least possible length; 0 if no reply
    /// begins with them. For a reply whose length only its end shows, `whole` is the length
    /// of its PDU.
    fn reply_frame(&self, front: u16, have: u16, whole: usize) -> u16 {
        let pdu = self
            .storage
            .slice(front + rtu::PDU as u16, have - rtu::PDU as u16);
        let outline = self.request.outline();
        let length = if cfg!(feature = "echo") && self.echo && outline.agrees(pdu) {
            outline.request_length()
        } else {
            outline.expected(pdu, whole).map_or(0, NonZeroU8::get)
        };
        if length == 0 {
            return 0;
        }
        u16::from(length) + rtu::OVERHEAD as u16
    }
}

/// Writes the frame of any request.
#[inline(never)]
fn write_any<P, S: Means, J: Job>(engine: &mut ClientEngine<P, S, J>) {
    let length = u16::from(engine.request.outline().request_length());
    engine.storage.set_byte(0, engine.unit);
    engine.request.emit(engine.storage.bytes(1, length));
    let content = length + 1;
    match &engine.request.ascii {
        Some(ascii) => (ascii.encode)(engine, content),
        None => engine.append_crc(content),
    }
}

/// Converts unit and PDU at the front of the frame buffer into an ASCII frame.
fn encode<P, S: Means, J: Job>(engine: &mut ClientEngine<P, S, J>, content: u16) {
    let room = engine.storage.room();
    let frame = engine.storage.bytes(0, room);
    // The frame fits: `fits` was checked when the request was started.
    let written = characters::encode(frame, content.into(), engine.request.delimiter);
    engine.set_frame_length(written.unwrap_or_default() as u16);
}

fn search_ascii<P, S: Means, J: Job>(engine: &mut ClientEngine<P, S, J>) -> bool {
    engine.request.frame_ended = true;
    engine.search_ascii(engine.request.delimiter)
}
