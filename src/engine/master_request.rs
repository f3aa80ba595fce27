//! The master's requests: one of ten functions, in RTU frames. The request determines the
//! length of its reply.

use super::rtu::EXCEPTION_FRAME;
use super::{Engine, Match, RequestSpec, RxFault, Words};
use crate::error::Status;
use crate::frame::rtu;
use crate::pdu::master_request::MasterRequest;
use crate::pdu::EXCEPTION;
use crate::FIRMWARE;

/// Bytes of a frame around its PDU: unit and CRC.
const AROUND_PDU: u8 = rtu::OVERHEAD as u8;

impl<P, S: Words> RequestSpec<P, S> for MasterRequest {
    const NONE: Self = MasterRequest::NONE;
    const HAS_FIXED_REPLY: bool = true;

    #[inline(always)]
    fn function(&self) -> u8 {
        MasterRequest::function(self)
    }

    #[inline(always)]
    fn may_be_broadcast(&self) -> bool {
        !self.is_read()
    }

    #[inline(always)]
    fn fits(&self, space: u8) -> bool {
        self.length() <= space.wrapping_sub(AROUND_PDU)
    }

    #[inline(always)]
    fn reply_length(&self, space: u8) -> u8 {
        let length = self.response_length() + AROUND_PDU;
        if length > space {
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
    fn find_reply(engine: &mut Engine<P, S, Self>) -> bool {
        let data = engine.request.reads();
        !FIRMWARE && data > 0 && engine.has_read(data) || engine.find_rtu_reply::<false>()
    }

    #[inline(always)]
    fn expected_length(engine: &mut Engine<P, S, Self>, front: u8, have: u8) -> u8 {
        let function = engine.storage.byte(front + 1) ^ engine.request.function();
        if function == EXCEPTION {
            return EXCEPTION_FRAME;
        }
        if function != 0 {
            return 0;
        }
        if cfg!(feature = "echo") && engine.echo {
            let known = (have - 1).min(engine.request.head_length());
            if matches_echo(engine, front, known) {
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
            engine.note_fault(RxFault::TOO_LONG);
        }
        engine.length
    }

    #[inline(always)]
    fn skip_or_keep_byte(engine: &mut Engine<P, S, Self>, front: u8) -> u8 {
        engine.skip_or_keep_byte(front)
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
    fn accept_deviating(engine: &mut Engine<P, S, Self>) -> bool {
        engine.accept_deviating()
    }

    #[cfg_attr(target_os = "none", inline(never))]
    fn validate(engine: &mut Engine<P, S, Self>, front: u8, _content: u8) -> Match {
        engine.exception = 0;
        if engine.storage.byte(front + 1) & EXCEPTION != 0 {
            engine.exception = engine.storage.byte(front + 2);
            return match Status::exception(engine.exception) {
                Status::MALFORMED_REPLY => Match::Unrelated,
                _ => Match::Reply,
            };
        }
        let is_echo = cfg!(feature = "echo") && engine.echo;
        let is_read = engine.request.is_read();
        // A read's reply repeats nothing of the request, so it is not compared, which would
        // take an AVR 100 cycles. A reply at the end of the buffer may be shorter than the
        // head.
        let head = engine.request.head_length();
        let matches_echo =
            (is_echo || !is_read) && engine.end - front > head && matches_echo(engine, front, head);
        if is_echo && matches_echo {
            engine.echo = false;
            return Match::Echo;
        }
        if matches_echo || is_read {
            Match::Reply
        } else {
            Match::Unrelated
        }
    }
}

/// Writes the frame of any request.
#[inline(never)]
fn write_any<P, S: Words>(engine: &mut Engine<P, S, MasterRequest>) {
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
            .load_words(end + 1, sends, engine.request.has_registers());
        end += sends;
        let last = engine.storage.byte(end) & engine.request.mask();
        engine.storage.set_byte(end, last);
        end += 1;
    }
    engine.append_crc(end);
}

/// True if the `count` bytes after the unit at `front` are equal to the request's.
#[cfg_attr(target_os = "none", inline(never))]
fn matches_echo<P, S: Words>(engine: &Engine<P, S, MasterRequest>, front: u8, count: u8) -> bool {
    let bytes = engine.storage.slice(front + 1, count);
    engine
        .request
        .head()
        .iter()
        .zip(bytes)
        .all(|(ours, theirs)| ours == theirs)
}
