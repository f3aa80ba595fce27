//! The master with futures, on a simulated line with a device.
#![cfg(feature = "embedded-io-async")]

mod common;

use common::uart::{Bench, Wire, CHARACTER};
use embedded_hal_async::delay::DelayNs;
use embedded_io_async::{ErrorKind, ErrorType, Read, Write};
use mbm::engine::{Buffers, Counter, MicrosSetting};
use mbm::error::Error;
use mbm::master::AsyncMaster;
use std::cell::RefCell;
use std::future::{poll_fn, Future};
use std::pin::{pin, Pin};
use std::rc::Rc;
use std::task::{Context, Poll, Waker};

/// Polls a future once.
fn poll<F: Future>(future: Pin<&mut F>) -> Poll<F::Output> {
    future.poll(&mut Context::from_waker(Waker::noop()))
}

/// Returns `value` as soon as there is one.
async fn until<T>(mut value: impl FnMut() -> Option<T>) -> T {
    poll_fn(|_| match value() {
        Some(value) => Poll::Ready(value),
        None => Poll::Pending,
    })
    .await
}

#[derive(Clone)]
struct Uart(Rc<RefCell<Wire>>);

impl ErrorType for Uart {
    type Error = ErrorKind;
}

impl Read for Uart {
    async fn read(&mut self, bytes: &mut [u8]) -> Result<usize, ErrorKind> {
        assert!(!bytes.is_empty());
        until(|| {
            let wire = &mut *self.0.borrow_mut();
            if std::mem::take(&mut wire.read_fails) {
                return Some(Err(ErrorKind::Other));
            }
            (wire.is_closed || wire.has_arrived()).then(|| Ok(wire.receive(bytes)))
        })
        .await
    }
}

impl Write for Uart {
    async fn write(&mut self, bytes: &[u8]) -> Result<usize, ErrorKind> {
        until(|| {
            let wire = &mut *self.0.borrow_mut();
            if wire.write_fails {
                return Some(Err(ErrorKind::BrokenPipe));
            }
            (wire.accepts > 0).then(|| Ok(wire.send(bytes)))
        })
        .await
    }

    async fn flush(&mut self) -> Result<(), ErrorKind> {
        until(|| {
            let wire = self.0.borrow();
            (wire.is_flushed() || wire.flushes_early).then_some(Ok(()))
        })
        .await
    }
}

struct Delay(Rc<RefCell<Wire>>);

impl DelayNs for Delay {
    async fn delay_ns(&mut self, nanoseconds: u32) {
        let end = self.0.borrow().now + nanoseconds.div_ceil(1000);
        until(|| (self.0.borrow().now >= end).then_some(())).await
    }
}

type Words = Buffers<[u8; 256], [u16; 125], [u16; 123]>;

/// A master of unit 17.
fn master(
    bench: &Bench,
) -> AsyncMaster<Uart, impl FnMut() -> u32 + use<>, Delay, Words, impl FnMut(bool) + use<>> {
    let wire = bench.wire.clone();
    let clock = move || wire.borrow().now;
    let wire = bench.wire.clone();
    let driver = move |on| wire.borrow_mut().driver = on;
    let (uart, delay) = (Uart(bench.wire.clone()), Delay(bench.wire.clone()));
    let buffers = Buffers::new([0; 256], [0; 125], [0; 123]);
    let mut master = AsyncMaster::with_driver(17, uart, clock, delay, buffers, driver);
    master.settings().set_baud_rate(115_200);
    master.settings().response_timeout = MicrosSetting::new(100_000);
    master
}

impl Bench {
    /// Runs a future to its end.
    fn run<F: Future>(&mut self, future: F) -> F::Output {
        let mut future = pin!(future);
        for _ in 0..1_000_000 {
            if let Poll::Ready(output) = poll(future.as_mut()) {
                return output;
            }
            self.pass();
        }
        panic!("the future does not end");
    }

    /// Polls a future until the condition is true, and drops it.
    fn drop_when<F: Future>(&mut self, future: F, condition: impl Fn(&Wire) -> bool) {
        let mut future = pin!(future);
        while !condition(&self.wire.borrow()) {
            assert!(poll(future.as_mut()).is_pending());
            self.pass();
        }
    }
}

#[test]
fn all_ten_functions_are_answered() {
    let mut bench = Bench::new();
    let mut master = master(&bench);
    let mut coils = [false; 11];
    assert_eq!(bench.run(master.read_coils(100, &mut coils)), Ok(()));
    let expected: Vec<bool> = (0..11).map(|bit| 0b10_0100_1001 >> bit & 1 != 0).collect();
    assert_eq!(coils[..], expected);
    let mut inputs = [false; 4];
    let read = master.read_discrete_inputs(116, &mut inputs);
    assert_eq!(bench.run(read), Ok(()));
    assert_eq!(inputs, [true, true, false, true]);
    let mut words = [0; 2];
    let read = master.read_holding_registers(108, &mut words);
    assert_eq!(bench.run(read), Ok(()));
    assert_eq!(words, [0x1008, 0x1009]);
    assert_eq!(
        bench.run(master.read_input_registers(100, &mut words)),
        Ok(())
    );
    assert_eq!(words, [0x2000, 0x2001]);
    assert_eq!(bench.run(master.write_single_coil(101, true)), Ok(()));
    assert_eq!(bench.device.coils[0], 0b0100_1011);
    assert_eq!(bench.run(master.write_single_register(100, 7)), Ok(()));
    assert_eq!(bench.device.holding[0], 7);
    let write = [false, true, true, false, true, true, true, true, true];
    assert_eq!(bench.run(master.write_multiple_coils(100, &write)), Ok(()));
    assert_eq!(bench.device.coils[..2], [0b1111_0110, 0b1001_0011]);
    let write = master.write_multiple_registers(101, &[8, 9]);
    assert_eq!(bench.run(write), Ok(()));
    assert_eq!(bench.device.holding[..3], [7, 8, 9]);
    let write = master.mask_write_register(103, 0xFF00, 0x0055);
    assert_eq!(bench.run(write), Ok(()));
    assert_eq!(bench.device.holding[3], 0x1055);
    let both = master.read_write_multiple_registers((103, &mut words), (104, &[0xABCD]));
    assert_eq!(bench.run(both), Ok(()));
    assert_eq!(words, [0x1055, 0xABCD]);
    assert!(!bench.wire.borrow().is_cut_off);
}

#[test]
fn a_read_as_long_as_a_frame_is_answered() {
    let mut bench = Bench::new();
    let mut master = master(&bench);
    master.set_unit(18);
    bench.device.id = 18;
    // The device has ten registers; the longest reply comes from elsewhere.
    bench.wire.borrow_mut().is_cut = true;
    let mut reply = vec![18, 3, 250];
    reply.extend((0..250).map(|byte| byte as u8));
    let reply = common::frame::sealed(&reply);
    let mut words = [0; 125];
    let wire = bench.wire.clone();
    let answer = async {
        let is_sent = || wire.borrow().sent.len() == 8 && wire.borrow().is_flushed();
        until(|| is_sent().then_some(())).await;
        wire.borrow_mut().arrive(&reply);
    };
    let read = master.read_holding_registers(0, &mut words);
    let result = bench.run(async {
        let (mut read, mut answer) = (pin!(read), pin!(answer));
        let mut is_answered = false;
        poll_fn(|_| {
            is_answered = is_answered || poll(answer.as_mut()).is_ready();
            poll(read.as_mut())
        })
        .await
    });
    assert_eq!(result, Ok(()));
    assert_eq!((words[0], words[124]), (0x0001, 0xF8F9));
}

#[test]
fn an_exception_is_the_error() {
    let mut bench = Bench::new();
    let mut master = master(&bench);
    let mut words = [1; 2];
    let result = bench.run(master.read_holding_registers(109, &mut words));
    assert_eq!(result, Err(Error::IllegalDataAddress));
    assert_eq!(master.exception_code(), 2);
    assert_eq!(words, [1; 2]);
}

#[test]
fn a_device_that_receives_nothing_times_out_and_is_asked_again() {
    let mut bench = Bench::new();
    let mut master = master(&bench);
    bench.wire.borrow_mut().is_cut = true;
    master.settings().retries = 2;
    let begun = bench.wire.borrow().now;
    let result = bench.run(master.write_single_register(100, 1));
    assert_eq!(result, Err(Error::ResponseTimedOut));
    let passed = bench.wire.borrow().now - begun;
    assert!((300_000..800_000).contains(&passed), "{passed}");
    assert_eq!(master.storage().counters[Counter::Requests as usize], 3);
    bench.wire.borrow_mut().is_cut = false;
    assert_eq!(bench.run(master.write_single_register(100, 1)), Ok(()));
}

#[test]
fn the_driver_goes_off_when_the_hold_is_over() {
    let mut bench = Bench::new();
    let mut master = master(&bench);
    master.settings().post_flush_characters = 7;
    let mut words = [0];
    let (mut sent, mut off) = (0, 0);
    let mut read = pin!(master.read_holding_registers(100, &mut words));
    while poll(read.as_mut()).is_pending() {
        let wire = bench.wire.borrow();
        if wire.driver && wire.is_flushed() && !wire.sent.is_empty() && sent == 0 {
            sent = wire.now;
        }
        if sent > 0 && !wire.driver && off == 0 {
            off = wire.now;
        }
        drop(wire);
        bench.pass();
    }
    // Time passes in steps of 50.
    let hold = 7 * CHARACTER;
    assert!(
        (hold..=hold + 100).contains(&(off - sent)),
        "{}",
        off - sent
    );
}

#[test]
fn a_broadcast_needs_no_reply() {
    let mut bench = Bench::new();
    let mut master = master(&bench);
    master.set_unit(0);
    assert_eq!(bench.run(master.write_single_register(100, 3)), Ok(()));
    assert_eq!(bench.device.holding[0], 3);
    let result = bench.run(master.read_coils(100, &mut [false]));
    assert_eq!(result, Err(Error::BroadcastNotAllowed));
}

#[test]
fn a_request_that_the_standard_or_the_buffers_do_not_allow_is_refused() {
    let mut bench = Bench::new();
    let mut master = master(&bench);
    let refused = bench.run(master.read_holding_registers(0, &mut []));
    assert_eq!(refused, Err(Error::InvalidQuantity));
    let refused = bench.run(master.read_holding_registers(0, &mut [0; 126]));
    assert_eq!(refused, Err(Error::InvalidQuantity));
    let refused = bench.run(master.write_multiple_registers(0, &[0; 70_000]));
    assert_eq!(refused, Err(Error::InvalidQuantity));
    let refused = bench.run(master.read_input_registers(0xFFFF, &mut [0; 2]));
    assert_eq!(refused, Err(Error::InvalidAddress));
    assert!(bench.wire.borrow().sent.is_empty());
}

#[test]
fn a_uart_may_take_a_frame_in_pieces() {
    let mut bench = Bench::new();
    bench.wire.borrow_mut().accepts = 3;
    let mut master = master(&bench);
    let write = master.write_multiple_registers(100, &[1, 2, 3]);
    assert_eq!(bench.run(write), Ok(()));
}

#[test]
fn a_uart_that_takes_no_byte_ends_the_request_as_a_busy_line() {
    let mut bench = Bench::new();
    bench.wire.borrow_mut().accepts = 0;
    let mut master = master(&bench);
    let result = bench.run(master.write_single_register(100, 1));
    assert_eq!(result, Err(Error::LineBusy));
    assert!(!bench.wire.borrow().driver);
    bench.wire.borrow_mut().accepts = 8;
    assert_eq!(bench.run(master.write_single_register(100, 1)), Ok(()));
}

#[test]
fn a_write_that_fails_is_a_lost_link_and_the_next_request_tries_again() {
    let mut bench = Bench::new();
    bench.wire.borrow_mut().write_fails = true;
    let mut master = master(&bench);
    let result = bench.run(master.write_single_register(100, 1));
    assert_eq!(result, Err(Error::LinkLost));
    bench.wire.borrow_mut().write_fails = false;
    assert_eq!(bench.run(master.write_single_register(100, 1)), Ok(()));
}

#[test]
fn the_end_of_what_can_be_read_is_a_lost_link() {
    let mut bench = Bench::new();
    bench.wire.borrow_mut().is_closed = true;
    let mut master = master(&bench);
    let result = bench.run(master.write_single_register(100, 1));
    assert_eq!(result, Err(Error::LinkLost));
}

#[test]
fn a_damaged_character_is_not_a_lost_link() {
    let mut bench = Bench::new();
    bench.wire.borrow_mut().read_fails = true;
    let mut master = master(&bench);
    assert_eq!(bench.run(master.write_single_register(100, 1)), Ok(()));
}

#[test]
fn a_uart_whose_reads_always_fail_does_not_keep_other_tasks_from_running() {
    let mut bench = Bench::new();
    let mut master = master(&bench);
    let mut write = pin!(master.write_single_register(100, 1));
    let result = loop {
        bench.wire.borrow_mut().read_fails = true;
        if let Poll::Ready(result) = poll(write.as_mut()) {
            break result;
        }
        // All of the reply is lost.
        bench.wire.borrow_mut().receive(&mut [0; 256]);
        bench.pass();
    };
    assert_eq!(result, Err(Error::ResponseTimedOut));
}

#[test]
fn a_request_that_is_dropped_while_it_waits_for_silence_is_not_sent() {
    let mut bench = Bench::new();
    let mut master = master(&bench);
    let _ = bench.run(master.write_single_register(100, 1));
    let sent = bench.wire.borrow().sent.len();
    let now = bench.wire.borrow().now;
    bench.drop_when(master.write_single_register(100, 2), |wire| {
        wire.now >= now + 100
    });
    assert_eq!(bench.wire.borrow().sent.len(), sent);
    assert_eq!(bench.run(master.write_single_register(100, 3)), Ok(()));
    assert_eq!(bench.device.holding[0], 3);
}

#[test]
fn a_request_that_is_dropped_while_it_is_sent_switches_the_driver_off() {
    let mut bench = Bench::new();
    let mut master = master(&bench);
    bench.wire.borrow_mut().accepts = 2;
    bench.drop_when(master.write_single_register(100, 2), |wire| {
        wire.sent.len() >= 4 && !wire.is_flushed()
    });
    assert!(!bench.wire.borrow().driver);
    bench.wire.borrow_mut().accepts = 256;
    assert_eq!(bench.run(master.write_single_register(100, 3)), Ok(()));
    assert_eq!(bench.device.holding[0], 3);
}

#[test]
fn a_frame_that_the_uart_still_sends_when_its_future_is_dropped_is_not_run_into_by_the_next_one() {
    let mut bench = Bench::new();
    let mut master = master(&bench);
    // At a low rate, a frame takes longer than the quiet time.
    master.settings().quiet_time = MicrosSetting::new(1_000);
    master.set_unit(18);
    let write = master.write_multiple_registers(100, &[2; 100]);
    bench.drop_when(write, |wire| wire.sent.len() == 209);
    master.set_unit(17);
    let mut write = pin!(master.write_single_register(100, 3));
    while !bench.wire.borrow().is_flushed() {
        assert!(poll(write.as_mut()).is_pending());
        assert_eq!(bench.wire.borrow().sent.len(), 209);
        bench.pass();
    }
    assert_eq!(bench.run(write), Ok(()));
    assert_eq!(bench.device.holding[0], 3);
}

#[test]
fn a_late_reply_to_a_dropped_request_is_not_taken_for_the_next_one() {
    let mut bench = Bench::new();
    let mut master = master(&bench);
    let mut words = [0];
    bench.drop_when(master.read_holding_registers(100, &mut words), |wire| {
        wire.sent.len() == 8 && wire.is_flushed()
    });
    // The device has received the first request and answers it now.
    assert_eq!(
        bench.run(master.read_holding_registers(105, &mut words)),
        Ok(())
    );
    assert_eq!(words, [0x1005]);
}

/// Polls a future until it ends or the time has passed, as a program with a timeout does.
fn run_for<F: Future>(bench: &mut Bench, future: F, limit: u32) -> Option<F::Output> {
    let end = bench.wire.borrow().now + limit;
    let mut future = pin!(future);
    while bench.wire.borrow().now < end {
        if let Poll::Ready(output) = poll(future.as_mut()) {
            return Some(output);
        }
        bench.pass();
    }
    None
}

#[test]
fn a_device_that_has_lost_a_reply_is_heard_again_by_futures_under_a_timeout() {
    const TIMEOUT: u32 = 100_000; // the response timeout of `master`
    for limit in [20_000, 40_000, 80_000, 150_000, 500_000] {
        for pause in [0, 50_000, 60_000_000] {
            let mut bench = Bench::new();
            let mut master = master(&bench);
            let mut words = [0];
            let mut read = |bench: &mut Bench, address: u16| {
                let read = master.read_holding_registers(address, &mut words);
                let result = run_for(bench, read, limit);
                bench.wire.borrow_mut().now += pause;
                let is_read = result == Some(Ok(()));
                assert!(!is_read || words == [0x1000 + address - 100]);
                is_read
            };
            assert!((0..10).all(|at| read(&mut bench, 100 + at)));
            bench.wire.borrow_mut().is_cut = true;
            assert!(!read(&mut bench, 100));
            bench.wire.borrow_mut().is_cut = false;
            let well = bench.wire.borrow().now;
            loop {
                let begun = bench.wire.borrow().now;
                if read(&mut bench, 105) {
                    break;
                }
                assert!(begun - well < 5 * TIMEOUT, "limit {limit}, pause {pause}");
            }
            assert!((0..50).all(|at| read(&mut bench, 100 + at % 10)));
        }
    }
}

#[test]
fn a_future_that_waits_for_its_unit_is_not_sent_when_it_is_dropped() {
    let mut bench = Bench::new();
    let mut master = master(&bench);
    let mut words = [0];
    bench.wire.borrow_mut().is_cut = true;
    let read = master.read_holding_registers(100, &mut words);
    assert!(run_for(&mut bench, read, 20_000).is_none());
    bench.wire.borrow_mut().is_cut = false;
    let sent = bench.wire.borrow().sent.len();
    let end = bench.wire.borrow().now + 250_000;
    while bench.wire.borrow().now < end {
        let read = master.read_holding_registers(100, &mut words);
        assert!(run_for(&mut bench, read, 20_000).is_none());
    }
    assert_eq!(bench.wire.borrow().sent.len(), sent);
    let read = master.read_holding_registers(103, &mut words);
    assert_eq!(bench.run(read), Ok(()));
    assert_eq!(words, [0x1003]);
    // Another unit need not wait.
    bench.wire.borrow_mut().is_cut = true;
    master.set_unit(18);
    let read = master.read_holding_registers(100, &mut words);
    assert!(run_for(&mut bench, read, 20_000).is_none());
    bench.wire.borrow_mut().is_cut = false;
    master.set_unit(17);
    let read = master.read_holding_registers(104, &mut words);
    assert_eq!(run_for(&mut bench, read, 120_000), Some(Ok(())));
}

#[test]
fn a_request_that_is_dropped_at_any_time_leaves_the_master_usable() {
    let mut bench = Bench::new();
    let mut master = master(&bench);
    for polls in 0..400 {
        {
            let mut words = [0; 10];
            let mut read = pin!(master.read_holding_registers(100, &mut words));
            for _ in 0..polls {
                if poll(read.as_mut()).is_ready() {
                    break;
                }
                bench.pass();
            }
        }
        assert!(!bench.wire.borrow().driver, "{polls}");
        let value = 0x4000 + polls;
        let result = bench.run(master.write_single_register(107, value));
        assert_eq!(result, Ok(()), "{polls}");
        assert_eq!(bench.device.holding[7], value);
    }
}

#[test]
fn a_reply_that_arrived_before_the_request_is_not_taken_for_its_reply() {
    let mut bench = Bench::new();
    let mut master = master(&bench);
    let mut words = [0];
    let read = master.read_holding_registers(100, &mut words);
    assert_eq!(bench.run(read), Ok(()));
    // The device sends its reply twice. The UART keeps the second one for a long time.
    let again = common::frame::sealed(&[17, 3, 2, 0x10, 0x00]);
    bench.wire.borrow_mut().arrive(&again);
    bench.wire.borrow_mut().now += 10_000_000;
    let read = master.read_holding_registers(105, &mut words);
    assert_eq!(bench.run(read), Ok(()));
    assert_eq!(words, [0x1005]);
}

#[test]
fn many_bytes_that_arrived_before_the_request_are_skipped() {
    let mut bench = Bench::new();
    let mut master = master(&bench);
    let mut bytes = vec![0x55; 300];
    bytes.extend(common::frame::sealed(&[17, 3, 2, 0x12, 0x34]));
    bench.wire.borrow_mut().arrive(&bytes);
    bench.wire.borrow_mut().read_fails = true;
    bench.wire.borrow_mut().now += 10_000_000;
    let mut words = [0];
    let read = master.read_holding_registers(105, &mut words);
    assert_eq!(bench.run(read), Ok(()));
    assert_eq!(words, [0x1005]);
}

#[test]
fn a_future_that_is_forgotten_leaves_the_master_usable() {
    let mut bench = Bench::new();
    let mut master = master(&bench);
    let mut words = [0; 2];
    let mut read = Box::pin(master.read_holding_registers(100, &mut words));
    assert!(poll(read.as_mut()).is_pending());
    std::mem::forget(read);
    let write = master.write_single_register(100, 1);
    assert_eq!(bench.run(write), Ok(()));
}

/// A UART that is at its end: it writes nothing, or fails to flush.
struct Ended {
    uart: Uart,
    writes: bool,
}

impl ErrorType for Ended {
    type Error = ErrorKind;
}

impl Read for Ended {
    async fn read(&mut self, bytes: &mut [u8]) -> Result<usize, ErrorKind> {
        self.uart.read(bytes).await
    }
}

impl Write for Ended {
    async fn write(&mut self, bytes: &[u8]) -> Result<usize, ErrorKind> {
        Ok(if self.writes { bytes.len() } else { 0 })
    }

    async fn flush(&mut self) -> Result<(), ErrorKind> {
        Err(ErrorKind::BrokenPipe)
    }
}

#[test]
fn a_write_of_no_byte_and_a_flush_that_fails_are_a_lost_link() {
    for writes in [false, true] {
        let mut bench = Bench::new();
        let wire = bench.wire.clone();
        let clock = move || wire.borrow().now;
        let uart = Uart(bench.wire.clone());
        let delay = Delay(bench.wire.clone());
        let buffers = Buffers::new([0; 64], [0; 2], [0; 2]);
        let mut master = AsyncMaster::new(17, Ended { uart, writes }, clock, delay, buffers);
        let write = master.write_single_register(100, 1);
        assert_eq!(bench.run(write), Err(Error::LinkLost), "{writes}");
    }
}

#[test]
fn the_driver_is_on_until_the_last_byte_has_left_even_if_a_flush_ends_early() {
    let mut bench = Bench::new();
    bench.wire.borrow_mut().flushes_early = true;
    let mut master = master(&bench);
    let write = master.write_multiple_registers(100, &[7; 10]);
    assert_eq!(bench.run(write), Ok(()));
    let wire = bench.wire.borrow();
    assert!(!wire.is_cut_off && !wire.driver);
}
