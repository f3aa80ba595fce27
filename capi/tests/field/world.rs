//! Plays a case: the program, the devices, and what is expected.

use crate::case::{Call, Case, Request, Role, Step, Token, Want};
use crate::device::{self, Device};
use crate::frame;
use crate::listeners::{Event, Server, Sniffer, REGISTERS};
use crate::masters::{ClientMaster, GatewayMaster, Master, Nodes};
use crate::wire::{Block, Shared, Wire};
use mbm_c::*;
use std::cell::RefCell;
use std::collections::VecDeque;
use std::rc::Rc;

/// The longest time from one poll to the next, in microseconds.
const LONGEST: u64 = 1_000_000;
/// The time that a poll takes, at least.
const SHORTEST: u64 = 50;
/// A request must have ended by then.
const NEVER: u64 = 60_000_000;
/// The time in which a response or an event that is expected must come.
const SOON: u64 = 3_000_000;
/// The pause before a frame of a scripted peer.
const GAP: u64 = 5_000;

type PlayResult = Result<(), (usize, String)>;

/// A response that a device will send.
struct Due {
    at: u64,
    pause: u64,
    bytes: Vec<u8>,
    closes: bool,
    connection: usize,
}

pub struct World<'a> {
    case: &'a Case,
    role: Role,
    wire: Shared,
    /// The tested object's end of the line.
    end: usize,
    block: Block,
    master: Option<Box<dyn Master>>,
    servers: Vec<Server>,
    server_polled: Vec<u64>,
    sniffer: Option<Sniffer>,
    events: VecDeque<Event>,
    devices: Vec<Device>,
    due: Vec<Due>,
    answers: VecDeque<Vec<Token>>,
    /// The frames that the tested object has sent, and those of them that a step looked at.
    sent: Vec<Vec<u8>>,
    sent_seen: usize,
    replies_seen: usize,
    opened: usize,
    opened_seen: usize,
    transaction: u16,
}

impl<'a> World<'a> {
    pub fn new(case: &'a Case, role: Role, block: Block) -> Result<World<'a>, String> {
        let wire: Shared = Rc::new(RefCell::new(Wire::default()));
        let end = {
            let mut wire = wire.borrow_mut();
            wire.character = match case.framing.is_stream() {
                true => 0,
                false => 11_000_000 / u64::from(case.baud.max(1)),
            };
            wire.connect(0, block)
        };
        let mut world = World {
            case,
            role,
            end,
            block,
            master: None,
            servers: Vec::new(),
            server_polled: Vec::new(),
            sniffer: None,
            events: VecDeque::new(),
            devices: Vec::new(),
            due: Vec::new(),
            answers: VecDeque::new(),
            sent: Vec::new(),
            sent_seen: 0,
            replies_seen: 0,
            opened: 0,
            opened_seen: 0,
            transaction: 0,
            wire,
        };
        match role {
            Role::Node => world.master = Some(Box::new(Nodes::new(case, &world.wire, end)?)),
            Role::Client => {
                world.master = Some(Box::new(ClientMaster::new(case, &world.wire, end)?));
            }
            Role::Gateway => {
                world.master = Some(Box::new(GatewayMaster::new(case, &world.wire, end)?));
            }
            Role::Server => world.add_server(end, 0)?,
            Role::Sniffer => world.sniffer = Some(Sniffer::new(case, &world.wire, end)?),
        }
        Ok(world)
    }

    fn add_server(&mut self, end: usize, slow: u64) -> Result<(), String> {
        let server = Server::new(self.case, &self.wire, end, slow)?;
        self.servers.push(server);
        self.server_polled.push(0);
        Ok(())
    }

    fn now(&self) -> u64 {
        self.wire.borrow().now
    }

    /// Lets time pass until something happens, but not beyond `end`, and then polls once.
    fn step(&mut self, end: u64) {
        let now = self.now();
        let mut delay = LONGEST;
        if let Some(master) = &mut self.master {
            delay = delay.min(master.delay().into());
        }
        for (server, polled) in self.servers.iter_mut().zip(&self.server_polled) {
            delay = delay.min(match server.slow {
                0 => server.delay().into(),
                slow => (polled + slow).saturating_sub(now),
            });
        }
        if self.sniffer.is_some() {
            delay = delay.min(1_000);
        }
        let mut next = (now + delay.max(SHORTEST)).min(end.max(now + 1));
        let closes = self.devices.iter().filter_map(Device::closes_at);
        let due = self.due.iter().map(|due| due.at).chain(closes);
        for at in due.chain(self.wire.borrow().next()) {
            next = next.min(at.max(now + 1));
        }
        self.wire.borrow_mut().advance(next);
        self.play_devices();
        self.poll();
    }

    fn poll(&mut self) {
        let now = self.now();
        if let Some(master) = &mut self.master {
            master.poll();
            let opened = master.opened();
            if opened != self.opened {
                self.opened = opened;
                self.due.clear();
                self.devices.iter_mut().for_each(|device| device.open(now));
            }
        }
        for (server, polled) in self.servers.iter_mut().zip(&mut self.server_polled) {
            if now >= *polled + server.slow {
                *polled = now;
                server.poll();
            }
        }
        if let Some(sniffer) = &mut self.sniffer {
            self.events.extend(sniffer.poll());
        }
    }

    /// The devices receive requests and send their replies.
    fn play_devices(&mut self) {
        let now = self.now();
        loop {
            let sent = self.wire.borrow_mut().sent.pop_front();
            let Some(sent) = sent else { break };
            if sent.medium == 0 {
                if sent.end == self.end {
                    self.sent.push(sent.bytes.clone());
                }
                if self.master.is_some() {
                    self.receive(&sent.bytes, sent.at);
                }
            }
        }
        self.due.sort_by_key(|due| due.at);
        while self.due.first().is_some_and(|due| due.at <= now) {
            let due = self.due.remove(0);
            if due.connection != self.opened {
                continue;
            }
            let mut wire = self.wire.borrow_mut();
            let at = due.at.max(wire.free(0) + due.pause);
            wire.deliver(0, at, &due.bytes);
            if due.closes {
                wire.advance(now);
                wire.close(self.end);
            }
        }
        if self.opened > 0 && self.case.framing.is_stream() {
            for device in &mut self.devices {
                if device.hangs_up(now) {
                    self.wire.borrow_mut().close(self.end);
                }
            }
        }
    }

    /// A request, or several in one segment of a stream, has arrived at the devices.
    fn receive(&mut self, bytes: &[u8], at: u64) {
        let framing = self.case.framing;
        let mut rest = bytes;
        let mut is_joined = false;
        let silence = self.wire.borrow().silence(bytes.len(), at);
        while let Some((length, transaction, body)) = frame::open(framing, rest) {
            rest = &rest[length..];
            let connection = self.opened;
            let found = self.devices.iter_mut().filter(|device| device.has(body[0]));
            let mut is_found = false;
            for device in found {
                is_found = true;
                let replies = device.receive(framing, transaction, &body, at, silence, is_joined);
                self.due.extend(replies.into_iter().map(|reply| Due {
                    at: reply.at,
                    pause: reply.pause,
                    bytes: reply.bytes,
                    closes: reply.closes,
                    connection,
                }));
            }
            if !is_found {
                if let Some(answer) = self.answers.pop_front() {
                    let mut from = at;
                    for (pause, bytes) in frame::pieces(framing, transaction, &answer) {
                        from += pause;
                        self.due.push(Due {
                            at: from,
                            pause,
                            bytes,
                            closes: false,
                            connection,
                        });
                    }
                }
            }
            is_joined = true;
        }
    }

    fn pass(&mut self, time: u64) {
        let end = self.now() + time;
        while self.now() < end {
            self.step(end);
        }
    }

    fn master(&mut self) -> &mut dyn Master {
        &mut **self.master.as_mut().expect("the role sends requests")
    }

    fn try_start(&mut self, call: &Call, request: &Request) -> Result<Option<usize>, u8> {
        match self.master().start(request) {
            Ok(number) => Ok(Some(number)),
            Err(MBM_BUSY) if call.want != Want::Status(MBM_BUSY) => Ok(None),
            Err(refused) => Err(refused),
        }
    }

    /// Starts the requests, and lets time pass until all have ended.
    fn requests(&mut self, calls: &[(Call, Request)]) -> Vec<(u8, Vec<u8>, u64)> {
        let begin = self.now();
        let mut numbers: Vec<Option<usize>> = vec![None; calls.len()];
        let mut ended: Vec<Option<(u8, Vec<u8>, u64)>> = vec![None; calls.len()];
        loop {
            for (index, (call, request)) in calls.iter().enumerate() {
                if ended[index].is_some() {
                    continue;
                }
                let time = self.now() - begin;
                if numbers[index].is_none() {
                    match self.try_start(call, request) {
                        Ok(number) => numbers[index] = number,
                        Err(refused) => {
                            ended[index] = Some((refused, Vec::new(), time));
                            continue;
                        }
                    }
                }
                let status = match numbers[index] {
                    Some(number) => self.master().status(number),
                    None => MBM_PENDING,
                };
                if status != MBM_PENDING {
                    let number = numbers[index].expect("it was started");
                    let data = self.master().data(number);
                    ended[index] = Some((status, data, time));
                } else if time >= call.limit.unwrap_or(NEVER) {
                    if let Some(number) = numbers[index] {
                        self.master().cancel(number);
                    }
                    ended[index] = Some((MBM_CANCELLED, Vec::new(), time));
                }
            }
            if ended.iter().all(Option::is_some) {
                return ended.into_iter().flatten().collect();
            }
            let limits = calls.iter().filter_map(|(call, _)| call.limit);
            let limits = limits.map(|limit| begin + limit);
            let end = limits.filter(|end| *end > self.now()).min();
            self.step(end.unwrap_or(u64::MAX));
        }
    }

    /// What a read of a device must return; `None` without a device.
    fn right(&self, request: &Request) -> Option<Vec<u8>> {
        let device = self
            .devices
            .iter()
            .find(|device| device.has(request.unit))?;
        if !request.is_read() {
            return None;
        }
        let addresses = (0..request.quantity).map(|index| request.address.wrapping_add(index));
        Some(match request.function {
            1 | 2 => {
                let mut bytes = vec![0u8; usize::from(request.quantity).div_ceil(8)];
                for (index, address) in addresses.enumerate() {
                    bytes[index / 8] |= u8::from(device::bit(request.unit, address)) << (index % 8);
                }
                bytes
            }
            _ => {
                let words = addresses.map(|address| device.register(request.unit, address));
                words.flat_map(u16::to_be_bytes).collect()
            }
        })
    }

    fn judge(
        &self,
        call: &Call,
        request: &Request,
        ended: &(u8, Vec<u8>, u64),
    ) -> Result<(), String> {
        let (status, data, time) = ended;
        let what = format!(
            "function {:02X} of unit {} at {} ended with {status:02X} after {:.1} ms",
            request.function,
            request.unit,
            request.address,
            *time as f64 / 1_000.0
        );
        if *status == MBM_OK {
            if let Some(right) = self.right(request) {
                if right != *data {
                    return Err(format!(
                        "WRONG DATA: {what}, with {data:02X?}, not {right:02X?}"
                    ));
                }
            }
        }
        let is_gateway = self.role == Role::Gateway;
        let is_as_wanted = match &call.want {
            Want::Any => true,
            Want::Ok => *status == MBM_OK,
            Want::Data(wanted) => *status == MBM_OK && data == wanted,
            Want::Failed => *status != MBM_OK,
            // A gateway reports no more than this to its client.
            Want::Status(wanted) if is_gateway && *wanted >= 0xE0 && *status < 0xE0 => {
                *status == MBM_GATEWAY_TARGET_FAILED_TO_RESPOND
            }
            Want::Status(wanted) => status == wanted,
        };
        if !is_as_wanted {
            return Err(format!(
                "{what}, with {data:02X?}; expected {:02X?}",
                call.want
            ));
        }
        match call.most {
            Some(most) if *time > most => Err(format!("{what}; expected in {} ms", most / 1_000)),
            _ => Ok(()),
        }
    }

    fn device(&mut self, unit: Option<u8>) -> &mut Device {
        let found = self.devices.iter().position(|device| device.is(unit));
        let index = found.unwrap_or_else(|| {
            self.devices.push(Device::new(unit));
            self.devices.len() - 1
        });
        &mut self.devices[index]
    }

    fn hear(&mut self, tokens: &[Token]) {
        let framing = self.case.framing;
        self.transaction += 1;
        let pieces = frame::pieces(framing, self.transaction, tokens);
        let mut wire = self.wire.borrow_mut();
        let is_first = matches!(tokens.first(), Some(Token::Pause(_)));
        let mut pause = if is_first { 0 } else { GAP };
        for (own, bytes) in pieces {
            pause += own;
            if !bytes.is_empty() {
                let at = wire.free(0) + pause;
                wire.deliver(0, at, &bytes);
                pause = 0;
            }
        }
    }

    /// Lets time pass until the bytes on the line have arrived, and then until `is_over`, at
    /// most `time`.
    fn pass_until(&mut self, time: u64, is_over: impl Fn(&World) -> bool) {
        let end = self.wire.borrow().free(0) + time;
        while !is_over(self) && self.now() < end {
            self.step(end);
        }
    }

    fn act(&mut self, step: &Step, round: u32) -> Result<(), String> {
        match step {
            Step::Request(call) => {
                let request = call.request.at(round);
                let ended = self.requests(&[(call.clone(), request.clone())]);
                self.judge(call, &request, &ended[0])
            }
            Step::Within(most, call) => {
                let begin = self.now();
                loop {
                    let request = call.request.at(round);
                    let ended = self.requests(&[(call.clone(), request.clone())]);
                    self.judge(call, &request, &ended[0])?;
                    let time = self.now() - begin;
                    if ended[0].0 == MBM_OK && time <= *most {
                        return Ok(());
                    }
                    if time > *most {
                        let time = time / 1_000;
                        return Err(format!("no request has succeeded after {time} ms"));
                    }
                    self.pass(1_000);
                }
            }
            Step::Together(steps) => {
                let calls = steps.iter().map(|(_, step)| match step {
                    Step::Request(call) => Ok((call.clone(), call.request.at(round))),
                    _ => Err("only requests can be started together".to_string()),
                });
                let calls = calls.collect::<Result<Vec<_>, _>>()?;
                let ended = self.requests(&calls);
                for ((call, request), ended) in calls.iter().zip(&ended) {
                    self.judge(call, request, ended)?;
                }
                Ok(())
            }
            Step::Times(..) => unreachable!("play handles it"),
            Step::Wait(time) => {
                self.pass(*time);
                Ok(())
            }
            Step::Device(unit, words) => {
                let now = self.now();
                let is_new = !self.devices.iter().any(|device| device.is(*unit));
                let device = self.device(*unit);
                if is_new {
                    device.open(now);
                }
                device.set(words)
            }
            Step::Fate(unit, fate, count) => {
                self.device(Some(*unit)).add_fate(*fate, *count);
                Ok(())
            }
            Step::Answer(tokens) => {
                self.answers.push_back(tokens.clone());
                Ok(())
            }
            Step::Hear(tokens) => {
                self.hear(tokens);
                Ok(())
            }
            Step::Reply(tokens) => {
                let wanted = frame::bytes(self.case.framing, self.transaction, tokens);
                self.pass_until(SOON, |own| own.sent.len() > own.replies_seen);
                let Some(found) = self.sent.get(self.replies_seen) else {
                    return Err(format!("no response; expected {wanted:02X?}"));
                };
                self.replies_seen += 1;
                match *found == wanted {
                    true => Ok(()),
                    false => Err(format!("sent {found:02X?}; expected {wanted:02X?}")),
                }
            }
            Step::Silence(time) => {
                self.pass_until(*time, |own| own.sent.len() > own.replies_seen);
                match self.sent.get(self.replies_seen) {
                    Some(found) => Err(format!("sent {found:02X?}; expected nothing")),
                    None => Ok(()),
                }
            }
            Step::Registers(address, wanted) => {
                let first = usize::from(*address);
                let words = self.servers[0].registers();
                let found = words.get(first..(first + wanted.len()).min(REGISTERS));
                match found == Some(wanted.as_slice()) {
                    true => Ok(()),
                    false => Err(format!("the registers are {found:?}; expected {wanted:?}")),
                }
            }
            Step::Event(kind, numbers) => {
                self.pass_until(SOON, |own| !own.events.is_empty());
                let found = self.events.pop_front();
                let is_right = match (&found, kind.as_str()) {
                    (None, "none") => true,
                    (Some(event), kind) => kind == event.kind && event.numbers.starts_with(numbers),
                    _ => false,
                };
                match is_right {
                    true => Ok(()),
                    false => Err(format!("{found:?}; expected {kind} {numbers:?}")),
                }
            }
            Step::Sent(bound) => {
                let count = self.sent.len() - self.sent_seen;
                self.sent_seen = self.sent.len();
                match bound.holds(count) {
                    true => Ok(()),
                    false => Err(format!("{count} frames were sent")),
                }
            }
            Step::Opened(bound) => {
                let count = self.opened - self.opened_seen;
                self.opened_seen = self.opened;
                match bound.holds(count) {
                    true => Ok(()),
                    false => Err(format!("{count} connections were opened")),
                }
            }
            Step::Echo(lost) => {
                self.wire.borrow_mut().set_echo(self.end, *lost);
                Ok(())
            }
            Step::Twin(slow) => {
                let end = self.wire.borrow_mut().connect(0, self.block);
                self.add_server(end, *slow)
            }
        }
    }

    fn play(&mut self, steps: &[(usize, Step)], round: u32) -> PlayResult {
        for (line, step) in steps {
            if let Step::Times(count, inner) = step {
                for round in 0..*count {
                    self.play(inner, round).map_err(|(line, why)| {
                        (line, format!("round {} of {count}: {why}", round + 1))
                    })?;
                }
                continue;
            }
            self.act(step, round).map_err(|why| {
                (
                    *line,
                    format!("at {:.1} ms: {why}", self.now() as f64 / 1_000.0),
                )
            })?;
        }
        Ok(())
    }
}

/// Plays the whole case.
pub fn play(case: &Case, role: Role, block: Block) -> PlayResult {
    let mut world = World::new(case, role, block).map_err(|why| (1, why))?;
    if case.framing.is_stream() && role == Role::Client {
        // The link opens the connection.
        world.pass(1_000);
        world.opened_seen = world.opened;
    }
    world.play(&case.steps, 0)
}
