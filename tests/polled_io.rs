//! The port that polls the futures of a device once, on a simulated line with a device.
#![cfg(feature = "embedded-io-async")]

mod common;

use common::uart::{check_sending_time, master, read, write, Bench, Wire};
use embedded_io_async::{ErrorKind, ErrorType, Read, Write};
use mbm::port::{PolledIo, Port};
use mbm::Error;
use std::cell::RefCell;
use std::future::poll_fn;
use std::rc::Rc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::Arc;
use std::task::{Poll, Wake, Waker};

/// A UART with buffers, whose futures wait. It keeps the waker of the last of them.
#[derive(Clone, Default)]
struct Uart {
    wire: Rc<RefCell<Wire>>,
    waker: Rc<RefCell<Option<Waker>>>,
    /// A flush ends although bytes have not left.
    flushes_early: bool,
    /// Every flush fails.
    flush_fails: Rc<RefCell<bool>>,
    /// How often it was flushed, or tried to be.
    flushes: Rc<RefCell<usize>>,
}

impl Uart {
    fn of(bench: &Bench) -> Uart {
        Uart {
            wire: bench.wire.clone(),
            ..Uart::default()
        }
    }

    /// Returns `value` as soon as there is one. Polled again after that, it would panic.
    async fn until<T>(&self, value: impl FnMut(&mut Wire) -> Option<T>) -> T {
        let mut value = Some(value);
        poll_fn(|context| {
            let mut now = value.take().expect("a future that has ended is polled");
            match now(&mut self.wire.borrow_mut()) {
                Some(result) => Poll::Ready(result),
                None => {
                    *self.waker.borrow_mut() = Some(context.waker().clone());
                    value = Some(now);
                    Poll::Pending
                }
            }
        })
        .await
    }
}

impl ErrorType for Uart {
    type Error = ErrorKind;
}

impl Read for Uart {
    async fn read(&mut self, bytes: &mut [u8]) -> Result<usize, ErrorKind> {
        assert!(!bytes.is_empty());
        self.until(|wire| {
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
        assert!(!bytes.is_empty());
        self.until(|wire| {
            if wire.write_fails {
                return Some(Err(ErrorKind::BrokenPipe));
            }
            (wire.is_closed || wire.accepts > 0).then(|| Ok(wire.send(bytes)))
        })
        .await
    }

    async fn flush(&mut self) -> Result<(), ErrorKind> {
        *self.flushes.borrow_mut() += 1;
        if *self.flush_fails.borrow() {
            return Err(ErrorKind::BrokenPipe);
        }
        let early = self.flushes_early;
        self.until(|wire| (early || wire.is_flushed()).then_some(Ok(())))
            .await
    }
}

fn clock(uart: &Uart) -> impl FnMut() -> u32 + use<> {
    let wire = uart.wire.clone();
    move || wire.borrow().now
}

fn driver(uart: &Uart) -> impl FnMut(bool) + use<> {
    let wire = uart.wire.clone();
    move |on| wire.borrow_mut().driver = on
}

fn serial(uart: Uart) -> PolledIo<Uart, impl FnMut() -> u32, impl FnMut(bool)> {
    let (clock, driver) = (clock(&uart), driver(&uart));
    PolledIo::serial(uart, clock).with_driver(driver, 115_200)
}

fn stream(uart: Uart) -> PolledIo<Uart, impl FnMut() -> u32, impl FnMut(bool)> {
    let (clock, driver) = (clock(&uart), driver(&uart));
    PolledIo::stream(uart, clock).with_driver(driver, 115_200)
}

/// Counts how often it is woken.
#[derive(Default)]
struct Woken(AtomicUsize);

impl Wake for Woken {
    fn wake(self: Arc<Self>) {
        self.0.fetch_add(1, Ordering::Relaxed);
    }
}

impl Woken {
    fn times(&self) -> usize {
        self.0.load(Ordering::Relaxed)
    }
}

#[test]
fn a_master_reads_registers_through_a_uart() {
    let mut bench = Bench::new();
    let port = serial(Uart::of(&bench));
    assert_eq!(read(&mut bench, port), Ok(vec![0x1002, 0x1003, 0x1004]));
    assert!(!bench.wire.borrow().driver);
}

#[test]
fn a_master_reads_registers_through_a_stream() {
    let mut bench = Bench::new();
    let port = stream(Uart::of(&bench));
    assert_eq!(read(&mut bench, port), Ok(vec![0x1002, 0x1003, 0x1004]));
}

#[test]
fn hundreds_of_requests_are_answered_though_every_future_is_dropped() {
    let mut bench = Bench::new();
    let mut master = master(serial(Uart::of(&bench)));
    for value in 0..400 {
        assert_eq!(master.start_write_single_register(101, value), Ok(()));
        assert_eq!(master.wait(|| bench.pass()), Ok(()), "{value}");
        assert_eq!(master.start_read_holding_registers(101, 1), Ok(()));
        assert_eq!(master.wait(|| bench.pass()), Ok(()), "{value}");
        assert_eq!(master.response(), [value]);
    }
}

#[test]
fn a_uart_may_take_a_frame_in_pieces() {
    for accepts in 1..8 {
        let mut bench = Bench::new();
        bench.wire.borrow_mut().accepts = accepts;
        let port = serial(Uart::of(&bench));
        assert!(read(&mut bench, port).is_ok(), "{accepts}");
    }
}

#[test]
fn the_driver_is_on_until_the_last_byte_has_left_even_if_a_flush_ends_early() {
    for (accepts, flushes_early) in [(1, false), (3, true), (256, false), (256, true)] {
        let mut bench = Bench::new();
        bench.wire.borrow_mut().accepts = accepts;
        let uart = Uart {
            flushes_early,
            ..Uart::of(&bench)
        };
        let after = write(&mut bench, serial(uart));
        assert!(!bench.wire.borrow().is_cut_off, "{accepts}");
        assert!((50..=250).contains(&after), "{accepts}: {after}");
    }
}

#[test]
fn a_serial_line_is_flushed_only_once_the_device_is() {
    let bench = Bench::new();
    let uart = Uart::of(&bench);
    let (clock, driver) = (clock(&uart), driver(&uart));
    // A rate at which the bytes should have left at once.
    let mut port = PolledIo::serial(uart.clone(), clock).with_driver(driver, u32::MAX);
    port.pre_transmission();
    assert_eq!(port.write(&[1, 2]), Ok(2));
    uart.wire.borrow_mut().now += 100;
    assert!(!port.flush());
    // The same without a rate: the device knows.
    let mut port = PolledIo::serial(uart.clone(), || 0);
    assert!(!port.flush());
    assert!(!port.knows_when_sent());
}

#[test]
fn a_stream_is_flushed_after_each_write_and_is_not_waited_for() {
    let mut bench = Bench::new();
    let uart = Uart::of(&bench);
    let flushes = uart.flushes.clone();
    let mut port = PolledIo::stream(uart, || 0);
    bench.wire.borrow_mut().driver = true;
    assert_eq!(port.write(&[1, 2]), Ok(2));
    assert_eq!(*flushes.borrow(), 1);
    assert!(port.flush() && port.knows_when_sent());
    // The bytes have not left, so each read tries again, until they have.
    assert_eq!(port.read(&mut [0; 8]), Ok(0));
    assert_eq!(*flushes.borrow(), 2);
    for _ in 0..4 {
        bench.pass();
    }
    assert_eq!(port.read(&mut [0; 8]), Ok(0));
    assert_eq!(port.read(&mut [0; 8]), Ok(0));
    assert_eq!(*flushes.borrow(), 3);
}

#[test]
fn nothing_is_read_or_written_without_bytes() {
    let bench = Bench::new();
    let mut port = serial(Uart::of(&bench));
    assert_eq!(port.read(&mut []), Ok(0));
    assert_eq!(port.write(&[]), Ok(0));
    let mut port = stream(Uart::of(&bench));
    assert_eq!(port.read(&mut []), Ok(0));
    assert_eq!(port.write(&[]), Ok(0));
}

#[test]
fn a_uart_that_is_full_accepts_no_byte() {
    let bench = Bench::new();
    bench.wire.borrow_mut().accepts = 0;
    assert_eq!(serial(Uart::of(&bench)).write(&[1, 2]), Ok(0));
    assert_eq!(stream(Uart::of(&bench)).write(&[1, 2]), Ok(0));
    assert!(bench.wire.borrow().sent.is_empty());
}

#[test]
fn a_uart_that_stays_full_ends_the_request_as_a_busy_line() {
    let mut bench = Bench::new();
    bench.wire.borrow_mut().accepts = 0;
    let port = serial(Uart::of(&bench));
    assert_eq!(read(&mut bench, port), Err(Error::LineBusy));
    assert!(!bench.wire.borrow().driver);
}

#[test]
fn a_damaged_character_of_a_serial_line_is_not_a_lost_link() {
    let mut bench = Bench::new();
    bench.wire.borrow_mut().read_fails = true;
    let mut port = serial(Uart::of(&bench));
    assert_eq!(port.read(&mut [0; 8]), Ok(0));
    bench.wire.borrow_mut().read_fails = true;
    assert!(read(&mut bench, port).is_ok());
}

#[test]
fn a_read_that_fails_wakes_the_task_since_the_device_does_not() {
    let bench = Bench::new();
    let (woken, uart) = (Arc::new(Woken::default()), Uart::of(&bench));
    let kept = uart.waker.clone();
    let mut port = serial(uart);
    port.set_waker(&woken.clone().into());
    bench.wire.borrow_mut().read_fails = true;
    assert_eq!(port.read(&mut [0; 8]), Ok(0));
    assert!(kept.borrow().is_none());
    assert_eq!(woken.times(), 1);
    assert_eq!(port.read(&mut [0; 8]), Ok(0));
    assert_eq!(woken.times(), 1);
}

#[test]
fn the_device_wakes_the_task_that_was_set_last() {
    let bench = Bench::new();
    let uart = Uart::of(&bench);
    let kept = uart.waker.clone();
    let mut port = serial(uart);
    for _ in 0..2 {
        let woken = Arc::new(Woken::default());
        port.set_waker(&woken.clone().into());
        assert_eq!(port.read(&mut [0; 8]), Ok(0));
        kept.borrow_mut().take().expect("the waker").wake();
        assert_eq!(woken.times(), 1);
        bench.wire.borrow_mut().accepts = 0;
        assert_eq!(port.write(&[1]), Ok(0));
        kept.borrow_mut().take().expect("the waker").wake();
        assert_eq!(woken.times(), 2);
    }
}

#[test]
fn an_error_of_a_stream_is_a_lost_link() {
    let mut bench = Bench::new();
    bench.wire.borrow_mut().read_fails = true;
    let port = stream(Uart::of(&bench));
    assert_eq!(read(&mut bench, port), Err(Error::LinkLost));
}

#[test]
fn the_end_of_a_stream_is_a_lost_link_after_its_last_bytes() {
    let mut bench = Bench::new();
    {
        let mut wire = bench.wire.borrow_mut();
        (wire.is_closed, wire.driver) = (true, true);
        wire.arrive(&[7]);
        wire.accepts = 0;
    }
    let mut port = stream(Uart::of(&bench));
    assert_eq!(port.read(&mut [0; 8]), Ok(1));
    assert_eq!(port.read(&mut [0; 8]), Err(Error::LinkLost));
    assert_eq!(port.write(&[1]), Err(Error::LinkLost));
    assert_eq!(read(&mut bench, port), Err(Error::LinkLost));
}

#[test]
fn a_write_that_fails_is_a_lost_link() {
    let mut bench = Bench::new();
    bench.wire.borrow_mut().write_fails = true;
    let port = serial(Uart::of(&bench));
    assert_eq!(read(&mut bench, port), Err(Error::LinkLost));
    let port = stream(Uart::of(&bench));
    assert_eq!(read(&mut bench, port), Err(Error::LinkLost));
}

#[test]
fn a_flush_that_fails_is_a_lost_link_once() {
    let mut bench = Bench::new();
    let uart = Uart::of(&bench);
    let fails = uart.flush_fails.clone();
    *fails.borrow_mut() = true;
    let port = stream(uart.clone());
    assert_eq!(read(&mut bench, port), Err(Error::LinkLost));
    let mut master = master(serial(uart));
    assert_eq!(master.start_read_holding_registers(102, 3), Ok(()));
    assert_eq!(master.wait(|| bench.pass()), Err(Error::LinkLost));
    *fails.borrow_mut() = false;
    for _ in 0..400 {
        bench.pass();
    }
    assert_eq!(master.start_read_holding_registers(102, 3), Ok(()));
    assert_eq!(master.wait(|| bench.pass()), Ok(()));
}

#[test]
fn the_clock_may_wrap_at_any_time_of_a_request() {
    for before in (0..6_000).step_by(50) {
        let mut bench = Bench::new();
        let wire = bench.wire.clone();
        let clock = move || wire.borrow().now.wrapping_sub(before);
        let uart = Uart::of(&bench);
        let driver = driver(&uart);
        let port = PolledIo::serial(uart, clock).with_driver(driver, 115_200);
        assert!(read(&mut bench, port).is_ok(), "{before}");
        let wire = bench.wire.borrow();
        assert!(!wire.driver && !wire.is_cut_off, "{before}");
    }
}

#[test]
fn the_time_of_a_frame_is_that_of_its_bits() {
    check_sending_time(|bench, baud, bits| {
        let mut uart = Uart::of(bench);
        uart.flushes_early = true;
        let (clock, driver) = (clock(&uart), driver(&uart));
        PolledIo::serial(uart, clock).with_driver_and_bits(driver, baud, bits)
    });
}
