//! Random lives of a server whose futures are dropped at any time, and run again at once or later.
#![cfg(feature = "embedded-io-async")]

mod common;
#[path = "common/random.rs"]
mod random;

use common::async_line::{poll, Delay, Line, State, STEP};
use common::frame::framed;
use mbm::frame::{ascii::END, Framing};
use mbm::port::AsyncIo;
use mbm::server::{respond, AsyncServer, AsyncUnits, Indication, Reply, Tables, Unit, Units};
use mbm::Error;
use random::Random;
use std::pin::pin;
use std::task::Poll;

const UNIT: u8 = 17;

/// The response timeout of the client.
const TIMEOUT: u32 = 100_000;

type Registers = Unit<Tables<[bool; 0], [bool; 0], [u16; 30], [u16; 0]>>;

fn registers() -> Registers {
    Unit::new(UNIT, Tables::NONE.with_holding_registers(0, [0; 30]))
}

/// Units that take their time.
struct Slow {
    unit: Registers,
    line: Line,
    time: u32,
}

impl AsyncUnits for Slow {
    async fn answer(&mut self, info: &Indication, pdu: &mut [u8]) -> Reply {
        if self.time > 0 {
            let timer = &mut Delay(self.line.clone());
            embedded_hal_async::delay::DelayNs::delay_us(timer, self.time).await;
        }
        self.unit.serve(info, pdu)
    }

    fn contains(&self, unit: u8) -> bool {
        self.unit.has(unit)
    }
}

/// A request whose response no other request has.
fn request(random: &mut Random, framing: Framing, number: u16) -> Vec<u8> {
    let [high, low] = number.to_be_bytes();
    let content: &[u8] = match random.below(6) {
        0 => &[UNIT, 6, 0, 1, high, low],
        // A write of register 0 and a read that begins with it.
        1 | 2 => &[UNIT, 23, 0, 0, 0, 20, 0, 0, 0, 1, 2, high, low],
        3 => &[UNIT, 22, 0, 2, high, low, 0, 0],
        4 if !framing.is_serial() => &[UNIT, 6, high | 0x80, low, 0, 1],
        _ => &[UNIT + 1, 6, 0, 1, high, low],
    };
    framed(framing, number, content[0], &content[1..])
}

/// What the units answer; empty if nothing.
fn answer(unit: &mut Registers, framing: Framing, request: &[u8]) -> Vec<u8> {
    let mut frame = [0; 600];
    frame[..request.len()].copy_from_slice(request);
    let length = respond(framing, END, &mut frame, request.len(), unit).unwrap();
    frame[..length].to_vec()
}

/// A device of random quirks.
fn quirks(random: &mut Random, state: &mut State) {
    state.per_read = random.one_of(&[1, 2, 7, 64, usize::MAX]);
    state.per_write = random.one_of(&[1, 3, 16, usize::MAX]);
    state.space = random.one_of(&[1, 4, 16, usize::MAX]);
    state.flushes_early = random.below(4) == 0;
}

macro_rules! run_and_drop {
    ($random:expr, $line:expr, $server:expr, $units:expr) => {{
        let mut run = pin!($server.run($units));
        let polls = $random.one_of(&[1, 2, 3, 10, 100]);
        for _ in 0..1 + $random.below(polls) {
            match poll(run.as_mut()) {
                Poll::Pending => $line.pass(STEP),
                Poll::Ready(lost) => panic!("{lost:?}"),
            }
        }
    }};
}

#[test]
fn each_request_of_a_stream_gets_one_whole_response_in_order() {
    for seed in random::seeds(300) {
        let random = &mut Random::new(seed);
        let framing = random.one_of(&[Framing::Tcp, Framing::RtuOverTcp]);
        let line = Line::default();
        quirks(random, &mut line.state());
        line.state().driver = true;
        let port = AsyncIo::stream(line.clone(), line.clock(), Delay(line.clone()));
        let mut server = AsyncServer::with_framing(framing, port, [0; 260]);
        let time = random.one_of(&[0, 0, 500, 3_000]);
        let mut units = Slow {
            unit: registers(),
            line: line.clone(),
            time,
        };
        let (mut model, mut expected) = (registers(), Vec::new());
        for number in 0..20 {
            let request = request(random, framing, number);
            expected.extend(answer(&mut model, framing, &request));
            let after = random.one_of(&[0, 0, 1_000, 20_000]);
            let block = random.one_of(&[0, 3, 8, 300]);
            line.arrive_in_blocks(after, block, &request);
            for _ in 0..random.below(10) {
                run_and_drop!(random, line, server, &mut units);
                line.pass(random.one_of(&[0, 0, 0, 50, 1_000, 30_000, 20_000_000]));
            }
        }
        let lost = line.run_for(3_000_000, server.run(&mut units));
        assert_eq!(lost, None::<Error>, "seed {seed}");
        assert_eq!(line.take(), expected, "seed {seed}");
        assert_eq!(units.unit.device, model.device, "seed {seed}");
    }
}

/// How often `part` is in `bytes`.
fn count(bytes: &[u8], part: &[u8]) -> usize {
    bytes
        .windows(part.len())
        .filter(|window| *window == part)
        .count()
}

/// Lives of a server on a serial line. `pauses` are the times between two futures. Returns how many
/// requests were answered, and how many have an answer.
fn serial_lives(pauses: &[u32], lives: u64) -> (u32, u32) {
    let (mut answered, mut all) = (0, 0);
    for seed in random::seeds(lives) {
        let random = &mut Random::new(seed);
        let framing = random.one_of(&[Framing::Rtu, Framing::Ascii]);
        let line = Line::default();
        quirks(random, &mut line.state());
        let (clock, driver) = (line.clock(), line.driver());
        let port = AsyncIo::serial_with_driver(line.clone(), clock, Delay(line.clone()), driver);
        let mut server = AsyncServer::with_framing(framing, port, [0; 513]);
        server.set_baud_rate(115_200);
        // Short responses need no hold.
        let space = line.state().space;
        let is_early = line.state().flushes_early;
        let left = if is_early && space <= 16 {
            space as u8
        } else {
            0
        };
        server.set_post_flush_hold(left);
        let mut units = Slow {
            unit: registers(),
            line: line.clone(),
            time: random.one_of(&[0, 0, 700]),
        };
        let mut model = registers();
        let mut earlier: Vec<Vec<u8>> = Vec::new();
        for number in 0..20 {
            let request = request(random, framing, number);
            let expected = answer(&mut model, framing, &request);
            let block = random.one_of(&[0, 0, 4, 16]);
            // A byte that is sent while the client sends collides with those of the client.
            let free = line.arrive_in_blocks(0, block, &request);
            line.take();
            let mut received = Vec::new();
            let sent = line.state().now;
            // The client waits for the response, and then until the line is silent.
            while line.state().now.wrapping_sub(sent) < TIMEOUT {
                run_and_drop!(random, line, server, &mut units);
                assert!(
                    !line.state().driver,
                    "seed {seed}, {number}: the driver is on"
                );
                line.pass(random.one_of(pauses));
                received.extend(line.take_after(free));
                if !expected.is_empty() && received.ends_with(&expected) {
                    break;
                }
            }
            let case = format!("seed {seed}, {number}: {received:02X?}");
            for late in &earlier {
                assert_eq!(count(&received, late), 0, "{case}: {late:02X?}");
            }
            if expected.is_empty() {
                assert!(received.is_empty() || pauses != [0], "{case}");
                continue;
            }
            let answers = count(&received, &expected);
            assert!(answers <= 1, "{case}");
            answered += answers as u32;
            all += 1;
            earlier.push(expected);
            // A request that was not answered may have been carried out or not.
            if answers == 0 {
                model.device = units.unit.device;
            }
        }
        // The server is right again as soon as it is left alone.
        let lost = line.run_for(3 * TIMEOUT, server.run(&mut units));
        assert_eq!(lost, None::<Error>, "seed {seed}");
        line.take();
        let request = framed(framing, 0, UNIT, &[6, 0, 5, 0x55, 0x55]);
        line.arrive(0, &request);
        assert_eq!(line.run_for(TIMEOUT, server.run(&mut units)), None);
        assert_eq!(line.take(), request, "seed {seed}");
    }
    (answered, all)
}

#[test]
fn each_request_of_a_serial_line_is_answered_by_futures_that_follow_each_other() {
    let (answered, all) = serial_lives(&[0], 40);
    assert_eq!(answered, all);
}

#[test]
fn a_response_on_a_serial_line_is_never_late_and_the_driver_goes_off_with_the_future() {
    let (answered, all) = serial_lives(&[0, 0, 0, 0, 50, 500, 5_000, 50_000, 150_000], 80);
    assert!(answered > all / 20, "{answered} of {all}");
}
