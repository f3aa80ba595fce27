//! A master, a device that answers in order, and an adversary between them.

use crate::wire::{self, Lent, Wire};
use mbm::engine::Setting;
use mbm::error::Status;
use mbm::frame::rtu;
use mbm::master::Master;
use std::hash::{DefaultHasher, Hash, Hasher};

/// The unit of the device.
const UNIT: u8 = 17;

/// Times in ticks of the model's clock. Only their order and their sums matter.
const SILENCE: u32 = 1;
pub const QUIET: u32 = 4;
pub const TIMEOUT: u32 = 10;

/// How many replies of a device with a latency may be late.
const LATE_REPLIES: u8 = 2;

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
    /// The device with a latency takes this many ticks longer for its reply.
    Late(u8),
    /// The user starts the next request.
    Start,
}

/// A device with a latency: it takes the same time for each reply, but for a few late ones.
#[derive(Clone, Hash, Debug)]
struct Slow {
    /// Ticks that the device takes for a reply.
    latency: u32,
    /// Ticks until the device sends the oldest reply that it owes.
    left: u32,
    /// How many more replies may be late.
    late: u8,
    /// The oldest reply that it owes may be late: when its request came, the device owed none.
    may_be_late: bool,
    /// No request is active, and the user has not started the next one.
    paused: bool,
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
    /// How long no byte has arrived, in ticks; at most `TIMEOUT`.
    silent: u32,
    /// The reply to the active request has arrived damaged.
    own_damaged: bool,
    /// An exception has arrived as the reply to the active request.
    own_exception: bool,
    /// The device still owes a reply to a request that succeeded: the device left more than the
    /// quiet time between two replies, or a reply was lost. The master cannot detect this.
    beyond_bound: bool,
    /// How long the line must be silent before a reply after a failure is accepted, in ticks.
    hold: u32,
    /// The previous request got its own reply.
    right: bool,
    /// The device, if it is one with a latency. Otherwise the adversary sends its replies.
    slow: Option<Slow>,
    /// The fault that was found, if any.
    pub wrong: Option<&'static str>,
}

impl Hash for State {
    fn hash<H: Hasher>(&self, hasher: &mut H) {
        self.master.hash(hasher);
        self.owed.hash(hasher);
        (self.number, self.lasts, self.silent).hash(hasher);
        (self.own_damaged, self.own_exception, self.beyond_bound).hash(hasher);
        (self.hold, &self.slow).hash(hasher);
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
        settings.gap = Setting::new(SILENCE);
        settings.silence = Setting::new(SILENCE);
        settings.response_timeout = Setting::new(TIMEOUT);
        settings.quiet_time = Setting::new(quiet_time);
        settings.retries = retries;
        let mut state = State {
            master,
            owed: Vec::new(),
            number: 0,
            lasts: 0,
            silent: TIMEOUT,
            own_damaged: false,
            own_exception: false,
            beyond_bound: false,
            hold: 0,
            right: false,
            slow: None,
            wrong: None,
        };
        state.start();
        state
    }

    /// As [`State::new`], with a device that takes `latency` ticks for a reply.
    pub fn with_latency(buffer: usize, retries: u8, latency: u32) -> Self {
        let mut state = State::new(buffer, retries, QUIET);
        state.slow = Some(Slow {
            latency,
            left: latency,
            late: LATE_REPLIES,
            may_be_late: false,
            paused: false,
        });
        state
    }

    /// The events that are possible, with or without noise.
    pub fn events(&self, noise: bool, events: &mut Vec<Event>) {
        if self.wrong.is_some() {
            return;
        }
        if let Some(slow) = &self.slow {
            events.push(Event::Step(1));
            if slow.paused {
                events.push(Event::Start);
            }
            if slow.late > 0 && slow.may_be_late {
                events.extend([1, 5, 11, 25].map(Event::Late));
            }
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
            Event::Start => return self.start(),
            Event::Late(time) => {
                if let Some(slow) = &mut self.slow {
                    slow.left += TIMEOUT - slow.latency + u32::from(time);
                    slow.late -= 1;
                    slow.may_be_late = false;
                }
                return;
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
        if let Some(slow) = &mut self.slow {
            slow.paused = false;
        }
        self.lasts = 0;
        self.own_damaged = false;
        self.own_exception = false;
        if self.master.read_holding_registers(0, 1).is_err() {
            self.wrong = Some("a request was refused");
        }
    }

    /// Moves the clock on, and polls until the master waits.
    fn step(&mut self, time: u32) {
        self.master.port().now = time;
        if !self.slow.as_ref().is_some_and(|slow| slow.paused) {
            self.lasts += time;
        }
        self.silent = (self.silent + time).min(TIMEOUT);
        self.send_slow_reply(time);
        for _ in 0..16 {
            let _ = self.master.poll();
            if !std::mem::take(&mut self.master.port().sent).is_empty() {
                if let Some(slow) = &mut self.slow {
                    slow.may_be_late |= self.owed.is_empty();
                }
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

    /// Lets the device with a latency send the oldest reply that it owes once its time has come.
    fn send_slow_reply(&mut self, time: u32) {
        let Some(slow) = &mut self.slow else { return };
        if self.owed.is_empty() {
            return;
        }
        slow.left -= time;
        if slow.left == 0 {
            slow.left = slow.latency;
            slow.may_be_late = false;
            self.happen(Event::Reply);
        }
    }

    /// Checks how the request has ended, and starts the next one.
    fn ended(&mut self) {
        let status = self.master.status();
        if self.master.poll() != status.poll() || self.master.is_pending() {
            self.wrong = Some(TWICE);
        }
        let answered = !status.is_failure();
        self.right = status == Status::OK && self.master.response() == [u16::from(self.number)];
        if answered {
            let own = self.right || (status != Status::OK && self.own_exception);
            if !own && !self.beyond_bound {
                if self.own_damaged {
                    self.wrong =
                        Some("a late reply was taken though the right one arrived damaged");
                } else if self.silent < self.hold || self.slow.is_some() {
                    self.wrong = Some("a late reply was taken before its hold had passed");
                }
            }
        }
        // Another reply may follow that the master does not expect.
        self.beyond_bound = answered && !self.owed.is_empty() && self.slow.is_none();
        self.hold = match status {
            _ if answered => 0,
            Status::INVALID_CRC => self.hold.max(QUIET),
            _ => TIMEOUT,
        };
        match &mut self.slow {
            Some(slow) => slow.paused = true,
            None => self.start(),
        }
    }

    /// True if the request has not lasted longer than a request may.
    pub fn ends_in_time(&self, retries: u8) -> bool {
        // Each attempt: the quiet time before it, the wait for its reply and the hold. A poll may
        // come up to 10 ticks late.
        let attempt = (TIMEOUT + QUIET) + 3 * TIMEOUT + 3 * 10;
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
