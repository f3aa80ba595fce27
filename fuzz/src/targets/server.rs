//! A server on a serial line, RTU or ASCII: requests, cut ones, noise and other servers' responses in
//! blocks of any length, and a receiver that may get what the driver sends, also in blocks and held
//! back. One request on the line leads to at most one response, and to nothing else, ever.

use crate::{frame, Input};
use mbm::frame::Framing;
use mbm::port::Port;
use mbm::server::{Addressing, Indication, Reply, Server, Units};
use std::collections::VecDeque;

const UNIT: u8 = 17;

/// No event lasts as long as the server waits for an echo.
const HELD_BACK: u32 = 40_000;

#[derive(Default)]
struct Wire {
    arrived: VecDeque<u8>,
    sent: Vec<u8>,
    now: u32,
}

impl Port for Wire {
    fn read(&mut self, bytes: &mut [u8]) -> Result<usize, mbm::Error> {
        let count = self.arrived.len().min(bytes.len());
        for (place, byte) in bytes.iter_mut().zip(self.arrived.drain(..count)) {
            *place = byte;
        }
        Ok(count)
    }

    fn write(&mut self, bytes: &[u8]) -> Result<usize, mbm::Error> {
        self.sent.extend_from_slice(bytes);
        Ok(bytes.len())
    }

    fn micros(&mut self) -> u32 {
        self.now
    }
}

/// Returns the data of each request up to the length that the first byte says, which may be that of
/// the request.
struct Unit {
    length: u8,
    /// The requests that were sent whole.
    requests: Vec<Vec<u8>>,
    response: Vec<u8>,
    /// Other bytes have a right CRC or LRC by chance. The fuzzer finds such.
    has_chance: bool,
}

impl Units for Unit {
    fn serve(&mut self, info: &Indication, pdu: &mut [u8]) -> Reply {
        if info.addressing(pdu[0]) != Addressing::OWN || info.to != UNIT {
            self.has_chance |= info.length != 0 && (pdu[0] < 0x80 || info.length != 2);
            return Reply::NO_RESPONSE;
        }
        assert!(pdu[0] < 0x80, "an exception response is served");
        let request = pdu[..info.length.into()].to_vec();
        if !self.requests.contains(&request) {
            assert_ne!(request, self.response, "an echo is served");
            self.has_chance = true;
            return Reply::NO_RESPONSE;
        }
        let reply = self.reply(info, pdu);
        let length = reply.write_exception(&mut pdu.to_vec());
        self.response = pdu[..length].to_vec();
        reply
    }

    fn has(&self, unit: u8) -> bool {
        unit == UNIT || unit == 0
    }
}

impl Unit {
    fn reply(&self, info: &Indication, pdu: &mut [u8]) -> Reply {
        match (pdu[0], usize::from(self.length)) {
            // These have the bytes of their request.
            (5 | 6 | 8 | 0x15 | 0x16 | 0x41, _) => Reply::length(info.length.into()),
            (0x10, _) => Reply::length(5),
            (_, length @ 0..=60) if length % 2 == 0 => {
                pdu[1] = length as u8;
                pdu[2..2 + length].fill(length as u8);
                Reply::length(2 + length)
            }
            _ => Reply::exception(self.length % 11 + 1),
        }
    }
}

fn framed(framing: Framing, pdu: &[u8]) -> Vec<u8> {
    frame::framed(framing, 0, UNIT, pdu)
}

/// A request that a client may send.
fn request(input: &mut Input) -> Vec<u8> {
    let (code, value) = (input.u8(), input.u16().to_be_bytes());
    match code % 8 {
        0 => vec![5, 0, value[0], 0xFF, 0],
        1 => vec![6, 0, 1, value[0], value[1]],
        2 => {
            let count = value[0] % 60 + 1;
            let mut pdu = vec![0x10, 0, 0, 0, count, 2 * count];
            pdu.extend((0..2 * count).map(|index| index ^ value[1]));
            pdu
        }
        3 => vec![0x16, 0, value[0], 0, 1, 0, value[1]],
        4 => vec![8, 0, 0, value[0], value[1]],
        5 => vec![0x41, value[0], value[1]],
        _ => vec![code % 4 + 1, value[0], 0, 0, value[1] % 100 + 1],
    }
}

struct Line {
    server: Server<Wire, [u8; 513]>,
    unit: Unit,
    has_echo: bool,
    /// The echo that has not arrived, and how long it has been held back.
    echo: VecDeque<u8>,
    held: u32,
    sent: u32,
}

impl Line {
    fn poll(&mut self) {
        // A server may have to read the port several times.
        for _ in 0..4 {
            let now = self.server.port.now;
            self.server.serve(now, &mut self.unit).expect("a line");
            let sent = std::mem::take(&mut self.server.port.sent);
            if sent.is_empty() {
                continue;
            }
            self.sent += 1;
            if self.has_echo {
                self.echo.extend(sent);
                self.held = 0;
            }
        }
    }

    fn pass(&mut self, time: u32) {
        self.server.port.now = self.server.port.now.wrapping_add(time);
        self.held += time;
        self.poll();
    }

    fn arrive(&mut self, bytes: impl IntoIterator<Item = u8>) {
        self.server.port.arrived.extend(bytes);
        while !self.server.port.arrived.is_empty() {
            self.poll();
        }
    }
}

pub fn run(data: &[u8]) {
    let mut input = Input(data);
    let kind = input.u8();
    let framing = if kind & 1 == 0 {
        Framing::Rtu
    } else {
        Framing::Ascii
    };
    let mut line = Line {
        server: Server::with_framing(framing, Wire::default(), [0; 513]),
        unit: Unit {
            length: 2,
            requests: Vec::new(),
            response: Vec::new(),
            has_chance: false,
        },
        has_echo: kind & 2 != 0,
        echo: VecDeque::new(),
        held: 0,
        sent: 0,
    };
    let mut requests = 0;
    for _ in 0..64 {
        if input.0.is_empty() {
            break;
        }
        // The bytes of the wire arrive in their order, and in time.
        let next = match line.echo.len() {
            0 => input.u8() % 8,
            _ => 8 + input.u8() % 2,
        };
        match next {
            0..=2 => {
                line.unit.length = input.u8();
                let pdu = request(&mut input);
                let bytes = framed(framing, &pdu);
                line.unit.requests.push(pdu);
                requests += 1;
                let block = usize::from(input.u8()).max(1);
                for bytes in bytes.chunks(block) {
                    line.arrive(bytes.iter().copied());
                    if block < 200 {
                        line.pass(u32::from(input.u8()) * 100);
                    }
                }
            }
            3 => {
                let bytes = framed(framing, &request(&mut input));
                let cut = usize::from(input.u8()) % bytes.len();
                line.arrive(bytes[..cut].iter().copied());
            }
            4 => line.arrive(vec![0x55; (input.u8() % 20).into()]),
            5 => {
                // An exception response of another server.
                let bytes = framed(framing, &[input.u8() | 0x80, input.u8() % 11 + 1]);
                line.arrive(bytes);
            }
            6 => line.pass(5_000),
            7 => line.pass(u32::from(input.u16()) * 20),
            8 => {
                let count = usize::from(input.u8()).clamp(1, line.echo.len());
                let bytes: Vec<u8> = line.echo.drain(..count).collect();
                line.arrive(bytes);
            }
            _ => {
                let time = u32::from(input.u8()) * 40;
                if line.held + time > HELD_BACK {
                    let bytes = std::mem::take(&mut line.echo);
                    line.arrive(bytes);
                } else {
                    line.pass(time);
                }
            }
        }
        if line.unit.has_chance {
            return;
        }
        assert!(line.sent <= requests, "more responses than requests");
    }
    let bytes = std::mem::take(&mut line.echo);
    line.arrive(bytes);
    for _ in 0..20 {
        line.pass(100_000);
        let bytes = std::mem::take(&mut line.echo);
        line.arrive(bytes);
    }
    assert!(line.sent <= requests, "more responses than requests");
}
