//! Futures of a server that are dropped, and its driver.
#![cfg(feature = "embedded-io-async")]

mod common;

use common::async_line::{poll, Line, CHARACTER, SILENCE, STEP};
use common::async_server::{in_each_framing, registers, server, stream, write, FRAMINGS, LONG};
use mbm::frame::Framing;
use std::future::Future;
use std::pin::pin;

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
