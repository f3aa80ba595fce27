//! Sends every stream of bytes up to a length to a real master that waits for a reply. The bytes
//! are those that matter: unit, function, exception, byte count, a byte that is none of these,
//! and each byte that makes the CRC of a frame of the unit right, wherever that frame began.

use crate::wire::Wire;
use mbm::engine::{Buffers, MicrosSetting};
use mbm::error::Status;
use mbm::master::Master;
use std::time::Instant;

const UNIT: u8 = 17;
const OTHER: u8 = 0;

/// Times in ticks. Only their order matters.
const SILENCE: u32 = 1;
const QUIET: u32 = 4;
const TIMEOUT: u32 = 10;

/// Every request ends within this time after its last byte.
const LONGEST_WAIT: u32 = 10 * TIMEOUT;

/// The length of the frame of an exception, in bytes.
const EXCEPTION_FRAME: usize = 5;

/// The longest stream that is tried.
const LONGEST: usize = 24;

type Tried = Master<Wire, Buffers<[u8; 20], [u16; 1], [u16; 0]>>;

/// What the master waits for.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Request {
    /// Function 03, one register.
    Read,
    /// Function 06.
    Write,
}

/// How the master came to wait.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Before {
    /// Nothing has happened before.
    Nothing,
    /// The request before got no reply, so the reply may be a late one.
    Timeout,
}

/// The result of a request.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Outcome {
    pub status: Status,
    /// The register that was read; 0 after a write or a failure.
    pub value: u16,
}

/// Streams that were tried, and what became of them.
#[derive(Clone, Default, Debug)]
pub struct Tally {
    pub streams: u64,
    /// How many of them ended with MBM_OK.
    pub right: u64,
    /// How many ended with the exception of the device.
    pub exceptions: u64,
    /// A stream with a result that the check does not allow.
    pub broken: Option<(Vec<u8>, Outcome)>,
}

impl Tally {
    fn add(&mut self, other: Tally) {
        self.streams += other.streams;
        self.right += other.right;
        self.exceptions += other.exceptions;
        self.broken = self.broken.take().or(other.broken);
    }
}

impl Request {
    fn function(self) -> u8 {
        match self {
            Request::Read => 3,
            Request::Write => 6,
        }
    }

    fn start(self, master: &mut Tried) {
        let started = match self {
            Request::Read => master.start_read_holding_registers(0, 1),
            Request::Write => master.start_write_single_register(0, 2),
        };
        assert_eq!(started, Ok(()));
    }

    /// The result that a frame of the unit gives, without its CRC; `None` if it is no reply.
    fn result(self, frame: &[u8]) -> Option<Outcome> {
        let (status, value) = match (self, frame) {
            (Request::Read, &[UNIT, 3, 2, high, low]) => (Status::OK, [high, low]),
            (Request::Write, &[UNIT, 6, 0, 0, 0, 2]) => (Status::OK, [0, 0]),
            (_, &[UNIT, function, code @ 1..=0x7F]) if function == self.function() | 0x80 => {
                (Status::from_code(code), [0, 0])
            }
            _ => return None,
        };
        let value = u16::from_be_bytes(value);
        Some(Outcome { status, value })
    }

    /// The length of the frame of the reply, in bytes.
    fn length(self) -> usize {
        match self {
            Request::Read => 7,
            Request::Write => 8,
        }
    }

    /// The results of all replies that a stream holds, each with the index of its first byte.
    pub fn results(self, stream: &[u8]) -> impl Iterator<Item = (usize, Outcome)> + '_ {
        let frames =
            [EXCEPTION_FRAME, self.length()].map(|length| stream.windows(length).enumerate());
        frames
            .into_iter()
            .flatten()
            .filter_map(move |(start, frame)| {
                let (content, crc) = frame.split_at(frame.len() - 2);
                let result = self.result(content)?;
                (crc_of(content).to_le_bytes() == crc).then_some((start, result))
            })
    }

    /// True if a stream may have this result: a reply only if the stream holds it, and a failure
    /// only if it holds none, or only exceptions that share bytes with longer frames.
    pub fn allows(self, before: Before, stream: &[u8], outcome: Outcome) -> bool {
        let mut results = self.results(stream);
        if !outcome.status.is_failure() {
            return results.any(|(_, result)| result == outcome);
        }
        // A held reply is given up if more follows, which may be the rest of the right one.
        before == Before::Timeout
            || results.all(|(start, result)| {
                result.status.is_exception() && shares_bytes_with_a_longer_frame(stream, start)
            })
    }
}

/// True if the exception at `start` is a part of a longer frame, or one begins within it. The
/// frames of a stream follow each other; the first begins with its first byte.
fn shares_bytes_with_a_longer_frame(stream: &[u8], start: usize) -> bool {
    let mut begin = 0;
    for end in 1..=stream.len() {
        if end - begin >= 4 && crc_of(&stream[begin..end]) == 0 {
            let shares = start < end && begin < start + EXCEPTION_FRAME;
            if shares && end - begin > EXCEPTION_FRAME {
                return true;
            }
            begin = end;
        }
    }
    false
}

/// A master that has sent its request and waits for the reply.
fn waiting(request: Request, before: Before) -> Tried {
    let buffers = Buffers::new([0; 20], [0], []);
    let mut master = Master::new(UNIT, Wire::default(), buffers);
    let settings = master.settings();
    settings.gap = MicrosSetting::new(SILENCE);
    settings.silence = MicrosSetting::new(SILENCE);
    settings.response_timeout = MicrosSetting::new(TIMEOUT);
    settings.quiet_time = MicrosSetting::new(QUIET);
    if before == Before::Timeout {
        request.start(&mut master);
        let outcome = outcome_of(&mut master);
        assert_eq!(outcome.status, Status::RESPONSE_TIMED_OUT);
    }
    request.start(&mut master);
    while master.port().sent.is_empty() {
        let _ = master.poll();
        master.port().now += 1;
    }
    let _ = master.poll();
    master.port().sent.clear();
    assert!(master.is_waiting());
    master
}

/// Lets time pass without another byte until the request ends.
fn outcome_of(master: &mut Tried) -> Outcome {
    let end = master.port().now + LONGEST_WAIT;
    while master.poll().is_pending() {
        assert!(master.port().now < end, "a request that does not end");
        master.port().now += 1;
    }
    let status = master.status();
    master.port().sent.clear();
    let value = match status {
        Status::OK => master.response().first().copied().unwrap_or(0),
        _ => 0,
    };
    Outcome { status, value }
}

/// A stream, the CRC from each of its bytes on, and the master that has received it.
#[derive(Clone)]
struct Node {
    bytes: [u8; LONGEST],
    crcs: [u16; LONGEST],
    length: usize,
    master: Tried,
}

impl Node {
    fn stream(&self) -> &[u8] {
        &self.bytes[..self.length]
    }

    fn crc_from(&self, start: usize, end: usize) -> u16 {
        if end == self.length {
            return self.crcs[start];
        }
        crc_of(&self.bytes[start..end])
    }

    /// The bytes that may follow.
    fn next(&self, request: Request) -> Vec<u8> {
        let function = request.function();
        let mut next = vec![UNIT, function, function | 0x80, 2, OTHER];
        for start in (0..self.length).filter(|&start| self.bytes[start] == UNIT) {
            if self.length - start < 2 {
                continue;
            }
            next.push(self.crc_from(start, self.length) as u8);
            let [low, high] = self.crc_from(start, self.length - 1).to_le_bytes();
            if self.bytes[self.length - 1] == low {
                next.push(high);
            }
        }
        next.sort_unstable();
        next.dedup();
        next
    }

    /// The node after one more byte.
    fn after(&self, byte: u8) -> Node {
        let mut node = self.clone();
        node.bytes[node.length] = byte;
        node.crcs[node.length] = 0xFFFF;
        node.length += 1;
        for crc in &mut node.crcs[..node.length] {
            *crc = continued(*crc, byte);
        }
        node.master.port().arrived.push(byte);
        while !node.master.port().arrived.is_empty() && node.master.is_pending() {
            let _ = node.master.poll();
        }
        node
    }
}

/// The CRC of a frame (serial line guide V1.02, 6.2.2) with one more byte.
fn continued(crc: u16, byte: u8) -> u16 {
    (0..8).fold(crc ^ u16::from(byte), |crc, _| {
        (crc >> 1) ^ if crc & 1 == 1 { 0xA001 } else { 0 }
    })
}

fn crc_of(bytes: &[u8]) -> u16 {
    bytes.iter().fold(0xFFFF, |crc, &byte| continued(crc, byte))
}

/// Tries the stream of a node, and all that begin with it and have up to `longest` bytes.
fn try_all(
    node: &Node,
    request: Request,
    longest: usize,
    allows: &(impl Fn(&[u8], Outcome) -> bool + Sync),
    deadline: Instant,
    tally: &mut Tally,
) {
    let ended = !node.master.is_pending();
    let outcome = outcome_of(&mut node.master.clone());
    tally.streams += 1;
    tally.right += u64::from(outcome.status == Status::OK);
    tally.exceptions += u64::from(outcome.status.code() < 0x80 && outcome.status != Status::OK);
    if !allows(node.stream(), outcome) {
        tally.broken = Some((node.stream().to_vec(), outcome));
    }
    // What follows the end of a request changes nothing.
    if ended || node.length >= longest || tally.broken.is_some() || Instant::now() > deadline {
        return;
    }
    for byte in node.next(request) {
        try_all(&node.after(byte), request, longest, allows, deadline, tally);
    }
}

/// Tries every stream of up to `longest` bytes, on two threads.
pub fn explore(
    request: Request,
    before: Before,
    longest: usize,
    deadline: Instant,
    allows: impl Fn(&[u8], Outcome) -> bool + Sync,
) -> Tally {
    let root = Node {
        bytes: [0; LONGEST],
        crcs: [0xFFFF; LONGEST],
        length: 0,
        master: waiting(request, before),
    };
    let mut tally = Tally::default();
    // The empty stream alone, then those that begin with each byte.
    try_all(&root, request, 0, &allows, deadline, &mut tally);
    let firsts = root.next(request);
    let seconds: Vec<Node> = firsts
        .iter()
        .flat_map(|&first| {
            let node = root.after(first);
            try_all(&node, request, 1, &allows, deadline, &mut tally);
            let next = node.next(request);
            next.into_iter().map(move |second| node.after(second))
        })
        .collect();
    let halves = [0, 1].map(|half| seconds.iter().skip(half).step_by(2));
    std::thread::scope(|scope| {
        let (allows, threads) = (&allows, halves);
        let threads = threads.map(|nodes| {
            scope.spawn(move || {
                let mut tally = Tally::default();
                for node in nodes {
                    try_all(node, request, longest, allows, deadline, &mut tally);
                }
                tally
            })
        });
        for thread in threads {
            tally.add(thread.join().expect("a thread that ends"));
        }
    });
    tally
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Duration;

    fn soon() -> Instant {
        Instant::now() + Duration::from_secs(120)
    }

    /// Every way to an answer is among the streams: a check that forbids it is broken.
    #[test]
    fn the_streams_lead_to_replies_and_exceptions() {
        for (request, longest) in [(Request::Read, 7), (Request::Write, 8)] {
            for before in [Before::Nothing, Before::Timeout] {
                let tally = explore(request, before, longest, soon(), |stream, outcome| {
                    outcome.status != Status::OK || stream.len() < longest
                });
                assert!(tally.broken.is_some(), "{request:?} {before:?}");
                let tally = explore(request, before, 5, soon(), |_, outcome| {
                    outcome.status.is_failure()
                });
                assert!(tally.broken.is_some(), "{request:?} {before:?}");
            }
        }
    }

    #[test]
    fn a_stream_that_holds_no_reply_has_no_result() {
        let reply = [17, 3, 2, 0, 9, 0xB9, 0x81];
        let value = |stream: &[u8]| Request::Read.results(stream).next().map(|(_, r)| r.value);
        assert_eq!(crc_of(&reply[..5]).to_le_bytes(), reply[5..]);
        assert_eq!(value(&reply), Some(9));
        assert_eq!(value(&[&[0, 17], &reply[..]].concat()), Some(9));
        assert_eq!(value(&reply[..6]), None);
        assert_eq!(Request::Write.results(&reply).next(), None);
    }
}
