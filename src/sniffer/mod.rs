//! A sniffer: finds the frames on a bus that others use, and pairs requests with
//! replies. It only listens.
//!
//! Nobody tells which side speaks. An RTU frame is therefore looked for with the
//! lengths of a request and of a response, and is right if its CRC is; which of
//! the two it is, the request before it decides. What is no frame costs one byte,
//! and the search goes on behind it.

mod emit;
mod event;
mod find;
mod pairing;
mod stream;

pub use event::{Event, EventKind};
pub use pairing::RequestStart;

use crate::error::Status;
use crate::frame::{ascii, Framing};
use crate::pdu::custom::Function;
use crate::time::{character, silence, DEFAULT_SILENCE};
use crate::FIRMWARE;
use find::{Candidate, Context};
use pairing::Requests;
use stream::{RxStream, Timing};

/// The least bytes of a buffer; [`Framing::max_frame`] hold any frame, twice as
/// many where the directions are fed apart.
pub const MIN_BUFFER: usize = 32;

/// How long a request may stay unanswered, at first, in microseconds.
pub const DEFAULT_TIMEOUT: u32 = 1_000_000;

/// For so many timeouts a late reply is known to answer its request. Later, the
/// next frame like it is more likely another's.
const LATE: u32 = 10;

/// How long the rest of an RTU frame is waited for, at first: time stamps of a
/// USB adapter are off by 16 ms and more.
const RTU_PATIENCE: u32 = 50_000;

/// How long the rest of other frames is waited for, at first (serial line guide
/// V1.02, 2.5.2.1).
const PATIENCE: u32 = 1_000_000;

/// Where bytes were heard.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Tap {
    /// On a line that carries both directions.
    Both,
    /// Where only the client sends.
    Client,
    /// Where only servers send.
    Server,
}

/// A sniffer. The buffer is the caller's and is passed to each call.
#[derive(Clone, Copy, Debug)]
pub struct Sniffer {
    framing: Framing,
    end: u8,
    is_apart: bool,
    timeout: u32,
    timing: Timing,
    lanes: [RxStream; 2],
    requests: Requests,
    /// For so long from then on, time alone brings nothing to tell of.
    calm_from: u32,
    calm_for: u32,
}

/// What there is to tell of, as places in the buffer.
#[derive(Clone, Copy)]
enum Step {
    Frame {
        total: usize,
        content: usize,
        right: Option<(bool, bool)>,
    },
    Junk {
        length: usize,
        status: Status,
        more: usize,
    },
}

impl Sniffer {
    /// A sniffer that has heard nothing.
    pub const fn new(framing: Framing) -> Self {
        let frame_timeout = match framing {
            Framing::Rtu | Framing::RtuOverTcp => RTU_PATIENCE,
            Framing::Ascii | Framing::Tcp => PATIENCE,
        };
        Sniffer {
            framing,
            end: ascii::END,
            is_apart: false,
            timeout: DEFAULT_TIMEOUT,
            timing: Timing {
                character: 0,
                silence: DEFAULT_SILENCE,
                frame_timeout,
            },
            lanes: [RxStream::EMPTY; 2],
            requests: Requests::NONE,
            calm_from: 0,
            calm_for: 0,
        }
    }

    /// Sets the rate, from which the silence between frames follows, and when
    /// each of several bytes that are fed at once arrived; 0 is untold.
    pub const fn set_baud_rate(&mut self, baud: u32) {
        self.calm_for = 0;
        self.timing.silence = silence(baud);
        self.timing.character = if baud == 0 { 0 } else { character(baud) as u32 };
    }

    /// Sets how long a request may stay unanswered, in microseconds. For ten times
    /// as long, a late reply is still known to answer it.
    pub const fn set_timeout(&mut self, timeout: u32) {
        self.calm_for = 0;
        self.timeout = timeout;
    }

    /// Sets how long the rest of a frame is waited for, in microseconds: how
    /// coarse the time stamps are.
    pub const fn set_frame_timeout(&mut self, frame_timeout: u32) {
        self.calm_for = 0;
        self.timing.frame_timeout = frame_timeout;
    }

    /// Sets the last character of ASCII frames.
    pub const fn set_end(&mut self, end: u8) {
        self.calm_for = 0;
        let [first, second] = &mut self.lanes;
        first.searched = 0;
        second.searched = 0;
        self.end = end;
    }

    /// The lane of a tap and its part of the buffer.
    fn part<'a>(&self, buffer: &'a mut [u8], stream: usize) -> &'a mut [u8] {
        // Places in the buffer are 16 bits.
        let most = buffer.len().min(u16::MAX.into());
        let buffer = buffer.get_mut(..most).unwrap_or_default();
        if !self.is_apart {
            return buffer;
        }
        let half = if stream == 0 {
            buffer.get_mut(..most / 2)
        } else {
            buffer.get_mut(most / 2..)
        };
        half.unwrap_or_default()
    }

    /// Takes bytes of which the last arrived now, in microseconds; how many there
    /// was room for. Call [`Sniffer::next`] until there is none, then feed the
    /// rest with the same time. Bytes heard on both directions' line and bytes
    /// heard apart do not mix: what is not told of is forgotten at a change.
    pub fn feed(&mut self, buffer: &mut [u8], tap: Tap, bytes: &[u8], now: u32) -> usize {
        let is_apart = tap != Tap::Both;
        if is_apart != self.is_apart {
            self.is_apart = is_apart;
            self.lanes = [RxStream::EMPTY; 2];
        }
        let index = usize::from(tap == Tap::Server);
        let part = self.part(buffer, index);
        let is_ascii = self.framing == Framing::Ascii;
        let [first, second] = &mut self.lanes;
        let stream = if index == 0 { first } else { second };
        let may_decide = |byte: &u8| *byte == ascii::START || *byte == self.end;
        if is_ascii && bytes.iter().any(may_decide) {
            stream.look_again();
        }
        match bytes {
            [byte] if !FIRMWARE && stream.feed_next(part, *byte, now, &self.timing) => 1,
            _ => stream.feed(part, bytes, now, &self.timing),
        }
    }

    /// What happened next, up to now; none if nothing more is known yet. It
    /// borrows from the buffer. To be called after each feed until there is none,
    /// and now and then while nothing arrives; with the same functions each time.
    pub fn next<'b>(
        &mut self,
        buffer: &'b mut [u8],
        functions: &[Function],
        now: u32,
    ) -> Option<Event<'b>> {
        if self.only_waits(buffer, functions, now) {
            return None;
        }
        self.look(buffer, functions, now)
    }

    /// As [`Sniffer::next`], of what is more than the beginning of a frame.
    #[cfg_attr(not(target_os = "none"), inline(never))]
    pub fn look<'b>(
        &mut self,
        buffer: &'b mut [u8],
        functions: &[Function],
        now: u32,
    ) -> Option<Event<'b>> {
        // What was heard first is told first.
        let is_later = self.is_apart && self.waited(1, now) > self.waited(0, now);
        let order = if is_later { [1, 0] } else { [0, 1] };
        // Else requests have come or gone, and what a lane holds may mean something else.
        let only_bytes = self.is_early(now);
        for index in order {
            if only_bytes && self.lanes.get(index)?.is_settled(now) {
                continue;
            }
            if let Some(step) = self.step(buffer, functions, index, now) {
                return Some(self.emit_event(buffer, functions, index, step, now));
            }
        }
        if only_bytes {
            return None;
        }
        // Bytes that are not understood yet may hold the reply.
        let known = now.wrapping_sub(self.waited(0, now).max(self.waited(1, now)));
        if let Some(overdue) = self.overdue(known) {
            return Some(self.expire(overdue, now));
        }
        self.calm_from = now;
        self.calm_for = self.requests.calm(now, self.timeout, self.late());
        None
    }

    /// True if [`Sniffer::next`] has nothing to tell of and need not look: so it is
    /// after most bytes that are fed one by one.
    #[inline]
    pub fn is_calm(&self, now: u32) -> bool {
        let [first, second] = &self.lanes;
        self.is_early(now) && first.is_settled(now) && (!self.is_apart || second.is_settled(now))
    }

    /// True if no request came or went since the last look, and none is overdue.
    #[inline(always)]
    const fn is_early(&self, now: u32) -> bool {
        now.wrapping_sub(self.calm_from) < self.calm_for
    }

    /// How long a lane has held bytes that were not told of.
    fn waited(&self, index: usize, now: u32) -> u32 {
        let stream = self.lanes.get(index);
        stream.map_or(0, |stream| stream.waited(now, &self.timing))
    }

    /// How long the reply to a request that was given up is known as such.
    const fn late(&self) -> u32 {
        self.timeout.saturating_mul(LATE)
    }

    /// True if no request is overdue and no lane holds more than the beginning of a
    /// frame: what [`Sniffer::look`] finds then, at less cost. Firmware, where code is
    /// dearer, looks.
    #[cfg_attr(not(target_os = "none"), inline(never))]
    pub fn only_waits(&mut self, buffer: &mut [u8], functions: &[Function], now: u32) -> bool {
        if FIRMWARE {
            return false;
        }
        let only_bytes = self.is_early(now);
        if !only_bytes {
            self.calm_from = now;
            self.calm_for = self.requests.calm(now, self.timeout, self.late());
            if self.calm_for == 0 {
                return false;
            }
        }
        let framing = self.framing;
        for index in 0..=usize::from(self.is_apart) {
            let part = self.part(buffer, index);
            let (context, stream) = self.split(functions, index, now);
            if only_bytes && stream.is_settled(now) {
                continue;
            }
            let need = if stream.is_empty() {
                Some(context.least(framing))
            } else {
                context.begun(framing, stream, part)
            };
            let Some(need) = need else {
                // The other lane may not have been looked into since requests changed.
                self.calm_for = if only_bytes { self.calm_for } else { 0 };
                return false;
            };
            stream.settle(need, part.len(), now, &context.timing);
        }
        true
    }

    /// A request that is to be given up by now; those given up long ago go.
    fn overdue(&mut self, now: u32) -> Option<usize> {
        self.requests.forget(now, self.late());
        self.requests.overdue(now, self.timeout)
    }

    /// What a finder needs to know, and the lane that it looks into.
    fn split<'c>(
        &'c mut self,
        functions: &'c [Function],
        index: usize,
        now: u32,
    ) -> (Context<'c>, &'c mut RxStream) {
        let context = Context {
            requests: &self.requests,
            functions,
            timing: self.timing,
            request: !self.is_apart || index == 0,
            response: !self.is_apart || index == 1,
            end: self.end,
            now,
        };
        let [first, second] = &mut self.lanes;
        (context, if index == 0 { first } else { second })
    }

    /// Looks for what there is to tell of in a lane.
    fn step(
        &mut self,
        buffer: &mut [u8],
        functions: &[Function],
        index: usize,
        now: u32,
    ) -> Option<Step> {
        let part = self.part(buffer, index);
        let capacity = part.len();
        let (framing, end) = (self.framing, self.end);
        let (context, stream) = self.split(functions, index, now);
        let step = loop {
            if stream.is_empty() {
                stream.settle(context.least(framing), capacity, now, &context.timing);
                break None;
            }
            let junk = |until: u16| {
                Some(Step::Junk {
                    length: usize::from(until - stream.start),
                    status: if stream.cut {
                        Status::BUFFER_TOO_SMALL
                    } else {
                        Status::OK
                    },
                    more: 0,
                })
            };
            // What lies between two silences is told of by itself.
            if let Some(end) = stream
                .silences(stream.start)
                .next()
                .filter(|end| stream.at >= *end)
            {
                break junk(end);
            }
            if stream.at == stream.end {
                break junk(stream.end);
            }
            let bytes = part
                .get_mut(stream.at.into()..stream.end.into())
                .unwrap_or_default();
            let candidate = if stream.decoded > 0 {
                Candidate::Frame(stream.decoded.into(), true, true)
            } else {
                match framing {
                    Framing::Rtu | Framing::RtuOverTcp => context.rtu(stream, bytes, capacity),
                    Framing::Tcp => context.tcp(stream, bytes, capacity),
                    Framing::Ascii => context.ascii(stream, bytes, capacity),
                }
            };
            let is_behind_junk = stream.at > stream.start;
            match candidate {
                Candidate::Wait(need) if !stream.is_full(capacity) => {
                    stream.searched = bytes.len() as u16;
                    stream.settle(need, capacity, now, &context.timing);
                    break None;
                }
                Candidate::Frame(..) | Candidate::Damaged(_) | Candidate::Wait(_)
                    if is_behind_junk =>
                {
                    break junk(stream.at);
                }
                Candidate::Frame(total, request, response) => {
                    break Some(Step::Frame {
                        total,
                        content: total,
                        right: Some((request && context.request, response && context.response)),
                    });
                }
                Candidate::Damaged(total) => {
                    break Some(Step::Frame {
                        total,
                        content: total,
                        right: None,
                    });
                }
                // A header is trusted; elsewhere it may be noise.
                Candidate::TooLong(total) if framing == Framing::Tcp => {
                    if is_behind_junk {
                        break junk(stream.at);
                    }
                    let length = bytes.len().min(total);
                    break Some(Step::Junk {
                        length,
                        status: Status::BUFFER_TOO_SMALL,
                        more: total - length,
                    });
                }
                Candidate::TooLong(_) | Candidate::Wait(_) | Candidate::NoFrame => {
                    stream.cut |= matches!(candidate, Candidate::TooLong(_));
                    stream.pass();
                }
            }
        };
        match step {
            Some(Step::Frame { total, right, .. }) if framing == Framing::Ascii => {
                let at = usize::from(stream.at);
                if let Some(frame) = part.get_mut(at..at + total).filter(|_| stream.decoded == 0) {
                    // It has a frame's form: the context looked.
                    ascii::decode(frame, end, true);
                }
                let content = total.saturating_sub(3) / 2;
                stream.decoded = if right.is_some() { total as u16 } else { 0 };
                Some(Step::Frame {
                    total,
                    content,
                    right,
                })
            }
            other => other,
        }
    }
}
