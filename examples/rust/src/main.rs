//! Firmware that reads registers of unit 17 through a UART: with the master whose calls wait, and
//! with the master whose functions are futures. It prints them on the debugger's console.
#![no_std]
#![no_main]

mod board;
mod console;
mod uart;

use board::{micros, Delay};
use console::Console;
use core::fmt::Write;
use core::future::Future;
use core::pin::pin;
use core::task::{Context, Poll, Waker};
use mbm::master::{AsyncMaster, Buffers, Master};
use mbm::port::EmbeddedIo;
use mbm::Error;
use uart::Uart;

const UNIT: u8 = 17;
const BAUD: u32 = 115_200;

/// Reads the registers 20 and 21.
fn read_blocking() -> Result<[u16; 2], Error> {
    // The frame buffer, the words that a read fills, the words that a write sends.
    let buffers = Buffers::new([0; 32], [0; 10], []);
    let mut master = Master::new(UNIT, EmbeddedIo::serial(Uart, micros), buffers);
    master.settings().set_baud_rate(BAUD);
    master.holding_registers(20)
}

/// Writes 888 to register 22, and reads the registers 22 and 23.
async fn read_awaited() -> Result<[u16; 2], Error> {
    let buffers = Buffers::new([0; 32], [0; 10], [0; 10]);
    let mut master = AsyncMaster::new(UNIT, Uart, micros, Delay, buffers);
    master.settings().set_baud_rate(BAUD);
    master.write_single_register(22, 888).await?;
    master.holding_registers(22).await
}

/// Polls a future to its end. An executor would sleep in between.
fn block_on<F: Future>(future: F) -> F::Output {
    let mut future = pin!(future);
    let mut context = Context::from_waker(Waker::noop());
    loop {
        if let Poll::Ready(output) = future.as_mut().poll(&mut context) {
            return output;
        }
    }
}

fn print(name: &str, read: Result<[u16; 2], Error>) -> u32 {
    let (written, failed) = match read {
        Ok([first, second]) => (writeln!(Console, "{name}: {first} {second}"), false),
        Err(error) => (writeln!(Console, "{name}: {error}"), true),
    };
    u32::from(failed || written.is_err())
}

#[cortex_m_rt::entry]
fn main() -> ! {
    board::start();
    uart::start(BAUD);
    let failed = print("blocking", read_blocking()) + print("awaited", block_on(read_awaited()));
    console::exit(failed)
}
