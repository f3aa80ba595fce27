//! mbm's master and mbm's server on one simulated wire, with and without faults.

mod common;

use common::device::Device;
use mbm::engine::{Buffers, MicrosSetting};
use mbm::error::{Error, Status};
use mbm::frame::Framing;
use mbm::master::Master;
use mbm::port::Port;
use mbm::server::Server;
use std::cell::RefCell;
use std::collections::VecDeque;
use std::rc::Rc;

/// Two ends and a clock. Each byte takes the time of a character at 115200 baud.
#[derive(Default)]
struct Wire {
    now: u32,
    to: [VecDeque<(u32, u8)>; 2],
    /// One byte in this many is lost; 0: none.
    lost: u32,
    /// One byte in this many gets a bit changed; 0: none.
    changed: u32,
    random: u32,
}

const CHARACTER: u32 = 96;

impl Wire {
    fn chance(&mut self, one_in: u32) -> bool {
        self.random = self
            .random
            .wrapping_mul(1_664_525)
            .wrapping_add(1_013_904_223);
        one_in != 0 && (self.random >> 8).is_multiple_of(one_in)
    }
}

#[derive(Clone)]
struct End(Rc<RefCell<Wire>>, usize);

impl Port for End {
    fn read(&mut self, bytes: &mut [u8]) -> Result<usize, mbm::Error> {
        let wire = &mut *self.0.borrow_mut();
        let mut count = 0;
        for place in bytes {
            match wire.to[self.1].front() {
                Some((at, byte)) if *at <= wire.now => *place = *byte,
                _ => break,
            }
            wire.to[self.1].pop_front();
            count += 1;
        }
        Ok(count)
    }

    fn write(&mut self, bytes: &[u8]) -> Result<usize, mbm::Error> {
        let wire = &mut *self.0.borrow_mut();
        let mut at = wire.now;
        for byte in bytes {
            at += CHARACTER;
            if wire.chance(wire.lost) {
                continue;
            }
            let bit = u8::from(wire.chance(wire.changed)) << (wire.random >> 28 & 7);
            wire.to[1 - self.1].push_back((at, byte ^ bit));
        }
        Ok(bytes.len())
    }

    fn micros(&mut self) -> u32 {
        self.0.borrow().now
    }

    fn flush(&mut self) -> bool {
        let wire = &*self.0.borrow();
        wire.to[1 - self.1]
            .back()
            .is_none_or(|last| last.0 <= wire.now)
    }
}

type ServerStorage = Buffers<[u8; 256], [u16; 125], [u16; 123]>;

struct Loop {
    wire: Rc<RefCell<Wire>>,
    master: Master<End, ServerStorage>,
    server: Server<End, [u8; 256]>,
    device: Device,
}

impl Loop {
    fn new() -> Self {
        let wire = Rc::new(RefCell::new(Wire::default()));
        let buffers = Buffers::new([0; 256], [0; 125], [0; 123]);
        let mut master = Master::new(17, End(wire.clone(), 0), buffers);
        master.settings().set_baud_rate(115_200);
        master.settings().response_timeout = MicrosSetting::new(100_000);
        let mut server = Server::with_framing(Framing::Rtu, End(wire.clone(), 1), [0; 256]);
        server.set_silence(mbm::time::silence(115_200));
        Loop {
            wire,
            master,
            server,
            device: Device::new(),
        }
    }

    /// Polls both sides until the request has ended; returns its status.
    fn finish(&mut self, started: Result<(), Error>) -> Status {
        assert_eq!(started, Ok(()));
        while self.master.is_pending() {
            self.wire.borrow_mut().now += 50;
            let now = self.wire.borrow().now;
            let server = &mut self.server;
            let served = self
                .device
                .with_unit(|unit| server.serve(now, &mut [unit][..]));
            assert_eq!(served, Ok(()));
            let _ = self.master.poll();
        }
        self.master.status()
    }
}

#[test]
fn every_function_of_the_master_is_answered() {
    let mut line = Loop::new();
    let started = line.master.start_read_holding_registers(100, 10);
    assert_eq!(line.finish(started), Status::OK);
    assert_eq!(line.master.response()[9], 0x1009);
    let started = line.master.start_read_input_registers(100, 10);
    assert_eq!(line.finish(started), Status::OK);
    assert_eq!(line.master.response()[9], 0x2009);
    let started = line.master.start_read_coils(100, 20);
    assert_eq!(line.finish(started), Status::OK);
    assert_eq!(line.master.response()[0], 0x9249);
    let started = line.master.start_read_discrete_inputs(100, 20);
    assert_eq!(line.finish(started), Status::OK);
    assert_eq!(line.master.response()[1], 0b1011);
    let started = line.master.start_write_single_register(100, 7);
    assert_eq!(line.finish(started), Status::OK);
    let started = line.master.start_write_single_coil(101, true);
    assert_eq!(line.finish(started), Status::OK);
    let started = line
        .master
        .start_write_multiple_registers(103, &[0xABCD, 0x1234]);
    assert_eq!(line.finish(started), Status::OK);
    let started = line.master.start_write_multiple_coils(104, &[true; 16]);
    assert_eq!(line.finish(started), Status::OK);
    let started = line.master.start_mask_write_register(100, 0, 0x0FF0);
    assert_eq!(line.finish(started), Status::OK);
    let started = line
        .master
        .start_read_write_multiple_registers(100, 4, 102, &[0xABCD]);
    assert_eq!(line.finish(started), Status::OK);
    assert_eq!(line.master.response(), [0x0FF0, 0x1001, 0xABCD, 0xABCD]);
    assert_eq!(line.device.holding[4], 0x1234);
    let started = line.master.start_read_holding_registers(110, 1);
    assert_eq!(line.finish(started), Status::ILLEGAL_DATA_ADDRESS);
}

#[test]
fn a_bad_wire_makes_requests_fail_but_never_gives_a_wrong_value() {
    for (lost, changed) in [(40, 0), (0, 40), (80, 80)] {
        let mut line = Loop::new();
        (line.wire.borrow_mut().lost, line.wire.borrow_mut().changed) = (lost, changed);
        line.master.settings().retries = 2;
        let (mut right, mut value) = (0, [0u16; 10]);
        value.copy_from_slice(&line.device.holding);
        for round in 0..500u16 {
            let cell = usize::from(round % 10);
            let started = line
                .master
                .start_write_single_register(100 + round % 10, round);
            let wrote = line.finish(started);
            if wrote == Status::OK {
                value[cell] = round;
            }
            // A write whose response was lost may have been carried out.
            let held = line.device.holding[cell];
            assert!(held == value[cell] || (wrote != Status::OK && held == round));
            value[cell] = held;
            let started = line.master.start_read_holding_registers(100, 10);
            if line.finish(started) == Status::OK {
                right += 1;
                for (at, wanted) in value.iter().enumerate() {
                    assert_eq!(line.master.response()[at], *wanted, "{round}");
                }
            }
        }
        assert!(right > 300, "{right} of 500 with {lost} {changed}");
    }
}

#[test]
fn after_the_wire_is_good_again_the_next_request_is_answered() {
    let mut line = Loop::new();
    for round in 0..200 {
        line.wire.borrow_mut().changed = 6;
        let started = line.master.start_read_holding_registers(100, 10);
        let _ = line.finish(started);
        line.wire.borrow_mut().changed = 0;
        let started = line.master.start_read_holding_registers(100, 10);
        assert_eq!(line.finish(started), Status::OK, "{round}");
    }
}
