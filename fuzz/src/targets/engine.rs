//! Requests of the master over a port that delivers any bytes at any time. A request may
//! succeed only if the bytes contain a right reply, and fail only if they contain none. Every
//! request is sent byte for byte, ends, and leaves the driver off.

use crate::asked::{words, Asked};
use crate::search::Search;
use crate::stream::{event, Event};
use crate::Input;
use mbm::engine::{
    Buffers, Counter, Engine, MicrosSetting, Settings, Storage as _, Words as _, BROADCAST,
};
use mbm::error::Status;
use mbm::master::request::MasterRequest;
use mbm::port::Port;
use std::collections::VecDeque;

/// The next event on the line.
enum Next {
    Bytes(VecDeque<u8>),
    LinkLost,
}

/// The master reads single bytes if `SINGLE` is true, as in firmware.
struct Line<const SINGLE: bool> {
    now: u32,
    /// The events, each with its delay after the previous one in microseconds.
    script: VecDeque<(u32, Next)>,
    since: u32,
    /// How many bytes a write accepts, while every other write accepts none; 0: all, always.
    accept: usize,
    writes: usize,
    flushes: u8,
    driver: bool,
    sent: Vec<u8>,
    requests: Vec<Vec<u8>>,
    /// The bytes read since the last request.
    received: Vec<u8>,
    /// The bytes read before that, while the request waited for silence.
    unexpected: Vec<u8>,
    lost: bool,
}

impl<const SINGLE: bool> Port for Line<SINGLE> {
    const READS_SINGLE_BYTES: bool = SINGLE;

    fn read(&mut self, bytes: &mut [u8]) -> Result<usize, mbm::Error> {
        assert!(!self.driver, "the engine reads while it sends");
        let Some((delay, next)) = self.script.front_mut() else {
            return Ok(0);
        };
        if self.now.wrapping_sub(self.since) < *delay {
            return Ok(0);
        }
        let Next::Bytes(waiting) = next else {
            self.lost = true;
            return Err(mbm::Error::LinkLost);
        };
        let count = waiting.len().min(bytes.len());
        for (place, byte) in bytes.iter_mut().zip(waiting.drain(..count)) {
            *place = byte;
            self.received.push(byte);
        }
        if waiting.is_empty() {
            self.script.pop_front();
            self.since = self.now;
        }
        Ok(count)
    }

    fn write(&mut self, bytes: &[u8]) -> Result<usize, mbm::Error> {
        assert!(self.driver, "the engine sends with the driver off");
        self.writes += 1;
        if self.accept > 0 && self.writes.is_multiple_of(2) {
            return Ok(0);
        }
        let count = match self.accept {
            0 => bytes.len(),
            some => bytes.len().min(some),
        };
        self.sent.extend_from_slice(&bytes[..count]);
        Ok(count)
    }

    fn micros(&mut self) -> u32 {
        self.now
    }

    fn flush(&mut self) -> bool {
        assert!(self.driver, "the driver is off before the last bit");
        if self.flushes > 0 {
            self.flushes -= 1;
        }
        self.flushes == 0
    }

    fn pre_transmission(&mut self) {
        assert!(!self.driver);
        self.driver = true;
        self.sent.clear();
        self.unexpected = std::mem::take(&mut self.received);
    }

    fn post_transmission(&mut self) {
        assert!(self.driver);
        self.driver = false;
        self.requests.push(std::mem::take(&mut self.sent));
        self.received.clear();
    }
}

type Lent = Buffers<Vec<u8>, Vec<u16>, Vec<u16>>;
type MasterEngine<const SINGLE: bool> = Engine<Line<SINGLE>, Lent, MasterRequest>;

pub fn run(data: &[u8]) {
    let mut input = Input(data);
    match input.u8() & 1 {
        0 => requests::<false>(&mut input),
        _ => requests::<true>(&mut input),
    }
}

/// Makes two requests.
fn requests<const SINGLE: bool>(input: &mut Input) {
    let line = Line::<SINGLE> {
        now: u32::from(input.u16()) << 16,
        script: VecDeque::new(),
        since: 0,
        accept: usize::from(input.u8() % 8),
        writes: 0,
        flushes: input.u8() % 4,
        driver: false,
        sent: Vec::new(),
        requests: Vec::new(),
        received: Vec::new(),
        unexpected: Vec::new(),
        lost: false,
    };
    let frame = vec![0; 4 + usize::from(input.u8()) % 253];
    let space = frame.len().min(255);
    let buffers = Buffers::new(frame, vec![0; 125], words());
    let mut engine = Engine::new(line, buffers);
    let time = |input: &mut Input| u32::from(input.u8()) * 64;
    engine.settings = Settings {
        gap: MicrosSetting::new(time(input)),
        silence: MicrosSetting::new(time(input)),
        response_timeout: MicrosSetting::new(1000 + 4 * time(input)),
        turnaround_delay: MicrosSetting::new(time(input)),
        quiet_time: MicrosSetting::new(2 * time(input)),
        character: u16::from(input.u8()),
        retries: input.u8() % 3,
        post_flush_characters: input.u8() % 4,
        echo_discard: input.u8() & 1 == 1,
    };
    // A right reply arrived before a request was sent.
    let mut is_early = false;
    for _ in 0..2 {
        let Some(asked) = Asked::new(input) else {
            return;
        };
        let port = &mut engine.port;
        port.since = port.now;
        for _ in 0..input.u8() % 16 {
            let delay = u32::from(input.u8()).pow(2) / 2;
            let next = match event(input, &asked) {
                Event::Silence if input.u8() == 0xFF => Next::LinkLost,
                Event::Silence => continue,
                Event::Bytes(bytes) => Next::Bytes(bytes.into()),
            };
            port.script.push_back((delay, next));
        }
        let step = 20 + u32::from(input.u8()) * 8;
        request(&mut engine, &asked, space, step, &mut is_early);
        // No held reply takes space in the frame buffer any more.
        assert_eq!(usize::from(engine.storage.capacity()), space);
    }
}

fn request<const SINGLE: bool>(
    engine: &mut MasterEngine<SINGLE>,
    asked: &Asked,
    space: usize,
    step: u32,
    is_early: &mut bool,
) {
    *engine.request() = asked.request;
    engine.port.requests.clear();
    engine.port.received.clear();
    engine.port.unexpected.clear();
    let started = engine.start(asked.unit);
    let fits = asked.frame().len() <= space;
    if started != Status::PENDING {
        let broadcast_read = asked.unit == BROADCAST && asked.data.is_some();
        assert!(match started {
            Status::BROADCAST_NOT_ALLOWED => broadcast_read,
            Status::BUFFER_TOO_SMALL => !fits,
            _ => false,
        });
        return;
    }
    assert!(fits);
    let mut polls = 0;
    let status = loop {
        let now = engine.port.now;
        let status = engine.poll(now);
        if status != Status::PENDING {
            break status;
        }
        // The clock moves on by `step`, or by the poll delay if that is shorter.
        let time = match engine.poll_delay(now) {
            0 => step,
            delay => delay.min(step),
        };
        engine.port.now = now.wrapping_add(time);
        polls += 1;
        assert!(polls < 100_000, "the request never ends");
    };
    validate(engine, asked, status);
    // The frame of the reply to a read, with unit, function, byte count and CRC.
    let reply_fits = asked.data.is_none_or(|data| data + 5 <= space);
    assert!(status != Status::BUFFER_TOO_SMALL || !reply_fits);
    let port = &engine.port;
    // Without a request on the line, all bytes arrived before it.
    let unexpected = match port.requests.is_empty() {
        true => &port.received,
        false => &port.unexpected,
    };
    *is_early |= right_replies(unexpected, asked).next().is_some();
    if status.is_failure() {
        check_no_reply_missed(engine, asked, space, status, *is_early);
    }
}

/// Checks that the bytes received by a failed request contain no right reply. Skips requests
/// that may fail for other reasons.
fn check_no_reply_missed<const SINGLE: bool>(
    engine: &mut MasterEngine<SINGLE>,
    asked: &Asked,
    space: usize,
    status: Status,
    is_early: bool,
) {
    let other = matches!(
        status,
        Status::LINE_BUSY | Status::LINK_LOST | Status::BUFFER_TOO_SMALL
    );
    let settings = engine.settings;
    // After an attempt without a right reply, and after a right reply that arrived before a
    // request was sent, the master may hold the next reply, because it may be a late one.
    let attempts = engine.storage.counters[Counter::Requests as usize];
    let held = settings.quiet_time.get() > 0 && (attempts > 1 || is_early);
    if other || held || settings.echo_discard {
        return;
    }
    let mut search = Search {
        asked,
        space,
        bytes: engine.port.received.clone(),
        at: 0,
    };
    assert_eq!(search.missed(false), None, "the engine missed a reply");
    assert_eq!(
        search.missed(true),
        None,
        "the engine missed a reply after noise"
    );
}

/// The right replies among the bytes.
fn right_replies<'a>(bytes: &'a [u8], asked: &'a Asked) -> impl Iterator<Item = &'a [u8]> {
    (0..bytes.len()).filter_map(|at| {
        let rest = &bytes[at..];
        let reply = rest.get(..asked.frame_length(rest)?)?;
        asked.is_answered_by(reply).then_some(reply)
    })
}

fn validate<const SINGLE: bool>(engine: &mut MasterEngine<SINGLE>, asked: &Asked, status: Status) {
    let port = &engine.port;
    assert!(!port.driver && !engine.is_pending());
    let frame = asked.frame();
    let whole = |sent: &Vec<u8>| *sent == frame;
    let settings = engine.settings;
    assert!(port.requests.len() <= 1 + usize::from(settings.retries));
    let cut_off = matches!(status, Status::LINE_BUSY | Status::LINK_LOST);
    match port.requests.split_last() {
        Some((last, before)) => {
            assert!(before.iter().all(whole));
            assert!(whole(last) || (cut_off && frame.starts_with(last)));
        }
        None => assert!(cut_off),
    }
    let success = status == Status::OK || status.is_exception();
    assert!(status != Status::LINK_LOST || port.lost);
    if asked.unit == BROADCAST {
        assert!(!status.is_exception());
        return;
    }
    let replies = || right_replies(&port.received, asked);
    if !success {
        assert!((0xE0..=0xEC).contains(&status.code()), "{status:?}");
        return;
    }
    if status.is_exception() {
        let is_this = |reply: &[u8]| reply[1] & 0x80 != 0 && reply[2] == status.code();
        assert!(replies().any(is_this), "an exception that did not arrive");
        return;
    }
    let right: Vec<Vec<u8>> = replies()
        .filter(|reply| reply[1] & 0x80 == 0)
        .map(<[u8]>::to_vec)
        .collect();
    assert!(!right.is_empty(), "success without a right reply");
    if asked.data.is_some() {
        assert!(engine.store_words());
        let words = engine.storage.response().to_vec();
        let has_words = |reply: &Vec<u8>| {
            let data = &reply[3..reply.len() - 2];
            match asked.bits {
                None => data
                    .chunks(2)
                    .zip(&words)
                    .all(|(bytes, word)| *bytes == word.to_be_bytes()),
                // The bits after the last requested one are zero, to the end of the word.
                Some(quantity) => (0..usize::from(quantity).next_multiple_of(16)).all(|bit| {
                    let on = bit < usize::from(quantity) && data[bit / 8] >> (bit % 8) & 1 == 1;
                    (words[bit / 16] >> (bit % 16) & 1 == 1) == on
                }),
            }
        };
        assert!(right.iter().any(has_words), "data that did not arrive");
    }
}
