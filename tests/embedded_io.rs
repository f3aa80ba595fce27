//! The port over embedded-io, on a simulated line with a device.
#![cfg(feature = "embedded-io")]

mod common;

use common::uart::{check_sending_time, master, read, write, Bench, Wire};
use embedded_io::{ErrorKind, ErrorType, Read, ReadReady, Write, WriteReady};
use mbm::error::{Error, Status};
use mbm::port::{EmbeddedIo, Port};
use std::cell::RefCell;
use std::rc::Rc;

/// A UART that panics if it would have to wait.
#[derive(Clone)]
struct Uart(Rc<RefCell<Wire>>);

impl ErrorType for Uart {
    type Error = ErrorKind;
}

impl Read for Uart {
    fn read(&mut self, bytes: &mut [u8]) -> Result<usize, ErrorKind> {
        let wire = &mut *self.0.borrow_mut();
        if std::mem::take(&mut wire.read_fails) {
            return Err(ErrorKind::Other);
        }
        assert!(wire.is_closed || wire.has_arrived(), "a read would wait");
        Ok(wire.receive(bytes))
    }
}

impl ReadReady for Uart {
    fn read_ready(&mut self) -> Result<bool, ErrorKind> {
        let wire = self.0.borrow();
        Ok(wire.is_closed || wire.read_fails || wire.has_arrived())
    }
}

impl Write for Uart {
    fn write(&mut self, bytes: &[u8]) -> Result<usize, ErrorKind> {
        let wire = &mut *self.0.borrow_mut();
        if wire.write_fails {
            return Err(ErrorKind::BrokenPipe);
        }
        assert!(wire.accepts > 0, "a write would wait");
        Ok(wire.send(bytes))
    }

    fn flush(&mut self) -> Result<(), ErrorKind> {
        panic!("a flush would wait");
    }
}

impl WriteReady for Uart {
    fn write_ready(&mut self) -> Result<bool, ErrorKind> {
        let wire = self.0.borrow();
        Ok(wire.accepts > 0 || wire.write_fails)
    }
}

fn clock(wire: &Rc<RefCell<Wire>>) -> impl FnMut() -> u32 + use<> {
    let wire = wire.clone();
    move || wire.borrow().now
}

fn driver(wire: &Rc<RefCell<Wire>>) -> impl FnMut(bool) + use<> {
    let wire = wire.clone();
    move |on| wire.borrow_mut().driver = on
}

fn serial(bench: &Bench) -> impl Port + use<> {
    let (wire, uart) = (&bench.wire, Uart(bench.wire.clone()));
    EmbeddedIo::serial(uart, clock(wire)).with_driver(driver(wire), 115_200)
}

fn stream(bench: &Bench) -> impl Port + use<> {
    let (wire, uart) = (&bench.wire, Uart(bench.wire.clone()));
    EmbeddedIo::stream(uart, clock(wire)).with_driver(driver(wire), 115_200)
}

#[test]
fn a_master_reads_registers_through_a_uart() {
    let mut bench = Bench::new();
    let port = serial(&bench);
    assert_eq!(read(&mut bench, port), Ok(vec![0x1002, 0x1003, 0x1004]));
    assert!(!bench.wire.borrow().driver);
}

#[test]
fn the_driver_is_on_until_the_last_byte_has_left_and_off_before_the_reply() {
    for accepts in [1, 3, 256] {
        let mut bench = Bench::new();
        bench.wire.borrow_mut().accepts = accepts;
        let port = serial(&bench);
        let after = write(&mut bench, port);
        assert!(!bench.wire.borrow().is_cut_off, "{accepts}");
        assert!((50..=250).contains(&after), "{accepts}: {after}");
    }
}

#[test]
fn a_uart_may_take_a_frame_in_pieces() {
    for accepts in 1..8 {
        let mut bench = Bench::new();
        bench.wire.borrow_mut().accepts = accepts;
        let port = serial(&bench);
        assert!(read(&mut bench, port).is_ok(), "{accepts}");
    }
}

#[test]
fn a_uart_without_bytes_reads_none_and_is_not_asked() {
    let bench = Bench::new();
    assert_eq!(serial(&bench).read(&mut [0; 8]), Ok(0));
    assert_eq!(stream(&bench).read(&mut [0; 8]), Ok(0));
}

#[test]
fn a_uart_that_is_full_accepts_no_byte_and_is_not_asked() {
    let bench = Bench::new();
    bench.wire.borrow_mut().accepts = 0;
    assert_eq!(serial(&bench).write(&[1, 2]), Ok(0));
    assert_eq!(stream(&bench).write(&[1, 2]), Ok(0));
}

#[test]
fn a_uart_that_stays_full_ends_the_request_as_a_busy_line() {
    let mut bench = Bench::new();
    bench.wire.borrow_mut().accepts = 0;
    let port = serial(&bench);
    assert_eq!(read(&mut bench, port), Err(Error::LineBusy));
    assert!(!bench.wire.borrow().driver);
}

#[test]
fn a_damaged_character_of_a_serial_line_is_not_a_lost_link() {
    let mut bench = Bench::new();
    bench.wire.borrow_mut().read_fails = true;
    let mut port = serial(&bench);
    assert_eq!(port.read(&mut [0; 8]), Ok(0));
    bench.wire.borrow_mut().read_fails = true;
    assert!(read(&mut bench, port).is_ok());
}

#[test]
fn an_error_of_a_stream_is_a_lost_link() {
    let mut bench = Bench::new();
    bench.wire.borrow_mut().read_fails = true;
    let port = stream(&bench);
    assert_eq!(read(&mut bench, port), Err(Error::LinkLost));
}

#[test]
fn the_end_of_a_stream_is_a_lost_link() {
    let mut bench = Bench::new();
    bench.wire.borrow_mut().is_closed = true;
    let port = stream(&bench);
    assert_eq!(read(&mut bench, port), Err(Error::LinkLost));
}

#[test]
fn a_write_that_fails_is_a_lost_link() {
    let mut bench = Bench::new();
    bench.wire.borrow_mut().write_fails = true;
    let port = serial(&bench);
    assert_eq!(read(&mut bench, port), Err(Error::LinkLost));
    let port = stream(&bench);
    assert_eq!(read(&mut bench, port), Err(Error::LinkLost));
}

#[test]
fn a_device_that_receives_nothing_times_out() {
    let mut bench = Bench::new();
    bench.wire.borrow_mut().is_cut = true;
    let mut master = master(serial(&bench));
    assert_eq!(master.start_write_single_register(100, 1), Ok(()));
    assert_eq!(master.wait(|| bench.pass()), Err(Error::ResponseTimedOut));
    assert_eq!(master.status(), Status::RESPONSE_TIMED_OUT);
}

#[test]
fn the_clock_may_wrap_at_any_time_of_a_request() {
    for before in (0..6_000).step_by(50) {
        let mut bench = Bench::new();
        let (wire, uart) = (bench.wire.clone(), Uart(bench.wire.clone()));
        let clock = move || wire.borrow().now.wrapping_sub(before);
        let port = EmbeddedIo::serial(uart, clock).with_driver(driver(&bench.wire), 115_200);
        assert!(read(&mut bench, port).is_ok(), "{before}");
        let wire = bench.wire.borrow();
        assert!(!wire.driver && !wire.is_cut_off, "{before}");
    }
}

#[test]
fn the_time_of_a_frame_is_that_of_its_bits() {
    check_sending_time(|bench, baud, bits| {
        let (uart, clock) = (Uart(bench.wire.clone()), clock(&bench.wire));
        EmbeddedIo::serial(uart, clock).with_driver_and_bits(driver(&bench.wire), baud, bits)
    });
}
