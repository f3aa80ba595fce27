//! The server with futures, on a simulated line or connection.
#![cfg(feature = "embedded-io-async")]

mod common;

use common::async_line::{poll, Delay, Line, SILENCE, STEP};
use common::async_server::{
    in_each_framing, registers, server, stream, write, Server, FRAMINGS, LONG, UNIT,
};
use common::frame::{adu, framed, sealed};
use mbm::frame::Framing;
use mbm::pdu::request::Request;
use mbm::pdu::response::Response;
use mbm::server::{AsyncUnits, Device, Indication, Reply, Unit, Units};
use mbm::{Error, Exception};
use std::future::{pending, Future};
use std::pin::pin;
#[cfg(feature = "std")]
use std::sync::{Arc, Mutex};
#[cfg(feature = "std")]
use std::task::Poll;

#[test]
fn requests_that_arrive_byte_by_byte_or_in_blocks_are_answered_in_each_framing() {
    for (per_read, block) in [
        (1, 0),
        (usize::MAX, 0),
        (usize::MAX, 7),
        (3, 16),
        (usize::MAX, 64),
    ] {
        in_each_framing!(framing, line, server, {
            line.state().per_read = per_read;
            let mut unit = registers();
            for value in [1, 0x3A3A, 0x0D0A] {
                let request = write(framing, value);
                line.arrive_in_blocks(0, block, &request);
                assert_eq!(line.run_for(LONG, server.run(&mut unit)), None);
                assert_eq!(line.take(), request, "{framing:?}, {per_read}, {block}");
                assert_eq!(unit.device.holding_registers.cells[0], value);
            }
        });
    }
}

#[test]
fn a_device_that_takes_a_part_of_the_bytes_gets_the_rest() {
    for (per_write, space) in [(1, 1), (3, usize::MAX), (5, 4), (64, 2)] {
        in_each_framing!(framing, line, server, {
            line.state().per_write = per_write;
            line.state().space = space;
            let mut unit = registers();
            line.arrive(0, &adu(framing, &[UNIT, 3, 0, 107, 0, 10]));
            assert_eq!(line.run_for(LONG, server.run(&mut unit)), None);
            let response = [&[UNIT, 3, 20][..], &[0; 20]].concat();
            assert_eq!(line.take(), adu(framing, &response), "{framing:?}");
        });
    }
}

#[test]
fn pipelined_requests_of_a_stream_are_answered_in_order() {
    for framing in [Framing::Tcp, Framing::RtuOverTcp] {
        let line = Line::default();
        let mut server = stream(&line, framing);
        let mut unit = registers();
        let mut expected = Vec::new();
        let mut requests = Vec::new();
        for value in 0..10 {
            // A request to a unit that is not there gets no response.
            requests.extend(framed(framing, value, UNIT + 1, &[6, 0, 107, 9, 9]));
            requests.extend(write(framing, value));
            expected.extend(write(framing, value));
        }
        line.arrive_in_blocks(0, 500, &requests);
        assert_eq!(line.run_for(LONG, server.run(&mut unit)), None);
        assert_eq!(line.take(), expected, "{framing:?}");
    }
}

#[test]
fn a_damaged_character_costs_one_request_of_a_serial_line() {
    for framing in [Framing::Rtu, Framing::Ascii] {
        let line = Line::default();
        let mut server = server(&line, framing);
        let mut unit = registers();
        line.state().read_failures = 3;
        // The damaged character is not returned.
        line.arrive(0, &write(framing, 1)[1..]);
        assert_eq!(line.run_for(2 * LONG, server.run(&mut unit)), None);
        assert_eq!(line.take(), [], "{framing:?}");
        let request = write(framing, 2);
        line.arrive(0, &request);
        assert_eq!(line.run_for(LONG, server.run(&mut unit)), None);
        assert_eq!(line.take(), request, "{framing:?}");
    }
}

#[test]
fn a_uart_whose_reads_always_fail_does_not_keep_other_tasks_from_running() {
    let line = Line::default();
    line.state().read_failures = u32::MAX;
    let mut server = server(&line, Framing::Rtu);
    let mut unit = registers();
    assert_eq!(line.run_for(LONG, server.run(&mut unit)), None);
    // It slept in between.
    assert!(u32::MAX - line.state().read_failures <= LONG / 200 + 3);
}

#[test]
fn a_read_of_a_stream_that_fails_and_its_end_are_a_lost_link() {
    for framing in [Framing::Tcp, Framing::RtuOverTcp] {
        for fails in [false, true] {
            let line = Line::default();
            let mut server = stream(&line, framing);
            let mut unit = registers();
            // What has arrived before is answered.
            let request = write(framing, 1);
            line.arrive(0, &request);
            let closed = line.clone();
            assert_eq!(line.run_for(LONG, server.run(&mut unit)), None);
            match fails {
                true => closed.state().read_failures = 1,
                false => closed.state().is_closed = true,
            }
            let lost = line.run_for(LONG, server.run(&mut unit));
            assert_eq!(lost, Some(Error::LinkLost));
            assert_eq!(line.take(), request);
            // It stays lost, until another connection is in its place.
            let lost = line.run_for(LONG, server.run(&mut unit));
            assert_eq!(lost, Some(Error::LinkLost));
            let line = Line::default();
            line.state().driver = true;
            line.state().now = closed.state().now;
            server.port().device = line.clone();
            server.reconnect();
            line.arrive(0, &request);
            for _ in 0..LONG / STEP {
                let _ = closed.run_for(STEP, server.run(&mut unit));
                line.pass(STEP);
            }
            assert_eq!(line.take(), request);
        }
    }
}

#[test]
fn a_request_that_ends_with_the_stream_is_answered() {
    let line = Line::default();
    let mut server = stream(&line, Framing::Tcp);
    let mut unit = registers();
    let request = write(Framing::Tcp, 1);
    line.arrive_in_blocks(0, 100, &[&request[..], &request].concat());
    line.state().is_closed = true;
    let lost = line.run_for(LONG, server.run(&mut unit));
    assert_eq!(lost, Some(Error::LinkLost));
    assert_eq!(line.take(), [&request[..], &request].concat());
}

#[test]
fn a_reconnected_server_forgets_what_the_old_connection_sent() {
    for framing in [Framing::Tcp, Framing::RtuOverTcp] {
        let line = Line::default();
        let mut server = stream(&line, framing);
        let mut unit = registers();
        // The beginning of a request, and what is no request.
        for bytes in [&write(framing, 1)[..7], &[0xFF; 40]] {
            line.arrive_in_blocks(0, bytes.len(), bytes);
            let _ = line.run_for(10_000, server.run(&mut unit));
            server.reconnect();
            let request = write(framing, 2);
            line.arrive(0, &request);
            assert_eq!(line.run_for(LONG, server.run(&mut unit)), None);
            assert_eq!(line.take(), request, "{framing:?}");
        }
        // A response that was sent in part.
        line.arrive(0, &write(framing, 1));
        line.state().space = 2;
        line.state().per_write = 2;
        let begun = line.state().now;
        while line.state().received.is_empty() {
            assert_eq!(line.run_for(100, server.run(&mut unit)), None);
            assert!(line.state().now.wrapping_sub(begun) < LONG);
        }
        line.pass(1_000);
        assert!(line.take().len() < write(framing, 1).len());
        server.reconnect();
        let request = write(framing, 2);
        line.arrive(0, &request);
        assert_eq!(line.run_for(LONG, server.run(&mut unit)), None);
        assert_eq!(line.take(), request, "{framing:?}");
    }
}

#[test]
fn bytes_that_are_not_modbus_tcp_end_the_connection() {
    let line = Line::default();
    let mut server = stream(&line, Framing::Tcp);
    line.arrive(0, b"GET / HTTP/1.1\r\n\r\n");
    let lost = line.run_for(LONG, server.run(&mut registers()));
    assert_eq!(lost, Some(Error::MalformedFrame));
    assert_eq!(line.take(), []);
}

#[test]
fn silence_ends_a_frame_of_unknown_length() {
    struct Custom;
    impl Device for Custom {
        fn custom(&mut self, _: u8, data: &[u8], response: &mut [u8]) -> Result<usize, Exception> {
            response[..data.len()].copy_from_slice(data);
            Ok(data.len())
        }
    }
    in_each_framing!(framing, line, server, {
        let mut unit = Unit::new(UNIT, Custom);
        let request = adu(framing, &[UNIT, 0x42, 1, 2, 3, 4, 5]);
        line.arrive(0, &request);
        assert_eq!(line.run_for(700_000, server.run(&mut unit)), None);
        assert_eq!(line.take(), request, "{framing:?}");
    });
}

#[test]
fn frames_that_may_not_be_answered_are_not_answered() {
    /// Answers every frame.
    struct Eager;
    impl AsyncUnits for Eager {
        async fn answer(&mut self, info: &Indication, _: &mut [u8]) -> Reply {
            Reply::length(info.length.into())
        }
    }
    for framing in [Framing::Rtu, Framing::Ascii] {
        for frame in [
            // Broadcasts of a write and of a read.
            &[0, 6, 0, 107, 0, 1][..],
            &[0, 3, 0, 107, 0, 1],
            // Exception responses, one of them with a code that no function has.
            &[UNIT, 0x83, 2],
            &[UNIT, 0xFF, 1],
            // A damaged frame.
            &[UNIT],
        ] {
            for is_eager in [false, true] {
                let line = Line::default();
                let mut server = server(&line, framing);
                line.arrive(0, &adu(framing, frame));
                let lost = match is_eager {
                    true => line.run_for(LONG, server.run(&mut Eager)),
                    false => line.run_for(LONG, server.run(&mut registers())),
                };
                assert_eq!(lost, None);
                assert_eq!(line.take(), [], "{framing:?}, {frame:02X?}");
                assert_eq!(line.state().switched, 0);
            }
        }
    }
}

#[test]
fn an_echo_is_not_answered() {
    for framing in [Framing::Rtu, Framing::Ascii] {
        let line = Line::default();
        line.state().has_echo = true;
        let mut server = server(&line, framing);
        let mut unit = registers();
        for value in 0..4 {
            let request = write(framing, value);
            line.arrive(0, &request);
            assert_eq!(line.run_for(2 * LONG, server.run(&mut unit)), None);
            assert_eq!(line.take(), request, "{framing:?}");
        }
    }
}

#[test]
fn a_broadcast_is_carried_out() {
    for framing in [Framing::Rtu, Framing::Ascii] {
        let line = Line::default();
        let mut server = server(&line, framing);
        let mut unit = registers();
        line.arrive(0, &adu(framing, &[0, 6, 0, 107, 0, 1]));
        assert_eq!(line.run_for(LONG, server.run(&mut unit)), None);
        assert_eq!(unit.device.holding_registers.cells[0], 1);
    }
}

#[test]
fn a_step_is_one_request() {
    in_each_framing!(framing, line, server, {
        let mut unit = registers();
        let request = write(framing, 5);
        line.arrive(0, &request);
        assert_eq!(line.run_for(LONG, server.serve(&mut unit)), Some(Ok(())));
        assert_eq!(line.take(), request, "{framing:?}");
        assert_eq!(line.run_for(LONG, server.serve(&mut unit)), None);
    });
}

/// Runs a server until its driver is off again, and returns the time since the last byte.
/// Runs the server until the client has received so many bytes of a response.
#[test]
fn a_uart_that_takes_no_byte_costs_one_response() {
    let line = Line::default();
    line.state().space = 0;
    let mut server = server(&line, Framing::Rtu);
    let mut unit = registers();
    line.arrive(0, &write(Framing::Rtu, 5));
    let result = line.run_for(5_000_000, server.serve(&mut unit));
    assert_eq!(result, Some(Ok(())));
    assert!(!line.state().driver);
    line.state().space = 100;
    let request = write(Framing::Rtu, 6);
    line.arrive(0, &request);
    assert_eq!(line.run_for(LONG, server.run(&mut unit)), None);
    assert_eq!(line.take(), request);
}

#[test]
fn a_connection_that_takes_no_byte_is_lost() {
    for framing in [Framing::Tcp, Framing::RtuOverTcp] {
        let line = Line::default();
        line.state().space = 0;
        let mut server = stream(&line, framing);
        line.arrive(0, &write(framing, 5));
        let lost = line.run_for(20_000_000, server.run(&mut registers()));
        assert_eq!(lost, Some(Error::LinkLost));
    }
}

#[test]
fn a_write_that_fails_is_a_lost_link_and_a_serial_line_is_tried_again() {
    in_each_framing!(framing, line, server, {
        line.state().write_fails = true;
        let mut unit = registers();
        let request = write(framing, 5);
        line.arrive(0, &request);
        let lost = line.run_for(LONG, server.run(&mut unit));
        assert_eq!(lost, Some(Error::LinkLost));
        if framing.is_serial() {
            assert!(!line.state().driver);
            line.state().write_fails = false;
            line.arrive(20_000, &request);
            assert_eq!(line.run_for(LONG, server.run(&mut unit)), None);
            assert_eq!(line.take(), request, "{framing:?}");
        }
    });
}

/// Unit 17 with an input register whose value takes a millisecond.
struct Slow {
    line: Line,
    measured: u32,
}

impl AsyncUnits for Slow {
    async fn answer(&mut self, info: &Indication, pdu: &mut [u8]) -> Reply {
        let request = Request::parse(&pdu[..info.length.into()]);
        let Ok(Request::ReadRegisters {
            function: 4,
            address,
            quantity: 1,
        }) = request
        else {
            return Reply::ILLEGAL_FUNCTION;
        };
        embedded_hal_async::delay::DelayNs::delay_ms(&mut Delay(self.line.clone()), 1).await;
        self.measured += 1;
        let data = &address.to_be_bytes();
        let response = Response::ReadRegisters { function: 4, data };
        response
            .emit(pdu)
            .map_or(Reply::SERVER_DEVICE_FAILURE, Reply::length)
    }

    fn contains(&self, unit: u8) -> bool {
        unit == UNIT
    }
}

#[test]
fn units_may_await_and_a_request_whose_future_is_dropped_meanwhile_is_served_again() {
    in_each_framing!(framing, line, server, {
        let mut units = Slow {
            line: line.clone(),
            measured: 0,
        };
        line.arrive(0, &adu(framing, &[UNIT, 4, 0, 9, 0, 1]));
        // The futures that end before the measurement.
        for _ in 0..100 {
            assert_eq!(line.run_for(500, server.run(&mut units)), None);
        }
        assert_eq!(units.measured, 0);
        assert_eq!(line.run_for(LONG, server.run(&mut units)), None);
        assert_eq!(units.measured, 1);
        assert_eq!(
            line.take(),
            adu(framing, &[UNIT, 4, 2, 0, 9]),
            "{framing:?}"
        );
    });
}

/// Answers at the third call.
struct Unfinished(u32);

impl Units for Unfinished {
    fn serve(&mut self, info: &Indication, _: &mut [u8]) -> Reply {
        self.0 += 1;
        match self.0 {
            3 => Reply::length(info.length.into()),
            _ => Reply::PENDING,
        }
    }
}

#[test]
fn units_that_are_not_finished_are_called_again() {
    in_each_framing!(framing, line, server, {
        let request = write(framing, 1);
        line.arrive(0, &request);
        let mut units = Unfinished(0);
        assert_eq!(line.run_for(LONG, server.run(&mut units)), None);
        assert_eq!((line.take(), units.0), (request, 3), "{framing:?}");
    });
}

#[test]
fn the_rest_of_a_request_is_awaited_only_for_units_of_the_server() {
    // A UART that hands over what it has after 16 bytes, or late.
    let line = Line::default();
    let mut server = server(&line, Framing::Rtu);
    let mut unit = registers();
    let foreign = sealed(&[UNIT + 1, 3, 4, 1, 2, 3, 4]);
    line.arrive(0, &foreign[..5]);
    line.arrive(2 * SILENCE, &write(Framing::Rtu, 3));
    assert_eq!(line.run_for(LONG, server.run(&mut unit)), None);
    assert_eq!(line.take(), write(Framing::Rtu, 3));
    let request = write(Framing::Rtu, 4);
    line.arrive(0, &request[..5]);
    line.arrive(2 * SILENCE, &request[5..]);
    assert_eq!(line.run_for(LONG, server.run(&mut unit)), None);
    assert_eq!(line.take(), request);
}

#[test]
fn a_server_without_a_request_sleeps() {
    in_each_framing!(framing, line, server, {
        let mut unit = registers();
        let mut run = pin!(server.run(&mut unit));
        // The future is not polled again before a byte arrives, and is right all the same.
        assert!(poll(run.as_mut()).is_pending());
        line.pass(3_600_000_000);
        let request = write(framing, 1);
        line.arrive(0, &request);
        assert_eq!(line.run_for(LONG, run), None);
        assert_eq!(line.take(), request, "{framing:?}");
    });
}

/// Fails to compile unless the future is `Send`.
fn sent<T: Send>(future: T) -> T {
    future
}

#[test]
fn the_future_of_a_server_whose_parts_are_send_is_send() {
    let line = Line::default();
    let mut server = server(&line, Framing::Rtu);
    let mut unit = registers();
    drop(sent(server.run(&mut unit)));
    drop(sent(server.serve(&mut unit)));
    let units: &mut [_] = &mut [registers(), registers()];
    drop(sent(server.run(units)));
    let mut slow = Slow {
        line: line.clone(),
        measured: 0,
    };
    drop(sent(server.run(&mut slow)));
    // As a task has it.
    drop(sent(async move {
        let mut unit = registers();
        let _ = server.run(&mut unit).await;
        pending::<()>().await
    }));
    /// The units that any program has.
    fn of_any<U: Units + Send>(
        mut server: Server,
        mut units: U,
    ) -> impl Future<Output = Error> + Send {
        sent(async move { server.run(&mut units).await })
    }
    drop(of_any(stream(&line, Framing::Tcp), registers()));
    #[cfg(feature = "std")]
    drop(of_any(
        stream(&line, Framing::Tcp),
        Arc::new(Mutex::new(registers())),
    ));
}

#[cfg(feature = "std")]
#[test]
fn servers_of_several_connections_share_units() {
    let unit = Arc::new(Mutex::new(registers()));
    let lines = [Line::default(), Line::default()];
    let mut servers = lines.clone().map(|line| stream(&line, Framing::Tcp));
    let mut units = [unit.clone(), unit.clone()];
    let [one, other] = &mut servers;
    let [first, second] = &mut units;
    let (mut one, mut other) = (pin!(one.run(first)), pin!(other.run(second)));
    lines[0].arrive(0, &write(Framing::Tcp, 77));
    lines[1].arrive(LONG / 2, &adu(Framing::Tcp, &[UNIT, 3, 0, 107, 0, 1]));
    for _ in 0..LONG / STEP {
        assert_eq!(
            (poll(one.as_mut()), poll(other.as_mut())),
            (Poll::Pending, Poll::Pending)
        );
        lines.iter().for_each(|line| line.pass(STEP));
    }
    assert_eq!(lines[0].take(), write(Framing::Tcp, 77));
    assert_eq!(lines[1].take(), adu(Framing::Tcp, &[UNIT, 3, 2, 0, 77]));
    assert_eq!(unit.lock().unwrap().device.holding_registers.cells[0], 77);
}
