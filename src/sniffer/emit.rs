//! Makes events of the frames and noise that the sniffer finds.

use super::event::{Event, EventKind};
use super::find::{Context, MIN_RTU};
use super::pairing::{age, FrameRole, ObservedFrame, State};
use super::{Sniffer, Step};
use crate::error::Status;
use crate::frame::{tcp, Framing};
use crate::pdu::custom::Function;
use crate::pdu::request::Request;
use crate::pdu::response::Response;
use crate::pdu::EXCEPTION;

impl Sniffer {
    /// Reports the timeout of a request.
    pub(super) fn expire<'b>(&mut self, index: usize, now: u32) -> Event<'b> {
        let slot = self.requests.get(index);
        self.requests.set_state(index, State::Late);
        self.idle_for = 0;
        Event {
            kind: EventKind::Timeout,
            status: Status::RESPONSE_TIMED_OUT,
            time: now,
            response_time: age(now, slot.time),
            transaction: slot.transaction,
            unit: slot.unit,
            function: slot.asked.function(),
            frame: &[],
            pdu: &[],
            length: 0,
            asked: Some(slot.asked),
        }
    }

    /// Turns a step into an event, and moves the stream past it.
    // In line, the frame of the function that calls it is too large for LLVM.
    #[cfg_attr(target_arch = "xtensa", inline(never))]
    pub(super) fn emit_event<'b>(
        &mut self,
        buffer: &'b mut [u8],
        functions: &[Function],
        index: usize,
        step: Step,
        now: u32,
    ) -> Event<'b> {
        let is_unchanged = self.is_unchanged(now);
        self.idle_for = 0;
        let part: &'b [u8] = self.part(buffer, index);
        let timing = self.timing;
        let framing = self.framing;
        let (context, stream) = self.split(functions, index, now);
        match step {
            Step::Noise {
                length,
                status,
                more,
            } => {
                let bytes = part.get(stream.start.into()..).unwrap_or_default();
                let bytes = bytes.get(..length).unwrap_or_default();
                let end = stream.start + length as u16;
                let is_ended = stream.silences(stream.start).any(|at| at == end)
                    || (end == stream.end && stream.quiet(now) >= timing.silence);
                let time = stream.time(end, &timing);
                let event = noise(framing, &context, bytes, status, is_ended);
                // The rest of a frame that is too long belongs to it.
                let cut = stream.cut && !is_ended;
                stream.consume(end);
                stream.cut = cut;
                stream.skip = more as u16;
                Event {
                    time,
                    length: length + more,
                    ..event
                }
            }
            Step::Frame {
                total,
                content,
                roles,
            } => {
                let end = stream.at + total as u16;
                let time = stream.time(end, &timing);
                let bytes = part.get(stream.at.into()..).unwrap_or_default();
                let bytes = bytes.get(..content).unwrap_or_default();
                let event = self.frame(functions, bytes, roles, time, is_unchanged);
                if event.kind == EventKind::Timeout {
                    // The frame itself is the next event.
                    return event;
                }
                self.split(functions, index, now).1.consume(end);
                Event {
                    length: total,
                    ..event
                }
            }
        }
    }

    /// Reports a frame, or first the timeout of a request that ended before the frame.
    fn frame<'b>(
        &mut self,
        functions: &[Function],
        frame: &'b [u8],
        roles: Option<(bool, bool)>,
        time: u32,
        is_unchanged: bool,
    ) -> Event<'b> {
        let (transaction, unit, pdu) = content(self.framing, frame);
        let code = pdu.first().copied().unwrap_or_default();
        let mut event = Event {
            kind: EventKind::BadCrc,
            status: Status::INVALID_CRC,
            time,
            response_time: 0,
            transaction,
            unit,
            function: code & !EXCEPTION,
            frame,
            pdu,
            length: frame.len(),
            asked: None,
        };
        let Some((request, response)) = roles else {
            return event;
        };
        let request = request && code & EXCEPTION == 0;
        let overdue = if is_unchanged {
            None
        } else {
            self.find_overdue(time)
        };
        if let Some(overdue) = overdue {
            return self.expire(overdue, time);
        }
        let frame = ObservedFrame {
            unit,
            transaction,
            pdu,
            request,
            response,
        };
        match self.requests.role(&frame, functions, time) {
            FrameRole::Request => {
                let one_at_a_time = self.framing != Framing::Tcp;
                if let Some(ended) = self.requests.ended_by(&frame, one_at_a_time, time) {
                    return self.expire(ended, time);
                }
                let is_broadcast = unit == 0 && self.framing != Framing::Tcp;
                self.requests.keep(&frame, is_broadcast, functions, time);
                event.kind = EventKind::Request;
                event.status = Request::parse_with(pdu, functions).map(drop).into();
            }
            FrameRole::Reply(index) => {
                let slot = self.requests.get(index);
                self.requests.take_reply(index, &frame, time);
                event.asked = Some(slot.asked);
                event.response_time = age(time, slot.time);
                event.kind = match slot.state {
                    State::Open if code & EXCEPTION != 0 => EventKind::Exception,
                    State::Open => EventKind::Reply,
                    _ => EventKind::Unpaired,
                };
                event.status = answer(pdu, functions);
            }
            FrameRole::Unpaired(is_waited_for) => {
                event.kind = EventKind::Unpaired;
                event.status = match answer(pdu, functions) {
                    Status::OK if is_waited_for => Status::MALFORMED_REPLY,
                    status => status,
                };
            }
        }
        event
    }
}

/// Transaction, unit and PDU of a frame.
fn content(framing: Framing, frame: &[u8]) -> (u16, u8, &[u8]) {
    match (framing, frame) {
        (Framing::Rtu | Framing::RtuOverTcp, [unit, pdu @ .., _, _]) => (0, *unit, pdu),
        (Framing::Ascii, [unit, pdu @ .., _]) => (0, *unit, pdu),
        (Framing::Tcp, frame) => match tcp::parse(frame) {
            Ok(adu) => (adu.transaction, adu.unit, adu.pdu),
            Err(_) => (0, 0, &[]),
        },
        _ => (0, 0, &[]),
    }
}

/// The status of a response PDU.
fn answer(pdu: &[u8], functions: &[Function]) -> Status {
    match (Response::parse_with(pdu, functions), pdu) {
        (Err(refused), _) => refused.status(),
        (Ok(_), [code, exception, ..]) if code & EXCEPTION != 0 => Status::exception(*exception),
        (Ok(_), _) => Status::OK,
    }
}

/// Reports bytes without a frame. On an RTU line they are a damaged frame if they have the
/// length of a frame, or if silence surrounds them and they begin like a frame.
fn noise<'b>(
    framing: Framing,
    context: &Context,
    bytes: &'b [u8],
    status: Status,
    is_ended: bool,
) -> Event<'b> {
    let is_rtu = matches!(framing, Framing::Rtu | Framing::RtuOverTcp);
    let looks_like_one = (MIN_RTU..=framing.max_frame()).contains(&bytes.len())
        && ((is_ended && context.is_known(bytes)) || context.has_length(bytes, bytes.len()));
    let is_damaged = is_rtu && status == Status::OK && looks_like_one;
    let (_, unit, pdu) = if is_damaged {
        content(framing, bytes)
    } else {
        (0, 0, &[][..])
    };
    Event {
        kind: if is_damaged {
            EventKind::BadCrc
        } else {
            EventKind::Noise
        },
        status: if is_damaged {
            Status::INVALID_CRC
        } else {
            status
        },
        time: 0,
        response_time: 0,
        transaction: 0,
        unit,
        function: pdu.first().copied().unwrap_or_default() & !EXCEPTION,
        frame: bytes,
        pdu,
        length: bytes.len(),
        asked: None,
    }
}
