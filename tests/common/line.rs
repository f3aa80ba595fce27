//! A simulated line with its own clock. Bytes arrive at set times; sent frames are recorded
//! with the time of their first byte.

use super::device::Device;
use mbm::error::Status;
use mbm::frame::Framing;
use mbm::port::Port;
use mbm::server::Server;
use std::cell::RefCell;
use std::collections::VecDeque;
use std::rc::Rc;

/// The duration of a character at 19200 baud, and t3.5, in microseconds.
pub const CHARACTER: u32 = 573;
pub const SILENCE: u32 = 2_006;

#[derive(Default)]
pub struct Wire {
    pub now: u32,
    pub arriving: VecDeque<(u32, u8)>,
    pub sent: Vec<(u32, Vec<u8>)>,
    pub driver: bool,
    pub flushed: bool,
    /// Sent bytes are received again, at once or `echo_late` microseconds later, after `glitch` and
    /// with these bits of the first byte changed.
    pub echo: bool,
    pub echo_late: u32,
    pub echo_damage: u8,
    pub glitch: Vec<u8>,
    /// How many bytes the port accepts at once; 0: all.
    pub piece: usize,
    pub lost: bool,
}

#[derive(Clone, Default)]
pub struct Tap(pub Rc<RefCell<Wire>>);

impl Port for Tap {
    fn read(&mut self, bytes: &mut [u8]) -> Result<usize, mbm::Error> {
        let wire = &mut *self.0.borrow_mut();
        if wire.lost {
            return Err(mbm::Error::LinkLost);
        }
        let mut count = 0;
        for place in bytes {
            match wire.arriving.front() {
                Some((at, byte)) if wire.now.wrapping_sub(*at) < 1 << 31 => *place = *byte,
                _ => break,
            }
            wire.arriving.pop_front();
            count += 1;
        }
        Ok(count)
    }

    fn write(&mut self, bytes: &[u8]) -> Result<usize, mbm::Error> {
        let wire = &mut *self.0.borrow_mut();
        if wire.lost {
            return Err(mbm::Error::LinkLost);
        }
        let count = match wire.piece {
            0 => bytes.len(),
            piece => bytes.len().min(piece),
        };
        assert!(wire.driver);
        let now = wire.now;
        if wire.flushed || wire.sent.is_empty() {
            wire.sent.push((now, Vec::new()));
        }
        wire.flushed = false;
        wire.sent.last_mut().unwrap().1.extend(&bytes[..count]);
        if wire.echo {
            let at = now.wrapping_add(wire.echo_late);
            let mut echo = [&wire.glitch[..], &bytes[..count]].concat();
            echo[0] ^= wire.echo_damage;
            wire.arriving
                .extend(echo.into_iter().map(|byte| (at, byte)));
        }
        Ok(count)
    }

    fn micros(&mut self) -> u32 {
        self.0.borrow().now
    }

    fn flush(&mut self) -> bool {
        self.0.borrow_mut().flushed = true;
        true
    }

    fn pre_transmission(&mut self) {
        self.0.borrow_mut().driver = true;
    }

    fn post_transmission(&mut self) {
        self.0.borrow_mut().driver = false;
    }
}

/// A server with a device on such a line.
pub struct Line {
    pub wire: Rc<RefCell<Wire>>,
    pub server: Server<Tap, [u8; 600]>,
    pub device: Device,
}

impl Line {
    pub fn new(framing: Framing) -> Self {
        let tap = Tap::default();
        let wire = tap.0.clone();
        wire.borrow_mut().now = 0xFFFF_0000;
        let mut server = Server::with_framing(framing, tap, [0; 600]);
        if framing == Framing::Rtu {
            server.set_baud_rate(19_200);
        }
        Line {
            wire,
            server,
            device: Device::new(),
        }
    }

    /// Adds bytes that arrive one character time apart. The first arrives `after`
    /// microseconds after the last one added so far.
    pub fn arrive(&mut self, after: u32, bytes: &[u8]) {
        let wire = &mut *self.wire.borrow_mut();
        let last = wire.arriving.back().map_or(wire.now, |last| last.0);
        let mut at = last.wrapping_add(after);
        for byte in bytes {
            wire.arriving.push_back((at, *byte));
            at = at.wrapping_add(CHARACTER);
        }
    }

    /// Polls once.
    pub fn poll(&mut self) -> Status {
        let now = self.wire.borrow().now;
        let server = &mut self.server;
        self.device
            .with_unit(|unit| server.serve(now, &mut [unit][..]))
            .into()
    }

    /// Polls every `step` microseconds for `time` microseconds; returns the sent frames.
    pub fn run(&mut self, time: u32, step: u32) -> Vec<(u32, Vec<u8>)> {
        let start = self.wire.borrow().now;
        while self.wire.borrow().now.wrapping_sub(start) < time {
            let _ = self.poll();
            let now = self.wire.borrow().now;
            self.wire.borrow_mut().now = now.wrapping_add(step);
        }
        std::mem::take(&mut self.wire.borrow_mut().sent)
    }

    /// Like `run`, but returns the frames without their times.
    pub fn frames(&mut self, time: u32, step: u32) -> Vec<Vec<u8>> {
        self.run(time, step)
            .into_iter()
            .map(|sent| sent.1)
            .collect()
    }
}
