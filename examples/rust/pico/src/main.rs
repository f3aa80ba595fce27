//! Reads registers 107 and 108 of unit 17 each second, through an RS-485 transceiver at GP0 (its input),
//! GP1 (its output) and GP2 (its driver). The LED is on while the first register is above 500.
#![no_std]
#![no_main]

use embassy_executor::Spawner;
use embassy_rp::bind_interrupts;
use embassy_rp::gpio::{Level, Output};
use embassy_rp::peripherals::UART0;
use embassy_rp::uart::{BufferedInterruptHandler, BufferedUart, Config};
use embassy_time::{Delay, Instant, Timer};
use mbm::client::AsyncClient;
use mbm::port::AsyncIo;
use panic_halt as _;
use static_cell::ConstStaticCell;

bind_interrupts!(struct Interrupts { UART0_IRQ => BufferedInterruptHandler<UART0>; });

/// Larger than a frame, which has at most 256 bytes.
static SENT: ConstStaticCell<[u8; 300]> = ConstStaticCell::new([0; 300]);
static RECEIVED: ConstStaticCell<[u8; 300]> = ConstStaticCell::new([0; 300]);

fn micros() -> u32 {
    Instant::now().as_micros() as u32
}

#[embassy_executor::main]
async fn main(_spawner: Spawner) {
    let board = embassy_rp::init(Default::default());
    let mut led = Output::new(board.PIN_25, Level::Low);
    let mut driver = Output::new(board.PIN_2, Level::Low);
    let mut config = Config::default();
    config.baudrate = 19200;
    let (tx, rx) = (board.PIN_0, board.PIN_1);
    let uart = BufferedUart::new(
        board.UART0,
        tx,
        rx,
        Interrupts,
        SENT.take(),
        RECEIVED.take(),
        config,
    );

    let switch = |on: bool| driver.set_level(on.into());
    let port = AsyncIo::serial_with_driver(uart, micros as fn() -> u32, Delay, switch);
    let mut client = AsyncClient::rtu(port);
    client.settings().set_baud_rate(19200);
    loop {
        match client.holding_registers(17, 107).await {
            Ok([flow, _total]) => led.set_level((flow > 500).into()),
            // Its text says why. The next request is independent of it.
            Err(_error) => led.set_low(),
        }
        Timer::after_secs(1).await;
    }
}
