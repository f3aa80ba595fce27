//! A master, a device that answers in order, and an adversary between them.

use crate::wire::{self, Lent, Wire};
use mbm::error::Status;
use mbm::frame::rtu;
use mbm::master::Master;
use std::hash::{DefaultHasher, Hash, Hasher};

/// The unit of the device.
const UNIT: u8 = 17;

/// Times in ticks of the model's clock. Only their order and their sums matter.
const SILENCE: u32 = 1;
pub const QUIET: u32 = 4;
const TIMEOUT: u32 = 10;

/// The longest time in ticks that affects the master. Longer times are cut to it.
const LONGEST: u32 = 100;

/// The fault of a request that continues after its end.
pub const TWICE: &str = "a request ended twice";

/// What the adversary may do next.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Event {
    /// The device sends the oldest reply that it owes, and it arrives.
    Reply,
    /// The device sends an exception instead of the oldest reply that it owes.
    Exception,
    /// The oldest owed reply arrives with one bit of its CRC changed.
    Damaged,
    /// Only the first half of the oldest owed reply arrives.
    FirstHalf,
    /// Only the second half of the oldest owed reply arrives.
    SecondHalf,
    /// The oldest owed reply is lost.
    Lost,
    /// A byte 0x00 arrives.
    Zero,
    /// Two bytes arrive that look like the beginning of a reply.
    LooksLikeReply,
    /// A reply of another unit arrives.
    Foreign,
    /// The clock moves on by this many ticks, then the master is polled.
    Step(u8),
    /// The user cancels the request.
    Cancel,
}

/// Everything that determines later events, and everything that the properties check.
#[derive(Clone, Debug)]
pub struct State {
    master: Master<Wire, Lent>,
    /// The numbers of the requests that the device has not answered, in order.
    owed: Vec<u8>,
    /// The number of the last request. The device replies with this number as the value.
    number: u8,
    /// How long the active request has lasted, in ticks.
    lasts: u32,
    /// How long no byte has arrived, in ticks; at most `QUIET`.
    silent: u32,
    /// The reply to the active request has arrived damaged.
    own_damaged: bool,
    /// An exception has arrived as the reply to the active request.
    own_exception: bool,
    /// The device still owes a reply to a request that succeeded: the device left more than the
    /// quiet time between two replies, or a reply was lost. The master cannot detect this.
    beyond_bound: bool,
    /// The previous request got its own reply.
    right: bool,
    /// The fault that was found, if any.
    pub wrong: Option<&'static str>,
}

impl Hash for State {
    fn hash<H: Hasher>(&self, hasher: &mut H) {
        self.master.hash(hasher);
        self.owed.hash(hasher);
        (self.number, self.lasts, self.silent).hash(hasher);
        (self.own_damaged, self.own_exception, self.beyond_bound).hash(hasher);
        self.wrong.hash(hasher);
    }
}

impl PartialEq for State {
    fn eq(&self, other: &Self) -> bool {
        let hash = |state: &State| {
            let mut hasher = DefaultHasher::new();
            state.hash(&mut hasher);
            hasher.finish()
        };
        hash(self) == hash(other)
    }
}

fn frame(unit: u8, pdu: &[u8]) -> Vec<u8> {
    let mut buffer = [0; 16];
    let length = rtu::emit(&mut buffer, unit, |place| {
        place[..pdu.len()].copy_from_slice(pdu);
        Ok(pdu.len())
    });
    buffer[..length.expect("the frame fits")].to_vec()
}

fn reply(unit: u8, number: u8) -> Vec<u8> {
    frame(unit, &[3, 2, 0, number])
}

impl State {
    /// A master that has just started its first request.
    pub fn new(buffer: usize, retries: u8, quiet_time: u32) -> Self {
        let mut master = Master::new(UNIT, Wire::default(), wire::lent(buffer));
        let settings = master.settings();
        settings.gap = SILENCE;
        settings.silence = SILENCE;
        settings.response_timeout = TIMEOUT;
        settings.quiet_time = quiet_time;
        settings.retries = retries;
        let mut state = State {
            master,
            owed: Vec::new(),
            number: 0,
            lasts: 0,
            silent: QUIET,
            own_damaged: false,
            own_exception: false,
            beyond_bound: false,
            right: false,
            wrong: None,
        };
        state.start();
        state
    }

    /// The events that are possible, with or without noise.
    pub fn events(&self, noise: bool, events: &mut Vec<Event>) {
        if self.wrong.is_some() {
            return;
        }
        events.extend([Event::Step(1), Event::Step(4), Event::Step(10)]);
        if !self.owed.is_empty() {
            events.extend([Event::Reply, Event::Damaged, Event::FirstHalf, Event::Lost]);
        }
        if noise {
            events.extend([
                Event::Zero,
                Event::LooksLikeReply,
                Event::Foreign,
                Event::Cancel,
            ]);
            if !self.owed.is_empty() {
                events.extend([Event::Exception, Event::SecondHalf]);
            }
        }
    }

    /// The state after an event.
    pub fn after(&self, event: Event) -> State {
        let mut state = self.clone();
        state.happen(event);
        state
    }

    fn happen(&mut self, event: Event) {
        match event {
            Event::Step(time) => return self.step(time.into()),
            Event::Cancel => {
                self.master.cancel();
                return self.ended();
            }
            Event::Zero => return self.arrive(&[0]),
            Event::LooksLikeReply => return self.arrive(&[UNIT, 3]),
            Event::Foreign => return self.arrive(&reply(UNIT + 1, 0x55)),
            _ => {}
        }
        let number = self.owed.remove(0);
        let own = number == self.number;
        let mut bytes = reply(UNIT, number);
        let half = bytes.len() / 2;
        match event {
            Event::Exception => {
                bytes = frame(UNIT, &[0x83, 2]);
                self.own_exception |= own;
            }
            Event::Damaged => {
                *bytes.last_mut().expect("a frame") ^= 0x40;
                self.own_damaged |= own;
            }
            Event::FirstHalf => {
                bytes.truncate(half);
                self.own_damaged |= own;
            }
            Event::SecondHalf => {
                bytes.drain(..half);
            }
            Event::Lost => bytes.clear(),
            _ => {}
        }
        self.arrive(&bytes);
    }

    fn arrive(&mut self, bytes: &[u8]) {
        self.master.port().arrived.extend_from_slice(bytes);
        if !bytes.is_empty() {
            self.silent = 0;
        }
    }

    fn start(&mut self) {
        wire::clear(self.master.storage());
        self.number = (self.number + 1) % 16;
        self.lasts = 0;
        self.own_damaged = false;
        self.own_exception = false;
        if self.master.read_holding_registers(0, 1) != Status::PENDING {
            self.wrong = Some("a request was refused");
        }
    }

    /// Moves the clock on, and polls until the master waits.
    fn step(&mut self, time: u32) {
        self.master.port().now = time;
        self.lasts += time;
        self.silent = (self.silent + time).min(QUIET);
        for _ in 0..16 {
            self.master.poll();
            if !std::mem::take(&mut self.master.port().sent).is_empty() {
                self.owed.push(self.number);
            }
            if !self.master.is_pending() {
                self.ended();
                break;
            }
            if self.master.is_waiting() {
                break;
            }
        }
        self.master.rebase(time, LONGEST);
        // Nothing depends on the counters.
        self.master.storage().counters.fill(0);
        self.master.port().now = 0;
    }

    /// Checks how the request has ended, and starts the next one.
    fn ended(&mut self) {
        let status = self.master.status();
        if self.master.poll() != status || self.master.is_pending() {
            self.wrong = Some(TWICE);
        }
        let answered = !status.is_failure();
        self.right = status == Status::OK && self.master.response_word(0) == u16::from(self.number);
        if answered {
            let own = self.right || (status != Status::OK && self.own_exception);
            if !own && !self.beyond_bound {
                if self.own_damaged {
                    self.wrong =
                        Some("a late reply was taken though the right one arrived damaged");
                } else if self.silent < QUIET {
                    self.wrong = Some("a late reply was taken before the quiet time had passed");
                }
            }
        }
        // Another reply may follow that the master does not expect.
        self.beyond_bound = answered && !self.owed.is_empty();
        self.start();
    }

    /// True if the request has not lasted longer than a request may.
    pub fn ends_in_time(&self, retries: u8) -> bool {
        // Each attempt: the quiet time before it, and the wait for its reply. A poll may come
        // up to 10 ticks late.
        let attempt = (TIMEOUT + QUIET) + (2 * TIMEOUT + QUIET) + 3 * 10;
        self.lasts <= attempt * (u32::from(retries) + 1)
    }

    /// True if the second request from now on gets its own reply, provided that the device owes
    /// no earlier reply and answers at once.
    pub fn recovers(&self) -> bool {
        let mut state = self.clone();
        state.owed.clear();
        let first = state.number;
        for _ in 0..400 {
            let number = state.number;
            if number == (first + 3) % 16 {
                return state.right;
            }
            if !state.owed.is_empty() {
                if number == first {
                    // A retry of the active request.
                    state.happen(Event::Lost);
                } else {
                    state.happen(Event::Reply);
                }
            }
            state.step(1);
        }
        false
    }
}
