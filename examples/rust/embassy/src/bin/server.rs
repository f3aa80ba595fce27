//! A server on embassy. Unit 17 has four holding registers, from 107 on, and one input register, 0, which
//! counts milliseconds. For each of them the future of the server is dropped.
#![no_std]
#![no_main]

use core::fmt::Write;
use embassy_executor::Spawner;
use embassy_futures::select::{select, Either};
use embassy_time::{Delay, Duration, Ticker};
use mbm::port::AsyncIo;
use mbm::server::{AsyncServer, Tables, Unit};
use mbm::Error;
use mbm_embassy_example::console::{exit, Console};
use mbm_embassy_example::uart::{Uart, BAUD};
use mbm_embassy_example::{micros, start};

async fn serve() -> Error {
    let tables = Tables::NONE
        .with_holding_registers(107, [555, 100, 0, 0])
        .with_input_registers(0, [0u16]);
    let mut unit = Unit::new(17, tables);
    let mut server = AsyncServer::rtu(AsyncIo::serial(Uart, micros as fn() -> u32, Delay));
    server.set_baud_rate(BAUD);
    let mut ticker = Ticker::every(Duration::from_millis(1));
    loop {
        match select(server.serve(&mut unit), ticker.next()).await {
            Either::First(Ok(())) => {}
            Either::First(Err(error)) => return error,
            Either::Second(()) => {
                let millis = &mut unit.device.input_registers.cells[0];
                *millis = millis.wrapping_add(1);
            }
        }
    }
}

#[embassy_executor::main]
async fn main(_spawner: Spawner) {
    start();
    let _ = writeln!(Console, "serving");
    let error = serve().await;
    let _ = writeln!(Console, "{error}");
    exit(1);
}
