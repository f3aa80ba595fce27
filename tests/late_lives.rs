//! Random lives of programs that read several units of a serial line, whose replies are late or
//! lost. Two properties hold together, whatever limits, pauses and orders a program has:
//! - Safety: a read that succeeds has the value of its own request.
//! - Liveness: once a device answers each request within its latency, then after at most five
//!   response timeouts each read of it that is given the latency, the gap and the quiet time
//!   succeeds. It needs twice the latency if the program has cancelled a read of it sooner.
//!
//! Below are random lives of plans that divide reads.
//!
//! `MBM_LIVES` in the environment is the number of lives of each test, `MBM_SEED` the first one.

#[path = "common/divided.rs"]
mod divided;
#[path = "common/divided_life.rs"]
mod divided_life;
#[path = "common/random.rs"]
mod random;

use divided_life::Choices;
use mbm::client::{Client, Request, Serial, Settings};
use mbm::engine::{Buffers, Frame, MicrosSetting};
use mbm::error::Status;
use mbm::frame::rtu::crc16;
use mbm::master::node::Node;
use mbm::master::request::Line;
use mbm::master::Master;
use mbm::pdu::functions::FunctionSpec;
use mbm::port::Port;
use mbm::Error;
use random::Random;
use std::cell::RefCell;
use std::collections::VecDeque;
use std::fmt::Write as _;
use std::rc::Rc;

/// Times in microseconds.
const MS: u32 = 1000;
const TIMEOUT: u32 = 500 * MS;
const QUIET: u32 = 100 * MS;
const CHARACTER: u32 = 87;
/// What a read needs beside latency and quiet time: gaps, characters and the steps of the test.
const SLACK: u32 = 10 * MS;
/// No limit.
const NEVER: u32 = u32::MAX / 4;
/// The reads of a life.
const READS: u16 = 80;
/// How many units a master remembers exactly on a host, and how often in a row a device is not heard
/// if there are more that do not answer.
const EXACT: usize = 10;
const MOST_UNHEARD: u32 = 4;

/// The fate of a device's replies, counted from its first request, which is 0.
#[derive(Clone, Copy, Debug)]
enum Fault {
    None,
    /// One reply comes later than the response timeout of its request, by this part of 256 of the
    /// shortest response timeout, its characters included.
    Late(u16, u32),
    /// These replies are lost: the first, and how many.
    Lost(u16, u16),
    /// The device never answers.
    Dead,
}

/// A device that answers in order.
struct Device {
    unit: u8,
    latency: u32,
    fault: Fault,
    requests: u16,
    /// When it has sent its last reply.
    free: u32,
    /// From this moment on it answers each request within its latency.
    well: u32,
}

impl Device {
    /// A device with one of these latencies, in milliseconds, and a fault.
    fn new(unit: u8, latencies: &[u32], random: &mut Random) -> Self {
        Device {
            unit,
            latency: random.one_of(latencies) * MS,
            fault: fault(random),
            requests: 0,
            free: 0,
            well: 0,
        }
    }
}

/// The line, its devices and the clock.
#[derive(Default)]
struct World {
    now: u32,
    devices: Vec<Device>,
    incoming: VecDeque<(u32, Vec<u8>)>,
    sent: Vec<u8>,
    /// The response timeout of the request that is being made.
    timeout: u32,
    /// The shortest one of all requests.
    shortest: u32,
    is_ascii: bool,
}

/// The bytes of an ASCII frame.
fn ascii(content: &[u8]) -> Vec<u8> {
    let sum = content
        .iter()
        .fold(0u8, |sum, byte| sum.wrapping_add(*byte));
    let mut text = String::from(":");
    for byte in content.iter().chain(&[sum.wrapping_neg()]) {
        write!(text, "{byte:02X}").expect("a string");
    }
    text.push_str("\r\n");
    text.into_bytes()
}

/// The content of an ASCII frame.
fn content(frame: &[u8]) -> Vec<u8> {
    let digits = frame[1..frame.len() - 2].chunks(2);
    digits
        .map(|pair| {
            let text = core::str::from_utf8(pair).expect("digits");
            u8::from_str_radix(text, 16).expect("digits")
        })
        .collect()
}

impl World {
    /// The device that a whole request addresses answers it.
    fn answer(&mut self) {
        let mut request = core::mem::take(&mut self.sent);
        if self.is_ascii {
            request = content(&request);
            request.push(0);
        }
        assert_eq!(request.len(), 8, "only whole requests are sent");
        let now = self.now + 8 * CHARACTER;
        let found = self.devices.iter_mut().find(|d| d.unit == request[0]);
        let Some(device) = found else { return };
        let number = device.requests;
        device.requests += 1;
        let mut latency = device.latency;
        let mut is_lost = false;
        match device.fault {
            Fault::Late(at, by) if number == at => {
                latency = self.timeout + (self.shortest / 256 * by).saturating_sub(2 * MS);
            }
            Fault::Lost(first, count) if (first..first + count).contains(&number) => {
                is_lost = true;
            }
            Fault::Dead => is_lost = true,
            _ => {}
        }
        let at = now.max(device.free) + latency;
        device.free = at;
        if latency != device.latency || is_lost {
            device.well = at;
        }
        if is_lost {
            return;
        }
        let mut reply = vec![request[0], 3, 2, request[2], request[3]];
        if self.is_ascii {
            reply = ascii(&reply);
        } else {
            reply.extend(crc16(&reply).to_bytes());
        }
        let at = at + 7 * CHARACTER;
        let place = self.incoming.partition_point(|(other, _)| *other <= at);
        self.incoming.insert(place, (at, reply));
    }
}

#[derive(Clone, Default)]
struct Wire(Rc<RefCell<World>>);

impl Wire {
    fn now(&self) -> u32 {
        self.0.borrow().now
    }

    /// Sleeps as a program would: until a byte arrives, at most `delay`.
    fn sleep(&self, delay: u32) {
        let mut world = self.0.borrow_mut();
        let mut until = world.now + delay.max(100);
        if let Some((at, _)) = world.incoming.front() {
            if *at > world.now {
                until = until.min(*at);
            }
        }
        world.now = until;
    }

    fn pass(&self, time: u32) {
        self.0.borrow_mut().now += time;
    }
}

impl Port for Wire {
    fn read(&mut self, bytes: &mut [u8]) -> Result<usize, Error> {
        let mut world = self.0.borrow_mut();
        let now = world.now;
        let mut count = 0;
        while count < bytes.len() {
            match world.incoming.front_mut() {
                Some((at, reply)) if *at <= now && !reply.is_empty() => {
                    bytes[count] = reply.remove(0);
                    count += 1;
                    if reply.is_empty() {
                        world.incoming.pop_front();
                    }
                }
                _ => break,
            }
        }
        Ok(count)
    }

    fn write(&mut self, bytes: &[u8]) -> Result<usize, Error> {
        let mut world = self.0.borrow_mut();
        world.sent.extend(bytes);
        world.answer();
        Ok(bytes.len())
    }

    fn micros(&mut self) -> u32 {
        self.now()
    }
}

type Storage = Buffers<[u8; 64], [u16; 1], [u16; 0]>;

type SerialClient<'a> = Client<Serial<Wire, Frame<[u8; 64]>, Request<'a>>, Request<'a>, 4>;

/// Who reads.
enum Reader<'a> {
    /// A master whose unit changes.
    Master(Master<Wire, Storage>),
    /// Nodes on a line. Two of them may have the same unit.
    Nodes(Line<Wire, Storage>, Vec<Node>),
    Client(Box<SerialClient<'a>>),
}

fn set(settings: &mut Settings) {
    settings.response_timeout = MicrosSetting::new(TIMEOUT);
    settings.quiet_time = MicrosSetting::new(QUIET);
}

fn buffers() -> Storage {
    Buffers::new([0; 64], [0], [])
}

impl Reader<'_> {
    fn of(kind: u32, wire: &Wire, units: &[u8]) -> Self {
        match kind {
            0 => {
                let mut master = Master::new(1, wire.clone(), buffers());
                master.settings().set_baud_rate(115_200);
                set(master.settings());
                Reader::Master(master)
            }
            1 => {
                let mut line = Line::new(wire.clone(), buffers());
                line.settings.set_baud_rate(115_200);
                set(&mut line.settings);
                Reader::Nodes(line, units.iter().map(|unit| Node::new(*unit)).collect())
            }
            _ => {
                wire.0.borrow_mut().is_ascii = kind == 3;
                let (end, frame) = (wire.clone(), Frame::new([0; 64]));
                let mut client = match kind {
                    3 => Client::new(Serial::ascii(end, frame)),
                    4 => Client::over_tcp(end, frame),
                    _ => Client::new(Serial::new(end, frame)),
                };
                if kind == 2 {
                    client.settings().set_baud_rate(115_200);
                }
                set(client.settings());
                Reader::Client(Box::new(client))
            }
        }
    }

    /// Reads a register of the unit at `index`, until `limit` has passed: then it cancels the
    /// request.
    fn read(
        &mut self,
        wire: &Wire,
        index: usize,
        unit: u8,
        address: u16,
        limit: u32,
    ) -> HandlerResult {
        let timeout = wire.0.borrow().timeout;
        let end = wire.now().saturating_add(limit);
        let left = |wire: &Wire| end.saturating_sub(wire.now());
        match self {
            Reader::Master(master) => {
                master.set_unit(unit);
                master.settings().response_timeout = MicrosSetting::new(timeout);
                master.start_read_holding_registers(address, 1).unwrap();
                loop {
                    if let std::task::Poll::Ready(result) = master.poll() {
                        let word = master.response().first().copied().unwrap_or_default();
                        return result.map(|()| word).map_err(|error| Some(error.code()));
                    }
                    if left(wire) == 0 {
                        master.cancel();
                        return Err(None);
                    }
                    wire.sleep(master.poll_delay().min(left(wire)));
                }
            }
            Reader::Nodes(line, nodes) => {
                let node = &mut nodes[index];
                assert_eq!(line.ready(), Status::OK);
                line.settings.response_timeout = MicrosSetting::new(timeout);
                let function = FunctionSpec::READ_HOLDING_REGISTERS.short();
                let started = node.request(line, address, 1, function);
                assert_eq!(started, Status::PENDING);
                loop {
                    let status = line.poll(wire.now());
                    if status != Status::PENDING {
                        let _ = node.take(status, line);
                        return match status {
                            Status::OK => {
                                Ok(node.receive(mbm::engine::Words::response(&line.storage)))
                            }
                            status => Err(Some(status.code())),
                        };
                    }
                    if left(wire) == 0 {
                        line.cancel();
                        node.end(Status::CANCELLED);
                        return Err(None);
                    }
                    wire.sleep(line.poll_delay(wire.now()).min(left(wire)));
                }
            }
            Reader::Client(client) => {
                let words: &mut [u16] = Box::leak(Box::new([0u16]));
                let mut request = Request::read_holding_registers(unit, address, words).unwrap();
                request.state.timeout_ms = timeout / MS;
                client.queue(request).unwrap();
                loop {
                    if let Some(request) = client.poll(wire.now()) {
                        assert!(client.poll(wire.now()).is_none());
                        return match request.result() {
                            Ok(()) => Ok(request.registers()[0]),
                            Err(error) => Err(Some(error.code())),
                        };
                    }
                    if left(wire) == 0 {
                        assert!(client.cancel(|_| true).is_some());
                        return Err(None);
                    }
                    let delay = client.poll_delay(wire.now());
                    wire.sleep(delay.min(left(wire)));
                }
            }
        }
    }
}

/// The value, or the status; none after a limit.
type HandlerResult = Result<u16, Option<u8>>;

/// What a program does.
#[derive(Debug)]
struct Program {
    kind: u32,
    units: Vec<u8>,
    limits: Vec<u32>,
    /// The response timeouts of its requests.
    timeouts: Vec<u32>,
    pauses: Vec<u32>,
    is_in_turn: bool,
}

fn fault(random: &mut Random) -> Fault {
    let kind = random.below(5);
    let first = random.below(5) as u16;
    match kind {
        0 => Fault::None,
        1 => Fault::Late(first, 1 + random.below(255)),
        2 => Fault::Lost(first, 1),
        3 => Fault::Lost(first, 1 + random.below(12) as u16),
        _ => Fault::Dead,
    }
}

/// Lives one life; says what was wrong.
fn live(seed: u64) -> Result<(), String> {
    let mut random = Random::new(seed);
    let wire = Wire::default();
    wire.pass(1_000_000);
    let sets: [&[u8]; 8] = [
        &[1],
        &[1, 33],
        &[1, 33, 65, 97],
        &[7, 7],
        &[5, 6, 38],
        &[9, 9, 41],
        // More units than the master has records for.
        &[1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 33, 65],
        &[1, 33, 65, 97, 129, 161, 193, 225, 2, 34, 66, 98, 130],
    ];
    let units = random.one_of(&sets).to_vec();
    for unit in &units {
        let mut world = wire.0.borrow_mut();
        if world.devices.iter().all(|device| device.unit != *unit) {
            let device = Device::new(*unit, &[3, 50, 105, 150, 300, 450, 490], &mut random);
            world.devices.push(device);
        }
    }
    let limits = [20, 50, 100, 150, 300, 450, 600, 1200, 3000].map(|limit| limit * MS);
    let pauses = [0, 1, 10, 30, 100, 200, 500, 700, 5000].map(|pause| pause * MS);
    let slowest = wire
        .0
        .borrow()
        .devices
        .iter()
        .map(|device| device.latency)
        .max();
    let mut timeouts = vec![TIMEOUT];
    if random.below(3) == 0 {
        // Requests with timeouts of their own, which are longer than the latencies.
        timeouts = [20, 60, 120, 200, 1000, 2000]
            .map(|time| time * MS)
            .to_vec();
        timeouts.retain(|time| Some(*time) > slowest.map(|time| time + SLACK));
    }
    wire.0.borrow_mut().shortest = *timeouts.iter().min().unwrap_or(&TIMEOUT);
    let program = Program {
        kind: random.below(5),
        units,
        limits: (0..random.one_of(&[1, 1, 2, 3]))
            .map(|_| match random.below(3) {
                0 => NEVER,
                _ => random.one_of(&limits),
            })
            .collect(),
        timeouts,
        pauses: (0..random.one_of(&[1, 4]))
            .map(|_| random.one_of(&pauses))
            .collect(),
        is_in_turn: random.below(2) == 0,
    };
    let mut reader = Reader::of(program.kind, &wire, &program.units);
    // How often in a row a device was not heard, if there are more than the master remembers exactly.
    let mut unheard = vec![0; program.units.len()];
    let is_exact = program.units.len() <= EXACT;
    let reads = if is_exact { READS } else { 3 * READS };
    for number in 0..reads {
        let index = match program.is_in_turn {
            true => usize::from(number) % program.units.len(),
            false => random.below(program.units.len() as u32) as usize,
        };
        let unit = program.units[index];
        let limit = random.one_of(&program.limits);
        let timeout = random.one_of(&program.timeouts);
        wire.0.borrow_mut().timeout = timeout;
        let began = wire.now();
        let outcome = reader.read(&wire, index, unit, number, limit);
        let world = wire.0.borrow();
        let device = world
            .devices
            .iter()
            .find(|device| device.unit == unit)
            .unwrap();
        let what = || {
            let faults: Vec<_> = world
                .devices
                .iter()
                .map(|d| (d.unit, d.latency, d.fault))
                .collect();
            format!("MBM_SEED={seed}: read {number} of unit {unit} at {began}: {outcome:?}; {program:?} {faults:?}")
        };
        if outcome.is_ok_and(|value| value != number) {
            return Err(format!("wrong: {}", what()));
        }
        // A request with a shorter limit may still keep the device from this one.
        let needs = device.latency + QUIET + SLACK;
        let times = || program.limits.iter().chain(&program.timeouts);
        let is_short = times().any(|time| *time < needs);
        let longest = *program.timeouts.iter().max().unwrap_or(&TIMEOUT);
        let is_given = timeout
            >= device.latency + SLACK + if is_short { device.latency } else { 0 }
            && limit >= needs + if is_short { device.latency } else { 0 };
        // Where a limit leaves little more than the latency, the reply to a cancelled read delays
        // several later ones, each by less.
        let timeouts = if limit < needs + QUIET { 8 } else { 5 };
        let is_well = device.well.saturating_add(timeouts * longest) <= began;
        if outcome.is_ok() {
            unheard[index] = 0;
        } else if is_well && is_given {
            unheard[index] += 1;
        }
        if unheard[index] > if is_exact { 0 } else { MOST_UNHEARD } {
            return Err(format!("not heard: {}", what()));
        }
        drop(world);
        wire.pass(random.one_of(&program.pauses));
    }
    Ok(())
}

/// Lives one life of a client with several requests in its queue, some of which are cancelled after a
/// limit; says what was wrong.
fn live_queued(seed: u64) -> Result<(), String> {
    let mut random = Random::new(seed);
    let wire = Wire::default();
    wire.pass(1_000_000);
    let units: &[u8] = random.one_of(&[&[1, 33], &[1, 33, 65, 97], &[1, 2, 3, 4, 5, 34, 66, 98]]);
    for unit in units {
        let device = Device::new(*unit, &[3, 50, 105, 150, 230], &mut random);
        wire.0.borrow_mut().devices.push(device);
    }
    {
        let mut world = wire.0.borrow_mut();
        (world.timeout, world.shortest) = (TIMEOUT, TIMEOUT);
        world.is_ascii = random.below(4) == 0;
    }
    let is_ascii = wire.0.borrow().is_ascii;
    let (end, frame) = (wire.clone(), Frame::new([0; 64]));
    let mut client: Client<Serial<Wire, Frame<[u8; 64]>, Request<'_>>, Request<'_>, 8> =
        match is_ascii {
            true => Client::new(Serial::ascii(end, frame)),
            false => Client::new(Serial::new(end, frame)),
        };
    client.settings().set_baud_rate(115_200);
    set(client.settings());
    let limits = [20, 50, 100, 300, 600, 1200].map(|limit| limit * MS);
    let may_cancel = random.below(4) > 0;
    // The address and limit of each request in the queue.
    let mut queued: Vec<(u16, u8, u32, u32)> = Vec::new();
    let mut number = 0;
    while number < READS || !queued.is_empty() {
        if number < READS && queued.len() < 8 && (queued.is_empty() || random.below(3) == 0) {
            let unit = units[random.below(units.len() as u32) as usize];
            let limit = match may_cancel && random.below(3) == 0 {
                true => random.one_of(&limits),
                false => NEVER,
            };
            let words: &mut [u16] = Box::leak(Box::new([0u16]));
            let mut request = Request::read_holding_registers(unit, number, words).unwrap();
            request.state.transaction = number + 1;
            client.queue(request).unwrap();
            queued.push((number, unit, wire.now(), limit));
            number += 1;
        }
        let ended = match client.poll(wire.now()) {
            Some(request) => Some((request.state.transaction - 1, Some(request))),
            None => {
                let now = wire.now();
                let over = queued
                    .iter()
                    .find(|(_, _, since, limit)| now - since >= *limit);
                over.map(|(address, ..)| (*address, None))
            }
        };
        let Some((address, request)) = ended else {
            let now = wire.now();
            let left = queued
                .iter()
                .map(|(_, _, since, limit)| limit - (now - since))
                .min();
            let delay = client.poll_delay(now).min(left.unwrap_or(NEVER));
            wire.sleep(delay.min(10 * MS));
            continue;
        };
        let place = queued.iter().position(|(queued, ..)| *queued == address);
        let (_, unit, began, limit) = queued.remove(place.expect("a queued request"));
        let Some(request) = request else {
            let cancelled = client.cancel(|request| request.state.transaction == address + 1);
            assert!(cancelled.is_some());
            continue;
        };
        let result = request.result();
        let world = wire.0.borrow();
        let device = world.devices.iter().find(|d| d.unit == unit).unwrap();
        let is_well = device.well.saturating_add(5 * TIMEOUT) <= began;
        let fault = match result {
            Ok(()) if request.registers()[0] != address => "wrong",
            Err(_) if is_well => "not heard",
            _ => continue,
        };
        return Err(format!(
            "{fault}: MBM_SEED={seed}: read {address} of unit {unit} at {began} with limit {limit}, ASCII {is_ascii}"
        ));
    }
    Ok(())
}

/// Lives as many lives as the environment says, from its first one on.
fn lives(live: fn(u64) -> Result<(), String>) {
    let mut found = [0; 2];
    for seed in random::seeds(4000) {
        if let Err(text) = live(seed) {
            println!("{text}");
            found[usize::from(text.starts_with("wrong"))] += 1;
        }
    }
    assert_eq!(found, [0, 0], "not heard, wrong");
}

#[test]
fn no_reading_is_wrong_and_a_device_that_answers_is_heard_again() {
    lives(live);
}

#[test]
fn no_queued_reading_is_wrong_and_a_device_that_answers_is_heard_again() {
    lives(live_queued);
}

// --- plans that divide the reads that a device refuses: `common/divided_life.rs` says what
// happens, and which properties hold ---

/// Random choices, up to a number of them.
struct Chosen {
    random: Random,
    left: u32,
}

impl Choices for Chosen {
    fn below(&mut self, limit: u32) -> u32 {
        self.left = self.left.saturating_sub(1);
        self.random.below(limit)
    }

    fn is_over(&self) -> bool {
        self.left == 0
    }
}

/// Says which life was wrong.
struct Seed(u64);

impl Drop for Seed {
    fn drop(&mut self) {
        if std::thread::panicking() {
            println!("MBM_SEED={}", self.0);
        }
    }
}

#[test]
fn no_value_is_of_another_register_and_every_field_that_is_there_is_read() {
    for seed in random::seeds(if cfg!(miri) { 1 } else { 80 }) {
        let seed = Seed(seed);
        let mut random = Random::new(seed.0);
        let left = 100 + random.below(900);
        divided_life::live(&mut Chosen { random, left });
    }
}
