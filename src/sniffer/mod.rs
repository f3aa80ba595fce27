//! A sniffer: finds the frames on a bus that others use, and pairs requests with
//! replies. It only listens.
//!
//! Nobody tells which side speaks. An RTU frame is therefore looked for with the
//! lengths of a request and of a response, and is right if its CRC is; which of
//! the two it is, the request before it decides. What is no frame costs one byte,
//! and the search goes on behind it.

mod event;
mod find;
mod lane;
mod pairing;
mod tell;

pub use event::{Event, Kind};
pub use pairing::Asked;

use crate::error::Status;
use crate::frame::{ascii, Framing};
use crate::pdu::custom::Function;
use crate::time::{character, silence, DEFAULT_SILENCE};
use find::{Context, Verdict};
use lane::{Lane, Timing};
use pairing::Requests;

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
    lanes: [Lane; 2],
    requests: Requests,
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
        let patience = match framing {
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
                patience,
            },
            lanes: [Lane::EMPTY; 2],
            requests: Requests::NONE,
        }
    }

    /// Sets the rate, from which the silence between frames follows, and when
    /// each of several bytes that are fed at once arrived; 0 is untold.
    pub const fn set_baud_rate(&mut self, baud: u32) {
        self.timing.silence = silence(baud);
        self.timing.character = if baud == 0 { 0 } else { character(baud) as u32 };
    }

    /// Sets how long a request may stay unanswered, in microseconds. For ten times
    /// as long, a late reply is still known to answer it.
    pub const fn set_timeout(&mut self, timeout: u32) {
        self.timeout = timeout;
    }

    /// Sets how long the rest of a frame is waited for, in microseconds: how
    /// coarse the time stamps are.
    pub const fn set_patience(&mut self, patience: u32) {
        self.timing.patience = patience;
    }

    /// Sets the last character of ASCII frames.
    pub const fn set_end(&mut self, end: u8) {
        self.end = end;
    }

    /// The lane of a tap and its part of the buffer.
    fn part<'a>(&self, buffer: &'a mut [u8], lane: usize) -> &'a mut [u8] {
        // Places in the buffer are 16 bits.
        let most = buffer.len().min(u16::MAX.into());
        let buffer = buffer.get_mut(..most).unwrap_or_default();
        if !self.is_apart {
            return buffer;
        }
        let half = if lane == 0 {
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
            self.lanes = [Lane::EMPTY; 2];
        }
        let index = usize::from(tap == Tap::Server);
        let part = self.part(buffer, index);
        let timing = self.timing;
        match self.lanes.get_mut(index) {
            Some(lane) => lane.feed(part, bytes, now, &timing),
            None => 0,
        }
    }

    /// What happened next, up to now; none if nothing more is known yet. It
    /// borrows from the buffer. To be called after each feed until there is none,
    /// and now and then while nothing arrives.
    pub fn next<'b>(
        &mut self,
        buffer: &'b mut [u8],
        functions: &[Function],
        now: u32,
    ) -> Option<Event<'b>> {
        // What was heard first is told first.
        let timing = self.timing;
        let [first, second] = self.lanes.each_ref().map(|lane| lane.waited(now, &timing));
        let order = if second > first { [1, 0] } else { [0, 1] };
        for index in order {
            if let Some(step) = self.step(buffer, functions, index, now) {
                return Some(self.tell(buffer, functions, index, step, now));
            }
        }
        // Bytes that are not understood yet may hold the reply.
        let known = now.wrapping_sub(first.max(second));
        let overdue = self.overdue(known)?;
        Some(self.give_up(overdue, now))
    }

    /// A request that is to be given up by now; those given up long ago go.
    fn overdue(&mut self, now: u32) -> Option<usize> {
        self.requests.forget(now, self.timeout.saturating_mul(LATE));
        self.requests.overdue(now, self.timeout)
    }

    fn context<'c>(&'c self, functions: &'c [Function], lane: usize, now: u32) -> Context<'c> {
        Context {
            requests: &self.requests,
            functions,
            timing: self.timing,
            request: !self.is_apart || lane == 0,
            response: !self.is_apart || lane == 1,
            end: self.end,
            now,
        }
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
        let mut lane = *self.lanes.get(index)?;
        let context = self.context(functions, index, now);
        let step = loop {
            if lane.is_empty() {
                break None;
            }
            let junk = |until: u16| {
                Some(Step::Junk {
                    length: usize::from(until - lane.start),
                    status: if lane.cut {
                        Status::BUFFER_TOO_SMALL
                    } else {
                        Status::OK
                    },
                    more: 0,
                })
            };
            // What lies between two silences is told of by itself.
            if let Some(end) = lane
                .silences(lane.start)
                .next()
                .filter(|end| lane.at >= *end)
            {
                break junk(end);
            }
            if lane.at == lane.end {
                break junk(lane.end);
            }
            let bytes = part
                .get(lane.at.into()..lane.end.into())
                .unwrap_or_default();
            let verdict = if lane.decoded > 0 {
                Verdict::Right(lane.decoded.into(), true, true)
            } else {
                match self.framing {
                    Framing::Rtu | Framing::RtuOverTcp => context.rtu(&lane, bytes, capacity),
                    Framing::Tcp => context.tcp(&lane, bytes, capacity),
                    Framing::Ascii => context.ascii(&lane, bytes, capacity),
                }
            };
            let is_behind_junk = lane.at > lane.start;
            match verdict {
                Verdict::Wait if !lane.is_full(capacity) => break None,
                Verdict::Right(..) | Verdict::Damaged(_) | Verdict::Wait if is_behind_junk => {
                    break junk(lane.at);
                }
                Verdict::Right(total, request, response) => {
                    break Some(Step::Frame {
                        total,
                        content: total,
                        right: Some((request && context.request, response && context.response)),
                    });
                }
                Verdict::Damaged(total) => {
                    break Some(Step::Frame {
                        total,
                        content: total,
                        right: None,
                    });
                }
                // A header is trusted; elsewhere it may be noise.
                Verdict::TooLong(total) if self.framing == Framing::Tcp => {
                    if is_behind_junk {
                        break junk(lane.at);
                    }
                    let length = bytes.len().min(total);
                    break Some(Step::Junk {
                        length,
                        status: Status::BUFFER_TOO_SMALL,
                        more: total - length,
                    });
                }
                Verdict::TooLong(_) | Verdict::Wait | Verdict::Wrong => {
                    lane.cut |= matches!(verdict, Verdict::TooLong(_));
                    lane.at += 1;
                }
            }
        };
        let step = match step {
            Some(Step::Frame { total, right, .. }) if self.framing == Framing::Ascii => {
                let at = usize::from(lane.at);
                let content = match part.get_mut(at..at + total) {
                    Some(frame) if lane.decoded == 0 => find::decode(frame),
                    _ => total.saturating_sub(3) / 2,
                };
                lane.decoded = if right.is_some() { total as u16 } else { 0 };
                Some(Step::Frame {
                    total,
                    content,
                    right,
                })
            }
            other => other,
        };
        if let Some(place) = self.lanes.get_mut(index) {
            *place = lane;
        }
        step
    }
}
