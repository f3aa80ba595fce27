//! A line or connection of a server whose functions are futures, with its own clock. Bytes arrive at set
//! times; those that leave while the driver is on reach the client.

use embedded_hal_async::delay::DelayNs;
use embedded_io_async::{ErrorKind, ErrorType, Read, Write};
use std::collections::VecDeque;
use std::future::{poll_fn, Future};
use std::pin::{pin, Pin};
use std::sync::{Arc, Mutex, MutexGuard};
use std::task::{Context, Poll, Waker};

/// The duration of a character at 115200 baud, and of t3.5, in microseconds.
pub const CHARACTER: u32 = 96;
pub const SILENCE: u32 = 1_750;

/// The microseconds between two polls.
pub const STEP: u32 = 50;

pub struct State {
    pub now: u32,
    arriving: VecDeque<(u32, u8)>,
    /// How many bytes a read returns at most.
    pub per_read: usize,
    /// So many reads fail.
    pub read_failures: u32,
    /// No more bytes arrive after those on their way.
    pub is_closed: bool,
    /// Bytes that the device has taken, with the times at which they have left.
    leaving: VecDeque<(u32, u8)>,
    /// How many bytes the device takes at most, and holds at most.
    pub per_write: usize,
    pub space: usize,
    pub write_fails: bool,
    /// A flush ends while bytes are left in the hardware.
    pub flushes_early: bool,
    pub driver: bool,
    /// The driver was switched this often.
    pub switched: u32,
    /// The bytes that the client has received, with their times.
    pub received: Vec<(u32, u8)>,
    /// Sent bytes arrive at the server.
    pub has_echo: bool,
}

#[derive(Clone)]
pub struct Line(Arc<Mutex<State>>);

impl Default for Line {
    fn default() -> Self {
        Line(Arc::new(Mutex::new(State {
            now: 0xFFFF_0000,
            arriving: VecDeque::new(),
            per_read: usize::MAX,
            read_failures: 0,
            is_closed: false,
            leaving: VecDeque::new(),
            per_write: usize::MAX,
            space: usize::MAX,
            write_fails: false,
            flushes_early: false,
            driver: false,
            switched: 0,
            received: Vec::new(),
            has_echo: false,
        })))
    }
}

impl Line {
    pub fn state(&self) -> MutexGuard<'_, State> {
        self.0.lock().unwrap()
    }

    pub fn clock(&self) -> impl FnMut() -> u32 + Send + use<> {
        let line = self.clone();
        move || line.state().now
    }

    pub fn driver(&self) -> impl FnMut(bool) + Send + use<> {
        let line = self.clone();
        move |on| {
            let mut state = line.state();
            state.driver = on;
            state.switched += 1;
        }
    }

    /// Lets bytes arrive one character time apart, the first `after` microseconds after the last one.
    pub fn arrive(&self, after: u32, bytes: &[u8]) {
        let _ = self.arrive_in_blocks(after, 0, bytes);
    }

    /// As [`Line::arrive`], but blocks of bytes arrive at once; 0 for single bytes. Returns the time of
    /// the last byte.
    pub fn arrive_in_blocks(&self, after: u32, block: usize, bytes: &[u8]) -> u32 {
        let mut state = self.state();
        let now = state.now;
        let start = match state.arriving.back() {
            Some(last) if last.0.wrapping_sub(now) < 1 << 31 => last.0,
            _ => now,
        };
        for (index, byte) in bytes.iter().enumerate() {
            let place = match block {
                0 => index + 1,
                block => index / block * block + block,
            } as u32;
            let at = start.wrapping_add(after + place * CHARACTER);
            state.arriving.push_back((at, *byte));
        }
        state.arriving.back().map_or(now, |last| last.0)
    }

    /// Lets time pass.
    pub fn pass(&self, time: u32) {
        let mut state = self.state();
        state.now = state.now.wrapping_add(time);
        let now = state.now;
        while let Some((at, byte)) = state.leaving.front().copied() {
            if now.wrapping_sub(at) >= 1 << 31 {
                break;
            }
            state.leaving.pop_front();
            if state.driver {
                state.received.push((at, byte));
                if state.has_echo {
                    state.arriving.push_back((at, byte));
                }
            }
        }
    }

    /// The bytes that the client has received since the last call.
    pub fn take(&self) -> Vec<u8> {
        let received = std::mem::take(&mut self.state().received);
        received.iter().map(|(_, byte)| *byte).collect()
    }

    /// As [`Line::take`], of the bytes that came after this time.
    pub fn take_after(&self, time: u32) -> Vec<u8> {
        let is_after = |(at, _): &(u32, u8)| at.wrapping_sub(time) < 1 << 31;
        self.state().received.retain(is_after);
        self.take()
    }

    /// Polls a future for some time, and drops it. Returns its output if it has ended.
    pub fn run_for<F: Future>(&self, time: u32, future: F) -> Option<F::Output> {
        let mut future = pin!(future);
        for _ in 0..time.div_ceil(STEP) {
            if let Poll::Ready(output) = poll(future.as_mut()) {
                return Some(output);
            }
            self.pass(STEP);
        }
        None
    }
}

/// Polls a future once.
pub fn poll<F: Future>(future: Pin<&mut F>) -> Poll<F::Output> {
    future.poll(&mut Context::from_waker(Waker::noop()))
}

/// Returns `value` as soon as there is one.
async fn until<T>(mut value: impl FnMut() -> Option<T>) -> T {
    poll_fn(|_| value().map_or(Poll::Pending, Poll::Ready)).await
}

impl ErrorType for Line {
    type Error = ErrorKind;
}

impl Read for Line {
    async fn read(&mut self, bytes: &mut [u8]) -> Result<usize, ErrorKind> {
        assert!(!bytes.is_empty());
        until(|| {
            let state = &mut *self.state();
            if state.read_failures > 0 {
                state.read_failures -= 1;
                return Some(Err(ErrorKind::Other));
            }
            let most = bytes.len().min(state.per_read);
            let mut count = 0;
            while count < most {
                match state.arriving.front() {
                    Some((at, byte)) if state.now.wrapping_sub(*at) < 1 << 31 => {
                        bytes[count] = *byte
                    }
                    _ => break,
                }
                state.arriving.pop_front();
                count += 1;
            }
            (count > 0 || state.is_closed && state.arriving.is_empty()).then_some(Ok(count))
        })
        .await
    }
}

impl Write for Line {
    async fn write(&mut self, bytes: &[u8]) -> Result<usize, ErrorKind> {
        until(|| {
            let state = &mut *self.state();
            if state.write_fails {
                return Some(Err(ErrorKind::BrokenPipe));
            }
            let free = state.space.saturating_sub(state.leaving.len());
            let count = bytes.len().min(state.per_write).min(free);
            let mut at = state.leaving.back().map_or(state.now, |last| last.0);
            for byte in &bytes[..count] {
                at = at.wrapping_add(CHARACTER);
                state.leaving.push_back((at, *byte));
            }
            (count > 0).then_some(Ok(count))
        })
        .await
    }

    async fn flush(&mut self) -> Result<(), ErrorKind> {
        until(|| {
            let state = self.state();
            (state.flushes_early || state.leaving.is_empty()).then_some(Ok(()))
        })
        .await
    }
}

/// The timer of a line.
pub struct Delay(pub Line);

impl DelayNs for Delay {
    async fn delay_ns(&mut self, nanoseconds: u32) {
        let begun = self.0.state().now;
        let time = nanoseconds.div_ceil(1000);
        until(|| (self.0.state().now.wrapping_sub(begun) >= time).then_some(())).await
    }
}
