//! Futures of a server that are dropped: random lives, in which they are dropped at any time and run
//! again at once or later, and single cases.
#![cfg(feature = "embedded-io-async")]

mod common;
#[path = "common/random.rs"]
mod random;

use common::async_line::{poll, Delay, Line, State, CHARACTER, SILENCE, STEP};
use common::async_server::{in_each_framing, registers, server, stream, write, FRAMINGS, LONG};
use common::frame::framed;
use mbm::frame::ascii::END;
use mbm::frame::Framing;
use mbm::port::AsyncIo;
use mbm::server::{respond, AsyncServer, AsyncUnits, Indication, Reply, Tables, Unit, Units};
use mbm::Error;
use random::Random;
use std::future::Future;
use std::pin::pin;
use std::task::Poll;

const UNIT: u8 = 17;

/// The response timeout of the client.
const TIMEOUT: u32 = 100_000;

type Registers = Unit<Tables<[bool; 0], [bool; 0], [u16; 30], [u16; 0]>>;

fn new_unit() -> Registers {
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
            unit: new_unit(),
            line: line.clone(),
            time,
        };
        let (mut model, mut expected) = (new_unit(), Vec::new());
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
            unit: new_unit(),
            line: line.clone(),
            time: random.one_of(&[0, 0, 700]),
        };
        let mut model = new_unit();
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

// --- single cases, and the driver ---

#[test]
fn the_driver_is_on_from_the_first_byte_of_a_response_to_its_last() {
    let line = Line::default();
    let mut server = server(&line, Framing::Rtu);
    let mut unit = registers();
    let request = write(Framing::Rtu, 5);
    line.arrive(0, &request);
    let mut run = pin!(server.run(&mut unit));
    for _ in 0..LONG / STEP {
        assert!(poll(run.as_mut()).is_pending());
        line.pass(STEP);
        assert!(!line.state().driver || line.state().received.len() <= request.len());
    }
    assert!(!line.state().driver);
    assert_eq!(line.state().switched, 2);
    // What left while the driver was off would be missing.
    assert_eq!(line.take(), request);
}

#[test]
fn the_driver_stays_on_for_bytes_that_a_flush_has_left_in_the_hardware() {
    for framing in [Framing::Rtu, Framing::Ascii] {
        let line = Line::default();
        line.state().flushes_early = true;
        let mut server = server(&line, framing);
        let mut unit = registers();
        let request = write(framing, 5);
        line.arrive(0, &request);
        assert_eq!(line.run_for(LONG, server.run(&mut unit)), None);
        assert_eq!(line.take(), request, "{framing:?}");
        assert!(!line.state().driver);
    }
}

fn time_of_the_driver(post_flush_characters: u8) -> u32 {
    let line = Line::default();
    let mut server = server(&line, Framing::Rtu);
    server.set_post_flush_hold(post_flush_characters);
    let mut unit = registers();
    let request = write(Framing::Rtu, 5);
    line.arrive(0, &request);
    let mut run = pin!(server.run(&mut unit));
    while line.state().switched < 2 {
        assert!(poll(run.as_mut()).is_pending());
        line.pass(STEP);
    }
    let state = line.state();
    let last = state.received.last().expect("a response").0;
    state.now.wrapping_sub(last)
}

#[test]
fn the_driver_goes_off_a_character_after_the_last_byte_or_after_the_hold() {
    assert!(time_of_the_driver(0) <= CHARACTER + 3 * STEP);
    let held = time_of_the_driver(7);
    assert!(
        (7 * CHARACTER..=7 * CHARACTER + 3 * STEP).contains(&held),
        "{held}"
    );
}

fn run_until_sent(line: &Line, bytes: usize, future: impl Future) {
    let mut future = pin!(future);
    for _ in 0..LONG / STEP {
        assert!(poll(future.as_mut()).is_pending());
        if line.state().received.len() == bytes {
            return;
        }
        line.pass(STEP);
    }
    panic!("{bytes} bytes are not sent");
}

#[test]
fn the_driver_goes_off_when_the_future_is_dropped_in_the_middle_of_a_response() {
    for (space, per_write) in [(usize::MAX, usize::MAX), (1, 1)] {
        let line = Line::default();
        line.state().space = space;
        line.state().per_write = per_write;
        let mut server = server(&line, Framing::Rtu);
        let mut unit = registers();
        line.arrive(0, &write(Framing::Rtu, 5));
        run_until_sent(&line, 3, server.run(&mut unit));
        assert!(!line.state().driver);
        // Seconds later the line may belong to others: nothing is sent any more.
        line.pass(5_000_000);
        line.take();
        assert_eq!(line.run_for(LONG, server.run(&mut unit)), None);
        assert_eq!(line.take(), []);
        assert!(!line.state().driver);
        let request = write(Framing::Rtu, 6);
        line.arrive(0, &request);
        assert_eq!(line.run_for(LONG, server.run(&mut unit)), None);
        assert_eq!(line.take(), request);
    }
}

#[test]
fn a_response_whose_future_is_dropped_goes_on_if_the_server_runs_again_at_once() {
    for per_write in [1, usize::MAX] {
        in_each_framing!(framing, line, server, {
            line.state().space = per_write;
            line.state().per_write = per_write;
            let mut unit = registers();
            for value in [1, 2] {
                let request = write(framing, value);
                line.arrive(0, &request);
                // A select whose other branch is ready at each poll.
                for _ in 0..LONG / STEP {
                    assert_eq!(line.run_for(STEP / 2, server.run(&mut unit)), None);
                }
                assert_eq!(line.take(), request, "{framing:?}, {per_write}");
            }
        });
    }
}

#[test]
fn a_response_of_which_a_stream_has_taken_a_part_is_finished_however_late() {
    for framing in [Framing::Tcp, Framing::RtuOverTcp] {
        let line = Line::default();
        line.state().space = 1;
        let mut server = stream(&line, framing);
        let mut unit = registers();
        let requests = [write(framing, 1), write(framing, 2)].concat();
        line.arrive(0, &requests);
        run_until_sent(&line, 3, server.run(&mut unit));
        line.pass(60_000_000);
        assert_eq!(line.run_for(LONG, server.run(&mut unit)), None);
        assert_eq!(line.take(), requests, "{framing:?}");
    }
}

#[test]
fn a_response_that_was_not_begun_is_sent_unless_the_client_has_sent_again() {
    for is_again in [false, true] {
        let line = Line::default();
        line.state().space = 0;
        let mut server = server(&line, Framing::Rtu);
        let mut unit = registers();
        line.arrive(0, &write(Framing::Rtu, 5));
        assert_eq!(line.run_for(20_000, server.run(&mut unit)), None);
        assert_eq!(line.state().switched, 2);
        line.state().space = usize::MAX;
        let mut expected = write(Framing::Rtu, 5);
        if is_again {
            expected = write(Framing::Rtu, 6);
            line.arrive(0, &expected);
            line.pass(20 * CHARACTER);
        }
        assert_eq!(line.run_for(LONG, server.run(&mut unit)), None);
        assert_eq!(line.take(), expected);
    }
}

#[test]
fn a_request_that_has_arrived_in_part_outlives_its_future() {
    in_each_framing!(framing, line, server, {
        let mut unit = registers();
        let request = write(framing, 7);
        line.arrive(0, &request[..5]);
        assert_eq!(line.run_for(5 * CHARACTER, server.run(&mut unit)), None);
        line.arrive(0, &request[5..]);
        assert_eq!(line.run_for(LONG, server.run(&mut unit)), None);
        assert_eq!(line.take(), request, "{framing:?}");
    });
}

#[test]
fn a_future_that_is_forgotten_leaves_the_server_usable() {
    let line = Line::default();
    let mut server = server(&line, Framing::Rtu);
    let mut unit = registers();
    line.arrive(0, &write(Framing::Rtu, 5));
    let mut run = Box::pin(server.run(&mut unit));
    while line.state().received.len() < 3 {
        assert!(poll(run.as_mut()).is_pending());
        line.pass(STEP);
    }
    std::mem::forget(run);
    line.pass(1_000_000);
    line.take();
    let mut unit = registers();
    let request = write(Framing::Rtu, 6);
    line.arrive(2 * SILENCE, &request);
    assert_eq!(line.run_for(LONG, server.run(&mut unit)), None);
    assert_eq!(line.take(), request);
    assert!(!line.state().driver);
}
