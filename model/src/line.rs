//! A master, devices that answer in order, and an adversary between them.

use crate::wire::{self, Lent, Wire};
use mbm::engine::MicrosSetting;
use mbm::error::Status;
use mbm::frame::Framing;
use mbm::master::request::Line;
use mbm::master::Master;
use std::hash::{DefaultHasher, Hash, Hasher};

/// The units of the devices. They are equal modulo 32.
const UNITS: [u8; 3] = [17, 49, 81];
const UNIT: u8 = UNITS[0];

/// Times in ticks of the model's clock. Only their order and their sums matter.
const SILENCE: u32 = 1;
pub const QUIET: u32 = 4;
pub const TIMEOUT: u32 = 10;

/// How many replies of a device with a latency may be late.
const LATE_REPLIES: u8 = 2;

/// How long a unit is silent after its last request until it is taken to owe no reply, in ticks.
const CLEAN: u32 = 2 * TIMEOUT + QUIET;

/// How long after a fault a device with a latency has to be heard again, in ticks. Where a limit
/// leaves little more than the latency, the reply to a cancelled request delays several later
/// ones, each by less.
const HEARD_AGAIN: u32 = 5 * TIMEOUT;
const HEARD_AGAIN_LATE: u32 = 8 * TIMEOUT;
/// How long a program with a limit is watched after the last fault, in ticks.
const LONG_WELL: u32 = HEARD_AGAIN_LATE + 10 * TIMEOUT;

/// With a program with a limit, the second request has the first fault, and one of those up to this
/// one the second.
const LAST_FAULT: u8 = 6;

/// What a request needs beside the latency and the quiet time, in ticks: the gap, and a tick for
/// each step of the master.
const SLACK: u32 = SILENCE + 3;

/// The longest time in ticks that affects the master. Longer times are cut to it.
const LONGEST: u32 = 100;

/// The fault of a request that continues after its end.
pub const TWICE: &str = "a request ended twice";
/// The fault of a rule that keeps the master from receiving a device's replies.
pub const NOT_HEARD: &str = "a device that answers is not heard";

/// A fault that is planted to see that the model finds it.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub enum Plant {
    None,
    /// An answer of one unit makes the master forget what the other units owe, as if they shared
    /// the memory.
    Shared,
    /// After a cancelled request the next reply is held, as after a timeout.
    HeldAfterCancel,
}

/// What the adversary may do next.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Event {
    /// The device with this index sends the oldest reply that it owes, and it arrives.
    Reply(u8),
    /// The device sends an exception instead of the oldest reply that it owes.
    Exception,
    /// The oldest owed reply arrives with one bit of its CRC changed.
    Damaged,
    /// Only the first half of the oldest owed reply arrives.
    FirstHalf,
    /// Only the second half of the oldest owed reply arrives.
    SecondHalf,
    /// The oldest reply that the device with this index owes is lost.
    Lost(u8),
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
    /// The user starts the next request, to the device with this index.
    Start(u8),
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
    /// What the program does, if it starts and cancels requests by the clock.
    program: Option<Program>,
    /// How many requests it has received; at most `LAST_FAULT`.
    received: u8,
    /// For how many ticks the device has answered within its latency, up to `LONG_WELL`.
    well: u32,
    /// `well` when the request was started.
    was_well: u32,
    /// For how many ticks the program has paused.
    paused_for: u32,
}

/// A program with a limit.
#[derive(Clone, Copy, Hash, Debug)]
pub struct Program {
    /// The program cancels each request after this many ticks.
    pub limit: u32,
    /// How many ticks lie between the end of a request and the start of the next.
    pub pause: u32,
}

impl Slow {
    /// The oldest reply that the device owes is late or lost.
    fn fail(&mut self) {
        self.late -= 1;
        self.may_be_late = false;
        self.well = 0;
        self.was_well = 0;
    }

    /// True if the request that has just ended had to succeed.
    fn had_to_answer(&self) -> bool {
        let needs = self.latency + QUIET + SLACK;
        match self.program {
            // A request with a shorter limit may keep the device from the next one.
            Some(program) if program.limit < needs => false,
            Some(program) if program.limit < needs + QUIET => self.was_well >= HEARD_AGAIN_LATE,
            _ => self.was_well >= HEARD_AGAIN,
        }
    }
}

/// What is known of a device.
#[derive(Clone, Hash, Debug)]
struct Device {
    /// The numbers of the requests that it has not answered, in order.
    owed: Vec<u8>,
    /// Ticks since its last request was sent; at most `CLEAN`.
    since: u32,
    /// How long the line must be silent before a reply after a failure is accepted, in ticks.
    hold: u32,
    /// It owes a reply that no master can distinguish from the right one: it was silent for
    /// longer than promised, or its reply came, or was lost, after a late one had been held
    /// long enough.
    beyond_bound: bool,
}

/// Everything that determines later events, and everything that the properties check.
#[derive(Clone, Debug)]
pub struct State {
    master: Master<Wire, Lent>,
    devices: Vec<Device>,
    /// The index of the device that the last request was for.
    current: usize,
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
    /// The user decides when the next request begins, and to which device.
    pauses: bool,
    /// No request is active, and the user has not started the next one.
    paused: bool,
    /// The previous request got its own reply.
    right: bool,
    /// The device, if it is one with a latency. Otherwise the adversary sends its replies.
    slow: Option<Slow>,
    plant: Plant,
    /// The fault that was found, if any.
    pub wrong: Option<&'static str>,
}

impl Hash for State {
    fn hash<H: Hasher>(&self, hasher: &mut H) {
        self.master.hash(hasher);
        (&self.devices, self.current).hash(hasher);
        (self.number, self.lasts, self.silent).hash(hasher);
        (self.own_damaged, self.own_exception, self.paused).hash(hasher);
        self.slow.hash(hasher);
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
    crate::frame::framed(Framing::Rtu, 0, unit, pdu)
}

fn reply(unit: u8, number: u8) -> Vec<u8> {
    frame(unit, &[3, 2, 0, number])
}

impl State {
    /// A master that has just started its first request.
    pub fn new(buffer: usize, retries: u8, quiet_time: u32) -> Self {
        State::of(buffer, retries, quiet_time, 1)
    }

    fn of(buffer: usize, retries: u8, quiet_time: u32, devices: usize) -> Self {
        let mut master = Master::new(UNIT, Wire::default(), wire::lent(buffer));
        let settings = master.settings();
        settings.gap = MicrosSetting::new(SILENCE);
        settings.silence = MicrosSetting::new(SILENCE);
        settings.response_timeout = MicrosSetting::new(TIMEOUT);
        settings.quiet_time = MicrosSetting::new(quiet_time);
        settings.retries = retries;
        let device = Device {
            owed: Vec::new(),
            since: CLEAN,
            hold: 0,
            beyond_bound: false,
        };
        let mut state = State {
            master,
            devices: vec![device; devices],
            current: 0,
            number: 0,
            lasts: 0,
            silent: TIMEOUT,
            own_damaged: false,
            own_exception: false,
            pauses: false,
            paused: false,
            right: false,
            slow: None,
            plant: Plant::None,
            wrong: None,
        };
        state.start();
        state
    }

    /// As [`State::new`], with a device that takes `latency` ticks for a reply. Without a program
    /// the user starts requests at any time.
    pub fn with_latency(
        buffer: usize,
        retries: u8,
        latency: u32,
        program: Option<Program>,
        plant: Plant,
    ) -> Self {
        let mut state = State::new(buffer, retries, QUIET);
        state.pauses = true;
        state.plant = plant;
        state.slow = Some(Slow {
            latency,
            left: latency,
            late: LATE_REPLIES,
            may_be_late: false,
            program,
            received: 0,
            well: 0,
            was_well: 0,
            paused_for: 0,
        });
        state
    }

    /// As [`State::new`], with several devices, whose units are equal modulo 32.
    pub fn with_devices(buffer: usize, retries: u8, devices: usize, plant: Plant) -> Self {
        let mut state = State::of(buffer, retries, QUIET, devices);
        state.pauses = true;
        state.plant = plant;
        state
    }

    /// The events that are possible, with or without noise.
    pub fn events(&self, noise: bool, events: &mut Vec<Event>) {
        if self.wrong.is_some() {
            return;
        }
        if let Some(slow) = &self.slow {
            if slow.program.is_some() && slow.well == LONG_WELL {
                return;
            }
            events.push(Event::Step(1));
            if self.paused && slow.program.is_none() {
                events.push(Event::Start(0));
            }
            if slow.late > 0 && slow.may_be_late {
                // The promise does not cover a reply that is later by more than a response timeout.
                events.extend([1, 5, 9].map(Event::Late));
                events.push(Event::Lost(0));
            }
            return;
        }
        events.extend([Event::Step(1), Event::Step(4), Event::Step(10)]);
        for (index, device) in (0..).zip(&self.devices) {
            if self.paused {
                events.push(Event::Start(index));
            }
            if !device.owed.is_empty() {
                events.extend([Event::Reply(index), Event::Lost(index)]);
            }
        }
        let owes = !self.devices[0].owed.is_empty();
        if self.devices.len() > 1 {
            if !self.paused {
                events.push(Event::Cancel);
            }
            return;
        }
        if owes {
            events.extend([Event::Damaged, Event::FirstHalf]);
        }
        if noise {
            events.extend([
                Event::Zero,
                Event::LooksLikeReply,
                Event::Foreign,
                Event::Cancel,
            ]);
            if owes {
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
        let mut index = 0;
        match event {
            Event::Step(time) => return self.step(time.into()),
            Event::Cancel => return self.cancel(),
            Event::Start(device) => {
                self.current = device.into();
                return self.start();
            }
            Event::Late(time) => {
                if let Some(slow) = &mut self.slow {
                    slow.left += TIMEOUT - slow.latency + u32::from(time);
                    slow.fail();
                }
                return;
            }
            Event::Zero => return self.arrive(&[0]),
            Event::LooksLikeReply => return self.arrive(&[UNIT, 3]),
            Event::Foreign => return self.arrive(&reply(UNIT + 1, 0x55)),
            Event::Reply(device) | Event::Lost(device) => index = device.into(),
            _ => {}
        }
        let number = self.devices[index].owed.remove(0);
        let own = number == self.number;
        let mut bytes = reply(UNITS[index], number);
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
            Event::Lost(_) => {
                bytes.clear();
                if let Some(slow) = &mut self.slow {
                    slow.left = slow.latency;
                    slow.fail();
                }
            }
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
        self.paused = false;
        if let Some(slow) = &mut self.slow {
            slow.was_well = slow.well;
            slow.paused_for = 0;
        }
        self.lasts = 0;
        self.own_damaged = false;
        self.own_exception = false;
        self.master.set_unit(UNITS[self.current]);
        if self.master.start_read_holding_registers(0, 1).is_err() {
            self.wrong = Some("a request was refused");
        }
    }

    /// Cancels the request as a user does.
    fn cancel(&mut self) {
        self.master.cancel();
        if self.plant == Plant::HeldAfterCancel {
            self.master.line().late_units.forget_cancelled();
        }
        self.ended();
    }

    /// Moves the clock on, and polls until the master waits.
    fn step(&mut self, time: u32) {
        self.master.port().now = time;
        self.silent = (self.silent + time).min(TIMEOUT);
        for device in &mut self.devices {
            device.since = (device.since + time).min(CLEAN);
        }
        self.send_slow_reply(time);
        if !self.paused {
            self.lasts += time;
            self.poll();
            let program = self.slow.as_ref().and_then(|slow| slow.program);
            if !self.paused && program.is_some_and(|program| self.lasts >= program.limit) {
                self.cancel();
            }
        }
        self.go_on(time);
        self.master.rebase(time, LONGEST);
        // Nothing depends on the counters.
        self.master.storage().counters.fill(0);
        self.master.port().now = 0;
    }

    /// The program starts its next request after its pause.
    fn go_on(&mut self, time: u32) {
        let Some(slow) = &mut self.slow else { return };
        let Some(program) = slow.program.filter(|_| self.paused) else {
            return;
        };
        if slow.paused_for >= program.pause {
            return self.start();
        }
        slow.paused_for += time;
    }

    fn poll(&mut self) {
        for _ in 0..16 {
            let _ = self.master.poll();
            if !std::mem::take(&mut self.master.port().sent).is_empty() {
                self.sent();
            }
            if !self.master.is_pending() {
                return self.ended();
            }
            if self.master.is_waiting() {
                return;
            }
        }
    }

    /// The request was sent.
    fn sent(&mut self) {
        let device = &mut self.devices[self.current];
        if let Some(slow) = &mut self.slow {
            slow.received = (slow.received + 1).min(LAST_FAULT);
            let is_due = match slow.late {
                LATE_REPLIES => slow.received == 2,
                _ => slow.received < LAST_FAULT,
            };
            slow.may_be_late |= device.owed.is_empty() && (is_due || slow.program.is_none());
            if slow.program.is_none() {
                slow.received = 0;
            }
        }
        // The promise ends here: a reply that is still to come then is taken for the right one.
        device.beyond_bound |= device.since == CLEAN && !device.owed.is_empty();
        device.since = 0;
        device.owed.push(self.number);
    }

    /// Lets the device with a latency send the oldest reply that it owes once its time has come.
    fn send_slow_reply(&mut self, time: u32) {
        let Some(slow) = &mut self.slow else { return };
        if self.devices[0].owed.is_empty() || slow.left <= slow.latency {
            slow.well = (slow.well + time).min(LONG_WELL);
        }
        if self.devices[0].owed.is_empty() {
            return;
        }
        slow.left -= time;
        if slow.left == 0 {
            slow.left = slow.latency;
            slow.may_be_late = false;
            self.happen(Event::Reply(0));
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
        let device = &mut self.devices[self.current];
        if answered {
            let own = self.right || (status != Status::OK && self.own_exception);
            if !own && !device.beyond_bound {
                if self.own_damaged {
                    self.wrong =
                        Some("a late reply was taken though the right one arrived damaged");
                } else if self.silent < device.hold || self.slow.is_some() || device.hold == 0 {
                    self.wrong = Some("a late reply was taken before its hold had passed");
                }
            }
        }
        // Another reply may follow that the master does not expect.
        device.beyond_bound |= answered;
        device.beyond_bound &= !device.owed.is_empty() && self.slow.is_none();
        device.hold = match status {
            _ if answered => 0,
            Status::INVALID_CRC => device.hold.max(QUIET),
            _ => TIMEOUT,
        };
        if answered && self.plant == Plant::Shared {
            let line = self.master.line();
            line.late_units = Line::new(Wire::default(), wire::lent(0)).late_units;
        }
        if let Some(slow) = &self.slow {
            if slow.had_to_answer() && !self.right && self.wrong.is_none() {
                self.wrong = Some(NOT_HEARD);
            }
        }
        match self.pauses {
            true => self.paused = true,
            false => self.start(),
        }
    }

    /// True if the request has not lasted longer than a request may.
    pub fn ends_in_time(&self, retries: u8) -> bool {
        // Each attempt: the quiet time before it, the wait for its reply and the hold. A poll may
        // come up to 10 ticks late.
        let attempt = (TIMEOUT + QUIET) + 3 * TIMEOUT + 3 * 10;
        // Before the first one: the rest of its unit.
        self.lasts <= attempt * (u32::from(retries) + 1) + CLEAN + 10
    }

    /// True if the next request to each device gets its own reply in time, provided that no earlier
    /// reply comes and that the devices answer at once.
    pub fn recovers(&self) -> bool {
        (0..self.devices.len()).all(|index| self.hears(index))
    }

    fn hears(&self, index: usize) -> bool {
        let mut state = self.clone();
        state.lose();
        if state.paused {
            state.current = index;
            state.start();
        } else {
            // The active request gets no reply.
            let first = state.number;
            while state.number == first && !state.paused {
                state.lose();
                state.step(1);
                if state.lasts > 400 {
                    return false;
                }
            }
            if state.paused {
                state.current = index;
                state.start();
            }
        }
        let number = state.number;
        for _ in 0..CLEAN + TIMEOUT + 2 * QUIET {
            if state.devices[index].owed.is_empty() {
                state.step(1);
            } else {
                state.happen(Event::Reply(index as u8));
                state.step(1);
            }
            if state.paused || state.number != number {
                return state.right;
            }
        }
        false
    }

    fn lose(&mut self) {
        for device in &mut self.devices {
            device.owed.clear();
        }
    }
}
