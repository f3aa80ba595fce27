//! Servers whose functions are futures, on a simulated line or connection.

use super::async_line::{Delay, Line};
use super::frame::framed;
use mbm::frame::Framing;
use mbm::port::AsyncIo;
use mbm::server::{AsyncServer, Tables, Unit};

pub const FRAMINGS: [Framing; 4] = [
    Framing::Rtu,
    Framing::Ascii,
    Framing::Tcp,
    Framing::RtuOverTcp,
];

pub const UNIT: u8 = 17;

/// Longer than any frame here with its response.
pub const LONG: u32 = 200_000;

pub type Server<E = fn(bool)> =
    AsyncServer<AsyncIo<Line, Box<dyn FnMut() -> u32 + Send>, Delay, E>, [u8; 600]>;

/// A server on this line. On a serial line it has a driver.
pub fn server(line: &Line, framing: Framing) -> Server<Box<dyn FnMut(bool) + Send>> {
    let clock: Box<dyn FnMut() -> u32 + Send> = Box::new(line.clock());
    let driver: Box<dyn FnMut(bool) + Send> = Box::new(line.driver());
    let port = AsyncIo::serial_with_driver(line.clone(), clock, Delay(line.clone()), driver);
    let mut server = AsyncServer::with_framing(framing, port, [0; 600]);
    server.set_baud_rate(115_200);
    server
}

/// A server on this connection.
pub fn stream(line: &Line, framing: Framing) -> Server {
    line.state().driver = true;
    let clock: Box<dyn FnMut() -> u32 + Send> = Box::new(line.clock());
    let port = AsyncIo::stream(line.clone(), clock, Delay(line.clone()));
    AsyncServer::with_framing(framing, port, [0; 600])
}

pub type Registers = Unit<Tables<[bool; 0], [bool; 0], [u16; 10], [u16; 0]>>;

/// Holding registers 107 to 116 of unit 17.
pub fn registers() -> Registers {
    let tables = Tables::NONE.with_holding_registers(107, [0; 10]);
    Unit::new(UNIT, tables)
}

/// A write of register 107, whose response is the same.
pub fn write(framing: Framing, value: u16) -> Vec<u8> {
    let [high, low] = value.to_be_bytes();
    framed(framing, value, UNIT, &[6, 0, 107, high, low])
}

/// Runs `test` with a server of each framing.
macro_rules! in_each_framing {
    ($framing:ident, $line:ident, $server:ident, $test:block) => {
        for $framing in FRAMINGS {
            let $line = Line::default();
            if $framing.is_serial() {
                let mut $server = server(&$line, $framing);
                $test
            } else {
                let mut $server = stream(&$line, $framing);
                $test
            }
        }
    };
}

pub(crate) use in_each_framing;
