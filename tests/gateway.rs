//! The gateway under random events: requests that arrive in pieces, devices that answer late, not
//! at all or with an exception, connections that close or take few bytes. Every response must
//! belong to a request of its connection, each request has at most one, and the connections take
//! turns on each line.

use mbm::error::Status;
use mbm::frame::tcp;
use mbm::gateway::{
    ConnectionState, Gateway, GatewayStorage, LineState, RequestResult, Route, Transaction,
    ALL_LINES, LOCAL, NO_RESPONSE, UNIT_0,
};
use std::cell::Cell;
use std::collections::{HashMap, VecDeque};

const CONNECTIONS: usize = 4;
const REQUESTS: usize = 9;
const LINES: usize = 2;

/// The line with TCP frames: its unit 0 answers.
const TCP_LINE: u8 = 1;

const fn route(first: u16, last: u16, line: u8, unit: u16) -> Route {
    Route {
        first,
        last,
        line,
        unit,
    }
}

const ROUTES: [Route; 5] = [
    route(1, 9, 0, 0),
    route(11, 19, TCP_LINE, 1),
    route(100, 100, TCP_LINE, UNIT_0),
    route(200, 200, LOCAL, 3),
    route(0, 0, ALL_LINES, 0),
];

/// A request that a line has.
struct Held {
    request: u16,
    unit: u8,
    /// Polls until it ends.
    left: u32,
    status: Status,
}

struct World {
    seed: Cell<u64>,
    /// Lines are always ready, and connections take and give all bytes.
    is_smooth: bool,
    now: u32,
    transactions: [Transaction; REQUESTS],
    frames: [[u8; tcp::MAX_FRAME]; REQUESTS],
    connections: [ConnectionState; CONNECTIONS],
    lines: [LineState; LINES],
    incoming: [VecDeque<u8>; CONNECTIONS],
    outgoing: [Vec<u8>; CONNECTIONS],
    lost: [bool; CONNECTIONS],
    on_line: [Vec<Held>; LINES],
    ended: HashMap<u16, RequestResult>,
    /// The connection and line of each request that went to a line.
    starts: Vec<(usize, u8)>,
    broadcasts: usize,
}

impl World {
    fn random(&self, below: u32) -> u32 {
        let mut seed = self.seed.get();
        seed ^= seed << 13;
        seed ^= seed >> 7;
        seed ^= seed << 17;
        self.seed.set(seed);
        (seed >> 24) as u32 % below
    }
}

impl GatewayStorage for World {
    fn request_count(&self) -> u16 {
        REQUESTS as u16
    }
    fn connection_count(&self) -> u8 {
        CONNECTIONS as u8
    }
    fn line_count(&self) -> u8 {
        LINES as u8
    }
    fn routes(&self) -> &[Route] {
        &ROUTES
    }
    fn request(&mut self, request: u16) -> &mut Transaction {
        &mut self.transactions[usize::from(request)]
    }
    fn frame(&mut self, request: u16) -> &mut [u8] {
        &mut self.frames[usize::from(request)]
    }
    fn connection(&self, connection: u8) -> &ConnectionState {
        &self.connections[usize::from(connection)]
    }
    fn connection_mut(&mut self, connection: u8) -> &mut ConnectionState {
        &mut self.connections[usize::from(connection)]
    }
    fn line(&mut self, line: u8) -> &mut LineState {
        &mut self.lines[usize::from(line)]
    }
    fn read(&mut self, connection: u8, request: u16, from: u16, until: u16) -> i16 {
        let connection = usize::from(connection);
        if self.lost[connection] {
            return -1;
        }
        assert!(from < until);
        let most = self.incoming[connection].len().min((until - from).into());
        let count = match self.random(3) {
            0 if !self.is_smooth => most.min(1),
            _ => most,
        };
        for at in 0..count {
            let byte = self.incoming[connection].pop_front().unwrap();
            self.frames[usize::from(request)][usize::from(from) + at] = byte;
        }
        count as i16
    }
    fn write(&mut self, connection: u8, request: u16, from: u16, until: u16) -> i16 {
        let connection = usize::from(connection);
        if self.lost[connection] {
            return -1;
        }
        let count = match self.random(4) {
            0 if !self.is_smooth => 0,
            1 if !self.is_smooth => 1,
            _ => until - from,
        };
        let frame = self.frames[usize::from(request)];
        self.outgoing[connection].extend(&frame[from.into()..(from + count).into()]);
        count as i16
    }
    fn now(&mut self, _: u8) -> u32 {
        self.now
    }
    fn poll_line(&mut self, line: u8) -> Status {
        let mut held = std::mem::take(&mut self.on_line[usize::from(line)]);
        held.retain_mut(|held| {
            held.left -= 1;
            if held.left > 0 {
                return true;
            }
            let frame = &mut self.frames[usize::from(held.request)];
            // The device adds one to the last byte, so that the response says which request
            // it answers.
            frame[11] = frame[11].wrapping_add(1);
            let exception = if held.status.is_exception() { 2 } else { 0 };
            let result = RequestResult {
                status: held.status,
                exception,
                length: match held.unit == 0 && line != TCP_LINE {
                    true => NO_RESPONSE,
                    false => 4,
                },
            };
            self.ended.insert(held.request, result);
            false
        });
        let status = if held.is_empty() {
            Status::OK
        } else {
            Status::PENDING
        };
        self.on_line[usize::from(line)] = held;
        status
    }
    fn line_delay(&mut self, line: u8) -> u32 {
        match self.on_line[usize::from(line)].is_empty() {
            true => u32::MAX,
            false => 0,
        }
    }
    fn rest(&mut self, _: u8, _: u8) -> u32 {
        0
    }
    fn line_places(&self, _: u8) -> u16 {
        16
    }
    fn line_depth(&self, line: u8) -> u16 {
        1 + u16::from(line)
    }
    fn is_ready(&self, _: u8) -> bool {
        self.is_smooth || self.random(20) != 0
    }
    fn forward(&mut self, line: u8, request: u16, unit: u8, length: u16) -> Status {
        assert_eq!(length, 4);
        let held = &self.on_line[usize::from(line)];
        assert!(held.len() < usize::from(self.line_depth(line)));
        assert!(self
            .on_line
            .iter()
            .flatten()
            .all(|held| held.request != request));
        let transaction = u16::from_be_bytes([
            self.frames[usize::from(request)][0],
            self.frames[usize::from(request)][1],
        ]);
        self.starts.push((usize::from(transaction >> 12), line));
        self.broadcasts += usize::from(unit == 0 && line != TCP_LINE);
        self.ended.remove(&request);
        let status = match self.random(8) {
            0 => Status::RESPONSE_TIMED_OUT,
            1 => Status::LINK_LOST,
            2 => Status::ILLEGAL_DATA_ADDRESS,
            _ => Status::OK,
        };
        let left = 1 + self.random(4);
        self.on_line[usize::from(line)].push(Held {
            request,
            unit,
            left,
            status,
        });
        Status::PENDING
    }
    fn result(&mut self, request: u16) -> RequestResult {
        self.ended.get(&request).copied().unwrap_or(RequestResult {
            status: Status::PENDING,
            exception: 0,
            length: 0,
        })
    }
    fn cancel(&mut self, line: u8, request: u16) {
        self.on_line[usize::from(line)].retain(|held| held.request != request);
        self.ended.remove(&request);
    }
    fn serve(&mut self, _connection: u8, request: u16, length: u16) -> Option<u16> {
        assert_eq!(self.frames[usize::from(request)][6], 3);
        if self.random(3) == 0 {
            return None;
        }
        self.frames[usize::from(request)][11] ^= 0x80;
        Some(length)
    }
}

/// The requests of a client that are not answered yet: unit and last byte, by transaction.
type Asked = HashMap<u16, (u8, u8)>;

/// Checks all complete responses that a client has received.
fn check(outgoing: &mut Vec<u8>, asked: &mut Asked) -> usize {
    let mut count = 0;
    while let Ok(header) = tcp::header(outgoing) {
        if outgoing.len() < header.total {
            break;
        }
        let frame: Vec<u8> = outgoing.drain(..header.total).collect();
        let request = asked.remove(&header.transaction);
        let (unit, last) = request.expect("a response without a request, or a second one");
        assert_eq!(header.unit, unit);
        match frame[7..] {
            [3, _, _, _, byte] if unit == 200 => assert_eq!(byte, last ^ 0x80),
            [3, _, _, _, byte] => assert_eq!(byte, last.wrapping_add(1)),
            [0x83, 2 | 0x0A | 0x0B] => {}
            _ => panic!("an unexpected response: {frame:?}"),
        }
        count += 1;
    }
    count
}

/// Between two requests of one connection on a line of depth 1, none of another connection has
/// two turns while the first one waits. (The test keeps every queue full in this run.)
fn takes_turns(starts: &[(usize, u8)]) {
    let turns: Vec<usize> = (starts.iter().filter(|(_, line)| *line == 0))
        .map(|(connection, _)| *connection)
        .collect();
    for window in turns.windows(CONNECTIONS).skip(CONNECTIONS) {
        let mut sorted = window.to_vec();
        sorted.sort_unstable();
        assert_eq!(sorted, [0, 1, 2, 3]);
    }
    assert!(turns.len() > 20 * CONNECTIONS);
}

fn gateway(seed: u64) -> Gateway<World> {
    let mut gateway = Gateway::new(World {
        seed: Cell::new(seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1),
        is_smooth: false,
        now: 0,
        transactions: [Transaction::FREE; REQUESTS],
        frames: [[0; tcp::MAX_FRAME]; REQUESTS],
        connections: [ConnectionState::FREE; CONNECTIONS],
        lines: [LineState::NEW; LINES],
        incoming: Default::default(),
        outgoing: Default::default(),
        lost: Default::default(),
        on_line: Default::default(),
        ended: HashMap::new(),
        starts: Vec::new(),
        broadcasts: 0,
    });
    for connection in 0..CONNECTIONS as u8 {
        gateway.open(connection);
    }
    gateway
}

/// A client sends a request for this unit.
fn ask(world: &mut World, asked: &mut Asked, connection: usize, number: u16, unit: u8) {
    let transaction = (connection as u16) << 12 | number & 0xFFF;
    let last = number as u8;
    let [high, low] = transaction.to_be_bytes();
    world.incoming[connection].extend([high, low, 0, 0, 0, 6, unit, 3, 0, 1, 0, last]);
    if unit != 0 {
        asked.insert(transaction, (unit, last));
    }
}

#[test]
fn every_response_belongs_to_a_request_of_its_connection() {
    let (mut answered, mut broadcasts) = (0, 0);
    for seed in 1..=60 {
        let mut gateway = gateway(seed);
        let mut asked: [Asked; CONNECTIONS] = Default::default();
        if seed % 3 == 0 {
            gateway.set_max_pending(2);
        }
        if seed % 4 == 0 {
            gateway.set_queue_time(3000);
        }
        for number in 0..400 {
            let connection = gateway.storage.random(CONNECTIONS as u32) as usize;
            let unit = match gateway.storage.random(12) {
                0 => 0,
                1 => 200,
                2 => 77,
                3 => 100,
                more if more % 2 == 0 => 1 + more as u8 % 9,
                more => 11 + more as u8 % 9,
            };
            let world = &mut gateway.storage;
            ask(world, &mut asked[connection], connection, number, unit);
            gateway.storage.now += 500;
            gateway.poll();
            if gateway.storage.random(60) == 0 {
                // The connection ends, and another client takes its place.
                gateway.storage.lost[connection] = true;
                gateway.poll();
                gateway.storage.lost[connection] = false;
                // While it is not read, only the program can see that it is gone.
                match gateway.status(connection as u8) {
                    Status::OK => gateway.close(connection as u8),
                    status => assert_eq!(status, Status::LINK_LOST),
                }
                assert_eq!(gateway.pending(connection as u8), 0);
                gateway.storage.incoming[connection].clear();
                gateway.storage.outgoing[connection].clear();
                asked[connection].clear();
                gateway.open(connection as u8);
            }
            for (asked, outgoing) in asked.iter_mut().zip(&mut gateway.storage.outgoing) {
                answered += check(outgoing, asked);
            }
        }
        // All requests end.
        for _ in 0..20_000 {
            gateway.storage.now += 500;
            gateway.poll();
            if gateway.poll_delay() == u32::MAX {
                break;
            }
        }
        assert_eq!(gateway.poll_delay(), u32::MAX, "seed {seed}");
        for (connection, asked) in asked.iter_mut().enumerate() {
            answered += check(&mut gateway.storage.outgoing[connection], asked);
            assert!(asked.is_empty(), "seed {seed}: no response to {asked:?}");
            assert_eq!(gateway.pending(connection as u8), 0);
            assert!(gateway.is_reading(connection as u8));
        }
        broadcasts += gateway.storage.broadcasts;
    }
    assert!(answered > 10_000 && broadcasts > 100);
}

#[test]
fn connections_that_always_have_requests_take_turns() {
    for seed in 1..=10 {
        let mut gateway = gateway(seed);
        gateway.storage.is_smooth = true;
        let mut asked: [Asked; CONNECTIONS] = Default::default();
        for number in 0..400 {
            for (connection, asked) in asked.iter_mut().enumerate() {
                // The first one floods.
                for more in 0..if connection == 0 { 3 } else { 1 } {
                    if gateway.storage.incoming[connection].len() < 60 {
                        let number = number * 3 + more;
                        ask(&mut gateway.storage, asked, connection, number, 5);
                    }
                }
            }
            gateway.poll();
            for outgoing in &mut gateway.storage.outgoing {
                outgoing.clear();
            }
        }
        takes_turns(&gateway.storage.starts);
    }
}
