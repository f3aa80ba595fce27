//! The simulated lines and streams, their clock, and the ports of those that are connected.

use mbm_c::*;
use std::cell::RefCell;
use std::collections::VecDeque;
use std::ffi::c_void;
use std::rc::Rc;

/// How a UART or its driver hands bytes over: once `bytes` have arrived, or after `delay`
/// microseconds without one.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Block {
    pub bytes: usize,
    pub delay: u64,
}

/// What the clock of the ports shows at the beginning: it wraps after a second.
const START: u32 = 0u32.wrapping_sub(1_000_000);

/// All bytes that an end has sent without a pause.
pub struct Sent {
    pub end: usize,
    pub medium: usize,
    /// When the last bit left.
    pub at: u64,
    pub bytes: Vec<u8>,
}

/// One end of a line or stream.
struct End {
    medium: usize,
    block: Block,
    arriving: VecDeque<(u64, u8)>,
    /// What has arrived, and was not handed over yet.
    held: Vec<u8>,
    last_arrival: u64,
    readable: VecDeque<u8>,
    frame: Vec<u8>,
    /// When the last bit of `frame` leaves.
    frame_end: u64,
    /// The end receives its own frames, but for this many bytes of each.
    echo: Option<usize>,
    /// The peer has closed the stream.
    is_closed: bool,
}

/// All lines and streams of a case.
#[derive(Default)]
pub struct Wire {
    /// Microseconds since the case began.
    pub now: u64,
    /// Microseconds that a character takes on the medium 0.
    pub character: u64,
    ends: Vec<End>,
    /// Until when a device or a scripted peer sends on each medium.
    taken: Vec<u64>,
    pub sent: VecDeque<Sent>,
}

pub type Shared = Rc<RefCell<Wire>>;

impl Wire {
    /// Adds an end, and returns its number.
    pub fn connect(&mut self, medium: usize, block: Block) -> usize {
        self.taken.resize(self.taken.len().max(medium + 1), 0);
        self.ends.push(End {
            medium,
            block,
            arriving: VecDeque::new(),
            held: Vec::new(),
            last_arrival: 0,
            readable: VecDeque::new(),
            frame: Vec::new(),
            frame_end: 0,
            echo: None,
            is_closed: false,
        });
        self.ends.len() - 1
    }

    pub fn set_echo(&mut self, end: usize, lost: usize) {
        self.ends[end].echo = Some(lost);
    }

    /// The peer closes the stream.
    pub fn close(&mut self, end: usize) {
        self.ends[end].is_closed = true;
    }

    /// A new stream.
    pub fn reopen(&mut self, end: usize) {
        let end = &mut self.ends[end];
        end.is_closed = false;
        end.arriving.clear();
        end.held.clear();
        end.readable.clear();
        end.frame.clear();
    }

    fn character_of(&self, medium: usize) -> u64 {
        match medium {
            0 => self.character,
            _ => 0,
        }
    }

    /// The silence on the line before a frame of `bytes` bytes that has ended at `end`; before
    /// the first frame it has no limit.
    pub fn silence(&self, bytes: usize, end: u64) -> u64 {
        if self.taken[0] == 0 {
            return u64::MAX;
        }
        let begin = end.saturating_sub(self.character * bytes as u64);
        begin.saturating_sub(self.taken[0])
    }

    /// The time at which no device and no scripted peer sends on a medium any more.
    pub fn free(&self, medium: usize) -> u64 {
        self.taken[medium].max(self.now)
    }

    /// Bytes of a device or a scripted peer, from `at` on, or from when the medium is free.
    /// Returns when the last one has arrived.
    pub fn deliver(&mut self, medium: usize, at: u64, bytes: &[u8]) -> u64 {
        let mut at = at.max(self.taken[medium]);
        for byte in bytes {
            at += self.character_of(medium);
            self.arrive(medium, None, at, *byte);
        }
        self.taken[medium] = at;
        at
    }

    fn arrive(&mut self, medium: usize, except: Option<usize>, at: u64, byte: u8) {
        for (index, end) in self.ends.iter_mut().enumerate() {
            if end.medium == medium && except != Some(index) {
                let place = end.arriving.iter().rposition(|(time, _)| *time <= at);
                let place = place.map_or(0, |place| place + 1);
                end.arriving.insert(place, (at, byte));
            }
        }
    }

    /// Lets the time be `now`.
    pub fn advance(&mut self, now: u64) {
        self.now = now;
        for (index, end) in self.ends.iter_mut().enumerate() {
            let Block { bytes, delay } = end.block;
            while let Some((at, byte)) = end.arriving.front().copied() {
                if at > now {
                    break;
                }
                end.arriving.pop_front();
                if at - end.last_arrival >= delay.max(1) {
                    end.readable.extend(end.held.drain(..));
                }
                end.last_arrival = at;
                end.held.push(byte);
                if end.held.len() >= bytes {
                    end.readable.extend(end.held.drain(..));
                }
            }
            if now - end.last_arrival >= delay {
                end.readable.extend(end.held.drain(..));
            }
            if !end.frame.is_empty() && end.frame_end <= now {
                self.sent.push_back(Sent {
                    end: index,
                    medium: end.medium,
                    at: end.frame_end,
                    bytes: std::mem::take(&mut end.frame),
                });
            }
        }
    }

    /// When something happens next, if no end does anything.
    pub fn next(&self) -> Option<u64> {
        let times = self.ends.iter().flat_map(|end| {
            let held = (!end.held.is_empty()).then(|| end.last_arrival + end.block.delay);
            let frame = (!end.frame.is_empty()).then_some(end.frame_end);
            let first = end.arriving.front().map(|first| first.0);
            [held, frame, first]
        });
        times.flatten().min()
    }

    /// What has been handed over to the end.
    pub fn take(&mut self, end: usize) -> Vec<u8> {
        self.ends[end].readable.drain(..).collect()
    }

    /// An end sends.
    pub fn send(&mut self, index: usize, bytes: &[u8]) {
        let medium = self.ends[index].medium;
        let character = self.character_of(medium);
        for byte in bytes {
            let end = &mut self.ends[index];
            end.frame_end = end.frame_end.max(self.now) + character;
            end.frame.push(*byte);
            let (at, count) = (end.frame_end, end.frame.len());
            let is_heard = end.echo.is_some_and(|lost| count > lost);
            self.arrive(medium, (!is_heard).then_some(index), at, *byte);
        }
    }
}

/// The context of a port's hooks.
pub struct Tap {
    pub wire: Shared,
    pub end: usize,
}

impl Tap {
    pub fn new(wire: &Shared, end: usize) -> Box<Tap> {
        let wire = wire.clone();
        Box::new(Tap { wire, end })
    }

    /// The port of this end. The tap must outlive it.
    pub fn port(&self) -> mbm_port {
        mbm_port {
            context: (&raw const *self).cast_mut().cast(),
            read: Some(read),
            write: Some(write),
            micros: Some(micros),
            flush: Some(flush),
            preTransmission: None,
            postTransmission: None,
            idle: None,
        }
    }
}

// SAFETY, of all hooks: their context is a tap, and the library passes bytes that are valid.
unsafe extern "C" fn read(context: *mut c_void, bytes: *mut u8, capacity: u16) -> i16 {
    let (tap, bytes) = unsafe {
        let bytes = std::slice::from_raw_parts_mut(bytes, capacity.into());
        (&*context.cast::<Tap>(), bytes)
    };
    let end = &mut tap.wire.borrow_mut().ends[tap.end];
    if end.readable.is_empty() && end.is_closed {
        return -1;
    }
    let count = end.readable.len().min(bytes.len());
    for (place, byte) in bytes.iter_mut().zip(end.readable.drain(..count)) {
        *place = byte;
    }
    count as i16
}

unsafe extern "C" fn write(context: *mut c_void, bytes: *const u8, length: u16) -> i16 {
    let (tap, bytes) = unsafe {
        let bytes = std::slice::from_raw_parts(bytes, length.into());
        (&*context.cast::<Tap>(), bytes)
    };
    let wire = &mut *tap.wire.borrow_mut();
    if wire.ends[tap.end].is_closed {
        return -1;
    }
    wire.send(tap.end, bytes);
    length as i16
}

unsafe extern "C" fn micros(context: *mut c_void) -> u32 {
    let tap = unsafe { &*context.cast::<Tap>() };
    clock(tap.wire.borrow().now)
}

unsafe extern "C" fn flush(context: *mut c_void) -> u8 {
    let tap = unsafe { &*context.cast::<Tap>() };
    let wire = tap.wire.borrow();
    (wire.ends[tap.end].frame_end <= wire.now).into()
}

/// What the clock of the ports shows.
pub fn clock(now: u64) -> u32 {
    START.wrapping_add(now as u32)
}
