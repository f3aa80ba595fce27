//! The request that is under way on a serial line, as the engine knows it.

use super::job::{bytes, Job};
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

/// The engine of a client.
pub type ClientEngine<P, S, J> = Engine<P, S, ActiveRequest<P, S, J>>;

/// How the frames of an ASCII line are written and found. (Pointers, so that firmware
/// without such a line carries none of it.)
struct Ascii<P, S: Means, J> {
    encode: fn(&mut ClientEngine<P, S, J>, content: u16),
    search: fn(&mut ClientEngine<P, S, J>) -> bool,
}

/// The request under way.
pub struct ActiveRequest<P, S: Means, J> {
    pub(super) job: Option<J>,
    /// How it travels if that is not in RTU frames.
    ascii: Option<Ascii<P, S, J>>,
    /// The character that ends ASCII frames (08, sub-function 03).
    delimiter: u8,
    function: u8,
    /// Nothing more belongs to the frame that arrives.
    ended: bool,
    /// Length of the response PDU; 0 if there is none.
    pub(super) length: u8,
}

impl<P, S: Means, J: Job> ActiveRequest<P, S, J> {
    /// Has requests travel in ASCII frames that `delimiter` ends.
    pub fn set_ascii(&mut self, delimiter: u8) {
        self.delimiter = delimiter;
        self.ascii = Some(Ascii {
            encode,
            search: search_ascii,
        });
    }

    /// Takes a request to be started.
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
            job.ticket().outline.emit(pdu, bytes(job));
        }
    }
}

impl<P, S: Means, J: Job> Request<P, S> for ActiveRequest<P, S, J> {
    const NONE: Self = ActiveRequest {
        job: None,
        ascii: None,
        delimiter: 0,
        function: 0,
        ended: false,
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
        let ended = engine.request.ended;
        if !ended && engine.request.function == REPORT_SERVER_ID {
            // Complete as it is counted if the CRC says so. More may come if not.
            let counted = engine.reply_frame(front, have, 0);
            if counted > 0 && counted <= have && engine.is_right(front, counted) {
                return counted;
            }
        }
        let pdu = usize::from(have) - rtu::PDU;
        let length = engine.reply_frame(
            front,
            have,
            if ended {
                // What arrived last is the CRC.
                pdu.saturating_sub(rtu::CRC.into())
            } else {
                // While more may come, it is never complete, but for the longest.
                pdu.min(MAX_PDU)
            },
        );
        if length > engine.storage.room() + engine.held {
            engine.see(Seen::TOO_LONG);
            return 0;
        }
        // The next byte may tell more.
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
        match outline.judge(pdu, bytes(job)) {
            Status::MALFORMED_REPLY => Verdict::Wrong,
            _ => Verdict::Right,
        }
    }

    #[cfg_attr(not(target_os = "none"), inline(always))]
    fn search(engine: &mut ClientEngine<P, S, J>) -> bool {
        if let Some(ascii) = &engine.request.ascii {
            return (ascii.search)(engine);
        }
        engine.request.ended = false;
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
        engine.request.ended = true;
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
    /// The length of the frame that the reply has which begins with the `have` bytes at
    /// `front`, or the least length while they do not tell; 0 if no reply begins so. Where
    /// nothing but its end tells, the PDU has `whole` bytes.
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

/// Writes the frame of the request, whatever it is.
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

/// Turns unit and PDU at the front of the frame buffer into an ASCII frame.
fn encode<P, S: Means, J: Job>(engine: &mut ClientEngine<P, S, J>, content: u16) {
    let room = engine.storage.room();
    let frame = engine.storage.bytes(0, room);
    // It fits, or the request had not been started.
    let written = characters::encode(frame, content.into(), engine.request.delimiter);
    engine.set_frame_length(written.unwrap_or_default() as u16);
}

fn search_ascii<P, S: Means, J: Job>(engine: &mut ClientEngine<P, S, J>) -> bool {
    engine.request.ended = true;
    engine.search_ascii(engine.request.delimiter)
}
