//! The master's requests: one of ten functions, in RTU frames. The request determines the
//! length of its reply.

use super::search::EXCEPTION_FRAME;
use super::{Engine, Request, Seen, Verdict, Words};
use crate::error::Status;
use crate::frame::rtu;
use crate::pdu::query::Query;
use crate::pdu::EXCEPTION;
use crate::FIRMWARE;

/// Bytes of a frame around its PDU: unit and CRC.
const AROUND_PDU: u8 = rtu::OVERHEAD as u8;

impl<P, S: Words> Request<P, S> for Query {
    const NONE: Self = Query::NONE;
    const IS_PLAIN: bool = true;

    #[inline(always)]
    fn function(&self) -> u8 {
        Query::function(self)
    }

    #[inline(always)]
    fn may_be_broadcast(&self) -> bool {
        !self.is_read()
    }

    #[inline(always)]
    fn fits(&self, room: u8) -> bool {
        self.length() <= room.wrapping_sub(AROUND_PDU)
    }

    #[inline(always)]
    fn reply_length(&self, room: u8) -> u8 {
        let length = self.response_length() + AROUND_PDU;
        if length > room {
            0
        } else {
            length
        }
    }

    #[inline(always)]
    fn write(engine: &mut Engine<P, S, Self>) {
        match engine.request.two_words() {
            Some(words) if !FIRMWARE => engine.write_short(words),
            _ => write_any(engine),
        }
    }

    #[inline(always)]
    fn search(engine: &mut Engine<P, S, Self>) -> bool {
        let data = engine.request.reads();
        !FIRMWARE && data > 0 && engine.has_read(data) || engine.search_rtu::<false>()
    }

    #[inline(always)]
    fn wanted(engine: &mut Engine<P, S, Self>, front: u8, have: u8) -> u8 {
        let function = engine.storage.byte(front + 1) ^ engine.request.function();
        if function == EXCEPTION {
            return EXCEPTION_FRAME;
        }
        if function != 0 {
            return 0;
        }
        if cfg!(feature = "echo") && engine.echo {
            let known = (have - 1).min(engine.request.head_length());
            if agrees(engine, front, known) {
                let length = engine.request.length() + AROUND_PDU;
                // Until the echo is complete, the bytes may still turn out to be the reply.
                return if length > have { have + 1 } else { length };
            }
        }
        if engine.request.is_read() {
            if have == 2 {
                return 3;
            }
            if engine.storage.byte(front + 2) != engine.request.reads() {
                return 0;
            }
        }
        if engine.length == 0 {
            engine.see(Seen::TOO_LONG);
        }
        engine.length
    }

    #[inline(always)]
    fn pass_and_keep(engine: &mut Engine<P, S, Self>, front: u8) -> u8 {
        engine.pass_and_keep(front)
    }

    #[inline(always)]
    fn note_deviating(engine: &mut Engine<P, S, Self>, front: u8) {
        engine.note_deviating(front);
    }

    #[inline(always)]
    fn drop_kept(engine: &mut Engine<P, S, Self>) {
        engine.drop_kept();
    }

    #[inline(always)]
    fn take_deviating(engine: &mut Engine<P, S, Self>) -> bool {
        engine.take_deviating()
    }

    #[cfg_attr(target_os = "none", inline(never))]
    fn judge(engine: &mut Engine<P, S, Self>, front: u8, _content: u8) -> Verdict {
        engine.exception = 0;
        if engine.storage.byte(front + 1) & EXCEPTION != 0 {
            engine.exception = engine.storage.byte(front + 2);
            return match Status::exception(engine.exception) {
                Status::MALFORMED_REPLY => Verdict::Wrong,
                _ => Verdict::Right,
            };
        }
        let is_echo = cfg!(feature = "echo") && engine.echo;
        let is_read = engine.request.is_read();
        // A read's reply repeats nothing of the request, so it is not compared, which would
        // take an AVR 100 cycles. A reply at the end of the buffer may be shorter than the
        // head.
        let head = engine.request.head_length();
        let agrees =
            (is_echo || !is_read) && engine.end - front > head && agrees(engine, front, head);
        if is_echo && agrees {
            engine.echo = false;
            return Verdict::Echo;
        }
        if agrees || is_read {
            Verdict::Right
        } else {
            Verdict::Wrong
        }
    }
}

/// Writes the frame of any request.
#[inline(never)]
fn write_any<P, S: Words>(engine: &mut Engine<P, S, Query>) {
    let mut end = engine.request.head_length() + 1;
    engine.storage.set_byte(0, engine.unit);
    let head = engine.storage.bytes(1, engine.request.head_length());
    for (place, byte) in head.iter_mut().zip(engine.request.head()) {
        *place = *byte;
    }
    let sends = engine.request.sends();
    if sends > 0 {
        engine.storage.set_byte(end, sends);
        engine
            .storage
            .send_words(end + 1, sends, engine.request.has_registers());
        end += sends;
        let last = engine.storage.byte(end) & engine.request.mask();
        engine.storage.set_byte(end, last);
        end += 1;
    }
    engine.append_crc(end);
}

/// True if the `count` bytes after the unit at `front` are equal to the request's.
#[cfg_attr(target_os = "none", inline(never))]
fn agrees<P, S: Words>(engine: &Engine<P, S, Query>, front: u8, count: u8) -> bool {
    let bytes = engine.storage.slice(front + 1, count);
    engine
        .request
        .head()
        .iter()
        .zip(bytes)
        .all(|(ours, theirs)| ours == theirs)
}
