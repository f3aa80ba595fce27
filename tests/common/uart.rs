//! A UART of a master, with a device at the other end of its line. The line has its own clock.

use super::device::Device;
use mbm::engine::Buffers;
use mbm::frame::Framing;
use mbm::master::Master;
use mbm::port::Port;
use mbm::server::Server;
use mbm::Error;
use std::cell::RefCell;
use std::collections::VecDeque;
use std::rc::Rc;

/// The duration of a character at 115200 baud in microseconds.
pub const CHARACTER: u32 = 96;

/// The state of the UART.
#[derive(Default)]
pub struct Wire {
    pub now: u32,
    to_device: VecDeque<(u32, u8)>,
    to_master: VecDeque<(u32, u8)>,
    /// How many bytes the UART accepts at once; 0: none.
    pub accepts: usize,
    /// The next read fails.
    pub read_fails: bool,
    /// Every write fails.
    pub write_fails: bool,
    /// A flush ends although bytes have not left.
    pub flushes_early: bool,
    /// No more bytes can be read.
    pub is_closed: bool,
    /// The device receives nothing.
    pub is_cut: bool,
    /// The RS-485 driver is on.
    pub driver: bool,
    /// The driver was off while bytes left the UART.
    pub is_cut_off: bool,
    /// All bytes that were sent.
    pub sent: Vec<u8>,
}

impl Wire {
    /// True if a byte has arrived at the master.
    pub fn has_arrived(&self) -> bool {
        self.to_master
            .front()
            .is_some_and(|first| first.0 <= self.now)
    }

    /// True once all bytes have left the UART.
    pub fn is_flushed(&self) -> bool {
        self.to_device.is_empty()
    }

    /// Fills `bytes` with the bytes that have arrived at the master, and returns how many.
    pub fn receive(&mut self, bytes: &mut [u8]) -> usize {
        let mut count = 0;
        for place in bytes {
            if !self.has_arrived() {
                break;
            }
            *place = self.to_master.pop_front().unwrap().1;
            count += 1;
        }
        count
    }

    /// Sends as many of the bytes as the UART accepts, and returns how many.
    pub fn send(&mut self, bytes: &[u8]) -> usize {
        assert!(self.driver, "the driver is off");
        let count = bytes.len().min(self.accepts);
        let mut at = self.to_device.back().map_or(self.now, |last| last.0);
        for byte in &bytes[..count] {
            at += CHARACTER;
            self.to_device.push_back((at, *byte));
            self.sent.push(*byte);
        }
        count
    }

    /// Adds bytes that arrive at the master now.
    pub fn arrive(&mut self, bytes: &[u8]) {
        let now = self.now;
        self.to_master.extend(bytes.iter().map(|byte| (now, *byte)));
    }
}

/// The device's end.
struct DeviceEnd(Rc<RefCell<Wire>>);

impl Port for DeviceEnd {
    fn read(&mut self, bytes: &mut [u8]) -> Result<usize, mbm::Error> {
        let wire = &mut *self.0.borrow_mut();
        let mut count = 0;
        while count < bytes.len() {
            match wire.to_device.front() {
                Some(first) if first.0 <= wire.now => bytes[count] = first.1,
                _ => break,
            }
            wire.to_device.pop_front();
            count += usize::from(!wire.is_cut);
        }
        Ok(count)
    }

    fn write(&mut self, bytes: &[u8]) -> Result<usize, mbm::Error> {
        let wire = &mut *self.0.borrow_mut();
        let mut at = wire.now;
        for byte in bytes {
            at += CHARACTER;
            wire.to_master.push_back((at, *byte));
        }
        Ok(bytes.len())
    }

    fn micros(&mut self) -> u32 {
        self.0.borrow().now
    }
}

/// The UART's line with a device.
pub struct Bench {
    pub wire: Rc<RefCell<Wire>>,
    server: Server<DeviceEnd, [u8; 256]>,
    pub device: Device,
}

impl Bench {
    pub fn new() -> Self {
        let wire = Wire {
            accepts: usize::MAX,
            ..Wire::default()
        };
        let wire = Rc::new(RefCell::new(wire));
        let mut server = Server::with_framing(Framing::Rtu, DeviceEnd(wire.clone()), [0; 256]);
        server.set_silence(mbm::time::silence(115_200));
        Bench {
            wire,
            server,
            device: Device::new(),
        }
    }

    /// Lets 50 microseconds pass. The device receives and answers in that time.
    pub fn pass(&mut self) {
        let now = {
            let wire = &mut *self.wire.borrow_mut();
            wire.is_cut_off |= !wire.driver && !wire.is_flushed();
            wire.now += 50;
            wire.now
        };
        let server = &mut self.server;
        let served = self
            .device
            .with_unit(|unit| server.serve(now, &mut [unit][..]));
        assert_eq!(served, Ok(()));
    }
}

type Words = Buffers<[u8; 256], [u16; 125], [u16; 123]>;

/// A master of unit 17 at 115200 baud.
pub fn master<P: Port>(port: P) -> Master<P, Words> {
    let buffers = Buffers::new([0; 256], [0; 125], [0; 123]);
    let mut master = Master::new(17, port, buffers);
    master.settings().set_baud_rate(115_200);
    master
}

/// Reads three registers.
pub fn read(bench: &mut Bench, port: impl Port) -> Result<Vec<u16>, Error> {
    let mut master = master(port);
    master.start_read_holding_registers(102, 3)?;
    master.wait(|| bench.pass())?;
    Ok(master.response().to_vec())
}

/// Writes ten registers. Returns for how many microseconds the driver stays on after the last byte of
/// the request has left.
pub fn write(bench: &mut Bench, port: impl Port) -> u32 {
    let mut master = master(port);
    let words = [7; 10];
    assert_eq!(master.start_write_multiple_registers(100, &words), Ok(()));
    let mut times = [0; 2];
    let result = master.wait(|| {
        let wire = bench.wire.borrow();
        if !wire.is_flushed() {
            times[0] = wire.now;
        } else if wire.driver {
            times[1] = wire.now;
        }
        drop(wire);
        bench.pass();
    });
    let accepts = bench.wire.borrow().accepts;
    assert_eq!(result, Ok(()), "{accepts}");
    times[1] - times[0]
}

/// Checks when a port counts a frame of 256 bytes as sent: after the time of its bits, and soon. `port` makes
/// a port on the bench's UART for a baud rate and a number of bits in a character.
pub fn check_sending_time<P: Port>(port: impl Fn(&Bench, u32, u8) -> P) {
    for (bits, baud, least) in [
        (10, 115_200, 22_222),
        (11, 115_200, 24_444),
        (10, 9600, 266_667),
        (10, 460_800, 5_556),
    ] {
        let bench = Bench::new();
        let took = sending_time(port(&bench, baud, bits), &bench.wire);
        // A microsecond of rounding for each character, and one character of reserve.
        let most = least + 257 + u32::from(bits) * 1_000_000 / baud + 1;
        assert!(
            (least..=most).contains(&took),
            "{bits} bits at {baud}: {took}"
        );
    }
}

/// The microseconds after which a frame of 256 bytes, which the UART accepts at once, counts as sent.
fn sending_time(mut port: impl Port, wire: &Rc<RefCell<Wire>>) -> u32 {
    let start = wire.borrow().now;
    port.pre_transmission();
    assert_eq!(port.write(&[0; 256]), Ok(256));
    while !port.flush() {
        wire.borrow_mut().now += 1;
    }
    wire.borrow().now.wrapping_sub(start)
}
