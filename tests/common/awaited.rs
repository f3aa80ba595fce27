//! A link with a device, for clients whose functions are futures: bytes that are on their way, and a
//! clock that passes with each poll.
#![allow(dead_code)] // Not every test uses everything.

use super::frame::framed;
use embedded_hal_async::delay::DelayNs;
use embedded_io_async::{ErrorKind, ErrorType, Read, Write};
use mbm::frame::{ascii::END, Framing};
use std::cell::RefCell;
use std::collections::VecDeque;
use std::future::{poll_fn, Future};
use std::pin::{pin, Pin};
use std::rc::Rc;
use std::task::{Context, Poll, Waker};

/// The unit of the device.
pub const UNIT: u8 = 17;
/// Time of a character of the device.
const CHARACTER: u32 = 100;
/// The silence that ends a frame on a serial line.
const SILENCE: u32 = 1_750;
/// The time that passes from one poll to the next.
const STEP: u32 = 100;

/// The register at this address.
pub fn value(address: u16) -> u16 {
    address.wrapping_mul(40503).wrapping_add(0x1234)
}

/// The link.
pub struct Net {
    pub framing: Framing,
    /// Silence ends a frame. Otherwise the device takes the stream apart by lengths alone.
    pub is_serial: bool,
    pub now: u32,
    /// The most bytes that a write takes. With 0 it waits.
    pub accepts: usize,
    /// How many bytes writes take in all, before they wait.
    pub budget: usize,
    pub is_closed: bool,
    pub read_fails: bool,
    pub write_fails: bool,
    pub flush_fails: bool,
    /// A flush waits.
    pub flush_waits: bool,
    /// The device answers nothing.
    pub is_silent: bool,
    /// The time until it answers.
    pub latency: u32,
    /// How many bytes were sent to the device.
    pub sent: usize,
    /// The requests that the device has received: unit and PDU.
    pub requests: Vec<Vec<u8>>,
    pub driver: bool,
    receiving: Vec<u8>,
    last_byte: u32,
    /// Bytes on their way to the client, each with the time at which it arrives.
    pub arriving: VecDeque<(u32, u8)>,
}

pub type Link = Rc<RefCell<Net>>;

impl Net {
    pub fn new(framing: Framing, is_serial: bool) -> Link {
        Rc::new(RefCell::new(Net {
            framing,
            is_serial,
            now: 0,
            accepts: usize::MAX,
            budget: usize::MAX,
            is_closed: false,
            read_fails: false,
            write_fails: false,
            flush_fails: false,
            flush_waits: false,
            is_silent: false,
            latency: 1_000,
            sent: 0,
            requests: vec![],
            driver: false,
            receiving: vec![],
            last_byte: 0,
            arriving: VecDeque::new(),
        }))
    }

    /// A new connection in the place of the old one.
    pub fn reopen(&mut self) {
        self.is_closed = false;
        self.write_fails = false;
        self.receiving.clear();
        self.arriving.clear();
        (self.accepts, self.budget) = (usize::MAX, usize::MAX);
    }

    /// Sends bytes to the client after `wait` microseconds.
    pub fn arrive(&mut self, wait: u32, bytes: &[u8]) {
        let last = self.arriving.back().map_or(0, |(time, _)| *time);
        let first = last.max(self.now + wait);
        let times = (1..).map(|at| first + at * CHARACTER);
        self.arriving.extend(times.zip(bytes.iter().copied()));
    }

    /// The device receives bytes.
    fn receive(&mut self, bytes: &[u8]) {
        self.sent += bytes.len();
        if self.is_serial && self.now - self.last_byte > SILENCE {
            self.receiving.clear();
        }
        self.last_byte = self.now;
        self.receiving.extend_from_slice(bytes);
        while let Some(length) = self.frame_length() {
            let frame: Vec<u8> = self.receiving.drain(..length).collect();
            self.take(frame);
        }
    }

    /// The length of the first frame that was received; `None` if it is not complete.
    fn frame_length(&self) -> Option<usize> {
        let bytes = &self.receiving;
        let length = match self.framing {
            Framing::Tcp => 6 + usize::from(u16::from_be_bytes([*bytes.get(4)?, *bytes.get(5)?])),
            Framing::Ascii => 1 + bytes.iter().position(|byte| *byte == END)?,
            Framing::Rtu | Framing::RtuOverTcp => match *bytes.get(1)? {
                15 | 16 => 9 + usize::from(*bytes.get(6)?),
                _ => 8,
            },
        };
        (length <= bytes.len()).then_some(length)
    }

    /// The device takes a frame. On a stream, bytes that are none mean that it has lost its place, for
    /// ever.
    fn take(&mut self, mut frame: Vec<u8>) {
        let copy = frame.clone();
        let Ok(parsed) = self.framing.parse(&mut frame, END) else {
            assert!(self.is_serial, "the device misreads {copy:02X?}");
            return;
        };
        let (unit, transaction) = (parsed.unit, parsed.transaction);
        let request = [&[unit], parsed.pdu].concat();
        self.requests.push(request.clone());
        if self.is_silent || unit != UNIT {
            return;
        }
        let response = respond(&request[1..]);
        let response = framed(self.framing, transaction, unit, &response);
        self.arrive(self.latency, &response);
    }
}

/// The response of the device: each register has its [`value`], and each write is answered.
fn respond(request: &[u8]) -> Vec<u8> {
    let word = |at: usize| u16::from_be_bytes([request[at], request[at + 1]]);
    match request[0] {
        3 | 4 => {
            let values = (0..word(3)).flat_map(|at| value(word(1).wrapping_add(at)).to_be_bytes());
            [request[0], 2 * request[4]]
                .into_iter()
                .chain(values)
                .collect()
        }
        6 => request.to_vec(),
        16 => request[..5].to_vec(),
        function => vec![function | 0x80, 1],
    }
}

/// The client's end of the link.
#[derive(Clone)]
pub struct Socket(pub Link);

impl ErrorType for Socket {
    type Error = ErrorKind;
}

/// Returns `value` as soon as there is one.
pub async fn until<T>(mut value: impl FnMut() -> Option<T>) -> T {
    poll_fn(|_| match value() {
        Some(value) => Poll::Ready(value),
        None => Poll::Pending,
    })
    .await
}

impl Read for Socket {
    async fn read(&mut self, bytes: &mut [u8]) -> Result<usize, ErrorKind> {
        assert!(!bytes.is_empty());
        until(|| {
            let net = &mut *self.0.borrow_mut();
            if std::mem::take(&mut net.read_fails) {
                return Some(Err(ErrorKind::Other));
            }
            let now = net.now;
            let here = net.arriving.iter().take_while(|(time, _)| *time <= now);
            let count = here.count().min(bytes.len());
            for (place, (_, byte)) in bytes.iter_mut().zip(net.arriving.drain(..count)) {
                *place = byte;
            }
            (count > 0 || net.is_closed).then_some(Ok(count))
        })
        .await
    }
}

impl Write for Socket {
    async fn write(&mut self, bytes: &[u8]) -> Result<usize, ErrorKind> {
        until(|| {
            let net = &mut *self.0.borrow_mut();
            if net.write_fails || net.is_closed {
                return Some(Err(ErrorKind::BrokenPipe));
            }
            let count = bytes.len().min(net.accepts).min(net.budget);
            net.budget -= count;
            net.receive(&bytes[..count]);
            (count > 0).then_some(Ok(count))
        })
        .await
    }

    async fn flush(&mut self) -> Result<(), ErrorKind> {
        until(|| {
            let net = self.0.borrow();
            match net.flush_fails {
                true => Some(Err(ErrorKind::BrokenPipe)),
                false => (!net.flush_waits).then_some(Ok(())),
            }
        })
        .await
    }
}

pub struct Delay(pub Link);

impl DelayNs for Delay {
    async fn delay_ns(&mut self, nanoseconds: u32) {
        let end = self.0.borrow().now + nanoseconds.div_ceil(1000);
        until(|| (self.0.borrow().now >= end).then_some(())).await
    }
}

/// Polls a future once.
pub fn poll<F: Future>(future: Pin<&mut F>) -> Poll<F::Output> {
    future.poll(&mut Context::from_waker(Waker::noop()))
}

/// Runs a future to its end.
pub fn run<F: Future>(link: &Link, future: F) -> F::Output {
    run_for(link, future, 60_000_000).expect("the future does not end")
}

/// Polls a future until it ends or the time has passed, as a program with a timeout does.
pub fn run_for<F: Future>(link: &Link, future: F, limit: u32) -> Option<F::Output> {
    let end = link.borrow().now + limit;
    let mut future = pin!(future);
    while link.borrow().now < end {
        if let Poll::Ready(output) = poll(future.as_mut()) {
            return Some(output);
        }
        link.borrow_mut().now += STEP;
    }
    None
}

/// Polls a future until the condition is true, and drops it.
pub fn drop_when<F: Future>(link: &Link, future: F, condition: impl Fn(&Net) -> bool) {
    let mut future = pin!(future);
    while !condition(&link.borrow()) {
        assert!(poll(future.as_mut()).is_pending());
        link.borrow_mut().now += STEP;
    }
}
