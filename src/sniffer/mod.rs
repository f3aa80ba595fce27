//! The sniffer: finds the frames on a bus that other devices use, and pairs requests with
//! replies. It never sends.
//!
//! A frame does not show whether a client or a server sent it. So the search tries the length of
//! a request and the length of a response. An RTU frame is valid if its CRC is right for one of
//! them. The requests before it decide whether it is a request or a response. Where no frame
//! begins, the search skips one byte and tries again.

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
use crate::time::{character, silence, Micros, DEFAULT_CHARACTER, DEFAULT_SILENCE};
use find::{Candidate, Context};
use pairing::Requests;
use stream::{RxStream, Timing};

/// Smallest size of the buffer, in bytes. [`Framing::max_frame`] bytes hold any frame. Twice as
/// many are needed if the two directions are fed separately.
pub const MIN_BUFFER: usize = 32;

/// Default time that a reply may take, in microseconds.
pub const DEFAULT_TIMEOUT: u32 = 1_000_000;

/// A late reply is paired with its request for this many times the timeout. After that, a frame
/// like it is more likely the reply to another request.
const LATE_TIMEOUTS: u32 = 10;

/// How long a USB adapter holds bytes back, in microseconds: 16 ms and more.
const ADAPTER: u32 = 50_000;

/// How many characters a UART holds back: those of an ESP32 hand over 120 at a time, and the last
/// ones after a pause of 10.
const HELD_BACK: u32 = 120 + 10;

/// Default time that the sniffer waits for the rest of an RTU frame, in microseconds: for
/// [`ADAPTER`] and [`HELD_BACK`] characters of this length.
const fn rtu_frame_timeout(character: u16) -> u32 {
    ADAPTER + HELD_BACK * character as u32
}

/// Default time that the sniffer waits for the rest of any other frame, in microseconds (serial
/// line guide V1.02, 2.5.2.1).
const FRAME_TIMEOUT: u32 = 1_000_000;

/// The direction of bytes on the bus.
///
/// ```
/// use mbm::frame::Framing;
/// use mbm::sniffer::{BusDirection, EventKind, Sniffer};
///
/// // The tap says which side has sent the bytes, so the same bytes are the reply of a write here.
/// let bytes = [17, 6, 0x00, 0x6D, 0x03, 0x78, 0x1A, 0x55];
/// let mut sniffer = Sniffer::new(Framing::Rtu);
/// sniffer.set_baud_rate(19200);
/// let mut buffer = [0; 512];
/// sniffer.feed(&mut buffer, BusDirection::Server, &bytes, 10_000);
/// let event = sniffer.next(&mut buffer, &[], 1_000_000).unwrap();
/// assert_eq!(event.kind, EventKind::Unpaired);
/// ```
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum BusDirection {
    /// The bytes come from a line that carries both directions.
    Both,
    /// Only the client sends them.
    Client,
    /// Only servers send them.
    Server,
}

/// A sniffer. The caller owns the buffer and passes it to each call.
///
/// ```
/// use mbm::frame::{ascii, Framing};
/// use mbm::sniffer::{BusDirection, EventKind, Sniffer};
///
/// let mut sniffer = Sniffer::new(Framing::Rtu);
/// sniffer.set_baud_rate(19200);
/// sniffer.set_timeout(500_000);
/// sniffer.set_frame_timeout(100_000);
/// sniffer.set_end(ascii::END); // Of ASCII frames, if there were any.
///
/// let mut buffer = [0; 256];
/// let mut kinds = vec![];
/// // A request, its reply, and 2 s later nothing.
/// let request = [17, 6, 0x00, 0x6D, 0x03, 0x78, 0x1A, 0x55];
/// for (bytes, now) in [(&request[..], 10_000), (&request[..], 20_000), (&[], 2_000_000)] {
///     sniffer.feed(&mut buffer, BusDirection::Both, bytes, now);
///     while !sniffer.is_idle(now) {
///         let Some(event) = sniffer.next(&mut buffer, &[], now) else { break };
///         kinds.push(event.kind);
///     }
/// }
/// assert_eq!(kinds, [EventKind::Request, EventKind::Reply]);
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Sniffer {
    framing: Framing,
    end: u8,
    is_separate: bool,
    /// The frame timeout follows from the baud rate.
    has_rtu_timeout: bool,
    timeout: Micros,
    timing: Timing,
    streams: [RxStream; 2],
    requests: Requests,
    /// From `idle_from` on, for `idle_for` microseconds, no event comes from the passing of time
    /// alone: no request was stored or removed since, and none times out.
    idle_from: Micros,
    idle_for: Micros,
}

/// The lengths in the stream that the next event covers.
#[derive(Clone, Copy)]
enum Step {
    /// A frame of `total` bytes, which are `content` bytes once decoded. `roles` says whether it
    /// may be a request, and whether it may be a response; `None` if it is damaged.
    Frame {
        total: usize,
        content: usize,
        roles: Option<(bool, bool)>,
    },
    /// `length` bytes that are not a frame; `more` bytes that belong to them will follow.
    Noise {
        length: usize,
        status: Status,
        more: usize,
    },
}

impl Sniffer {
    /// A sniffer that has received nothing yet.
    pub const fn new(framing: Framing) -> Self {
        let has_rtu_timeout = matches!(framing, Framing::Rtu | Framing::RtuOverTcp);
        let frame_timeout = if has_rtu_timeout {
            rtu_frame_timeout(DEFAULT_CHARACTER)
        } else {
            FRAME_TIMEOUT
        };
        Sniffer {
            framing,
            end: ascii::END,
            is_separate: false,
            has_rtu_timeout,
            timeout: DEFAULT_TIMEOUT,
            timing: Timing {
                character: 0,
                silence: DEFAULT_SILENCE,
                frame_timeout,
            },
            streams: [RxStream::EMPTY; 2],
            requests: Requests::NONE,
            idle_from: 0,
            idle_for: 0,
        }
    }

    /// Sets the baud rate. It defines the silence between frames, the times at which the bytes of
    /// one [`Sniffer::feed`] arrived, and the default of [`Sniffer::set_frame_timeout`]. 0 if it is
    /// unknown.
    pub const fn set_baud_rate(&mut self, baud: u32) {
        self.idle_for = 0;
        if self.has_rtu_timeout {
            self.timing.frame_timeout = rtu_frame_timeout(character(baud));
        }
        self.timing.silence = silence(baud);
        self.timing.character = if baud == 0 { 0 } else { character(baud) as u32 };
    }

    /// Sets the time that a reply may take, in microseconds. A late reply is still paired with
    /// its request for ten times as long.
    pub const fn set_timeout(&mut self, timeout: u32) {
        self.idle_for = 0;
        self.timeout = timeout;
    }

    /// Sets how long the sniffer waits for the rest of a frame, in microseconds. It should be
    /// longer than the error of the time stamps. In RTU it is 50 ms and 130 characters at first.
    pub const fn set_frame_timeout(&mut self, frame_timeout: u32) {
        self.idle_for = 0;
        self.has_rtu_timeout = false;
        self.timing.frame_timeout = frame_timeout;
    }

    /// Sets the end character of ASCII frames.
    pub const fn set_end(&mut self, end: u8) {
        self.idle_for = 0;
        let [first, second] = &mut self.streams;
        first.searched = 0;
        second.searched = 0;
        self.end = end;
    }

    /// The part of the buffer that belongs to a stream.
    fn part<'a>(&self, buffer: &'a mut [u8], stream: usize) -> &'a mut [u8] {
        // Indexes in the buffer have 16 bits.
        let most = buffer.len().min(u16::MAX.into());
        let buffer = buffer.get_mut(..most).unwrap_or_default();
        if !self.is_separate {
            return buffer;
        }
        let half = if stream == 0 {
            buffer.get_mut(..most / 2)
        } else {
            buffer.get_mut(most / 2..)
        };
        half.unwrap_or_default()
    }

    /// Takes bytes; the last one arrived at `now` (microseconds). Returns how many fitted
    /// into the buffer. Call [`Sniffer::next`] until it returns `None`, then feed the other bytes
    /// with the same time. Feed either both directions together or each direction separately: a
    /// change from one to the other discards the bytes that were not reported yet.
    pub fn feed(
        &mut self,
        buffer: &mut [u8],
        direction: BusDirection,
        bytes: &[u8],
        now: u32,
    ) -> usize {
        let is_separate = direction != BusDirection::Both;
        if is_separate != self.is_separate {
            self.is_separate = is_separate;
            self.streams = [RxStream::EMPTY; 2];
        }
        let index = usize::from(direction == BusDirection::Server);
        let part = self.part(buffer, index);
        let is_ascii = self.framing == Framing::Ascii;
        let [first, second] = &mut self.streams;
        let stream = if index == 0 { first } else { second };
        let may_decide = |byte: &u8| *byte == ascii::START || *byte == self.end;
        if is_ascii && bytes.iter().any(may_decide) {
            stream.resume();
        }
        stream.feed(part, bytes, now, &self.timing)
    }

    /// The next event up to `now` (microseconds); `None` if there is none yet. The event borrows
    /// from the buffer. Call this after each feed until it returns `None`, and regularly while
    /// nothing arrives. Pass the same functions each time.
    pub fn next<'b>(
        &mut self,
        buffer: &'b mut [u8],
        functions: &[Function],
        now: u32,
    ) -> Option<Event<'b>> {
        // The stream whose bytes arrived first goes first.
        let is_later = self.is_separate && self.waited(1, now) > self.waited(0, now);
        let order = if is_later { [1, 0] } else { [0, 1] };
        // If a request was stored or removed, the same bytes may have another meaning.
        let only_bytes = self.is_unchanged(now);
        for index in order {
            if only_bytes && self.streams.get(index)?.is_suspended(now) {
                continue;
            }
            if let Some(step) = self.step(buffer, functions, index, now) {
                return Some(self.emit_event(buffer, functions, index, step, now));
            }
        }
        if only_bytes {
            return None;
        }
        // Bytes that were not reported yet may contain the reply, so they delay the timeout.
        let known = now.wrapping_sub(self.waited(0, now).max(self.waited(1, now)));
        if let Some(overdue) = self.find_overdue(known) {
            return Some(self.expire(overdue, now));
        }
        self.idle_from = now;
        self.idle_for = self
            .requests
            .until_next_timeout(now, self.timeout, self.late());
        None
    }

    /// True if [`Sniffer::next`] has no event and need not search. This holds after most bytes
    /// that are fed one by one.
    #[inline]
    pub fn is_idle(&self, now: u32) -> bool {
        let [first, second] = &self.streams;
        self.is_unchanged(now)
            && first.is_suspended(now)
            && (!self.is_separate || second.is_suspended(now))
    }

    /// True if no request was stored or removed since the last search, and none is overdue.
    #[inline(always)]
    const fn is_unchanged(&self, now: u32) -> bool {
        now.wrapping_sub(self.idle_from) < self.idle_for
    }

    /// How long a stream has held bytes that were not reported yet, in microseconds.
    fn waited(&self, index: usize, now: u32) -> u32 {
        let stream = self.streams.get(index);
        stream.map_or(0, |stream| stream.waited(now, &self.timing))
    }

    /// How long a late reply is paired with its request, in microseconds.
    const fn late(&self) -> u32 {
        self.timeout.saturating_mul(LATE_TIMEOUTS)
    }

    /// Finds a request that is overdue, and forgets the requests whose late reply is no longer
    /// expected. Returns its index.
    fn find_overdue(&mut self, now: u32) -> Option<usize> {
        self.requests.forget(now, self.late());
        self.requests.overdue(now, self.timeout)
    }

    /// The context of the search, and the stream at `index`.
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
            request: !self.is_separate || index == 0,
            response: !self.is_separate || index == 1,
            end: self.end,
            now,
        };
        let [first, second] = &mut self.streams;
        (context, if index == 0 { first } else { second })
    }

    /// Searches a stream for the next frame or noise to report.
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
                stream.suspend(context.min_bytes(framing), capacity, now, &context.timing);
                break None;
            }
            let noise = |until: u16| {
                Some(Step::Noise {
                    length: usize::from(until - stream.start),
                    status: if stream.cut {
                        Status::BUFFER_TOO_SMALL
                    } else {
                        Status::OK
                    },
                    more: 0,
                })
            };
            // Bytes between two silences are one event.
            if let Some(end) = stream
                .silences(stream.start)
                .next()
                .filter(|end| stream.at >= *end)
            {
                break noise(end);
            }
            if stream.at == stream.end {
                break noise(stream.end);
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
            let is_after_noise = stream.at > stream.start;
            match candidate {
                Candidate::Wait(need) if !stream.is_full(capacity) => {
                    stream.searched = bytes.len() as u16;
                    stream.suspend(need, capacity, now, &context.timing);
                    break None;
                }
                Candidate::Frame(..) | Candidate::Damaged(_) | Candidate::Wait(_)
                    if is_after_noise =>
                {
                    break noise(stream.at);
                }
                Candidate::Frame(total, request, response) => {
                    break Some(Step::Frame {
                        total,
                        content: total,
                        roles: Some((request && context.request, response && context.response)),
                    });
                }
                Candidate::Damaged(total) => {
                    break Some(Step::Frame {
                        total,
                        content: total,
                        roles: None,
                    });
                }
                // The length in a TCP header is reliable. In other framings it may be noise.
                Candidate::TooLong(total) if framing == Framing::Tcp => {
                    if is_after_noise {
                        break noise(stream.at);
                    }
                    let length = bytes.len().min(total);
                    break Some(Step::Noise {
                        length,
                        status: Status::BUFFER_TOO_SMALL,
                        more: total - length,
                    });
                }
                Candidate::TooLong(_) | Candidate::Wait(_) | Candidate::NoFrame => {
                    stream.cut |= matches!(candidate, Candidate::TooLong(_));
                    stream.skip_byte();
                }
            }
        };
        match step {
            Some(Step::Frame { total, roles, .. }) if framing == Framing::Ascii => {
                let at = usize::from(stream.at);
                if let Some(frame) = part.get_mut(at..at + total).filter(|_| stream.decoded == 0) {
                    // `Context::ascii` has checked that this is a frame.
                    ascii::decode(frame, end, true);
                }
                let content = total.saturating_sub(3) / 2;
                stream.decoded = if roles.is_some() { total as u16 } else { 0 };
                Some(Step::Frame {
                    total,
                    content,
                    roles,
                })
            }
            other => other,
        }
    }
}
