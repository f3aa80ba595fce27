//! A client with a queue on embassy. It polls, so its port polls the UART, whose reads are futures. The
//! task sleeps until the UART or the timer wakes it.
#![no_std]
#![no_main]

use core::fmt::Write;
use core::future::{poll_fn, Future};
use core::pin::pin;
use core::task::Poll;
use embassy_executor::Spawner;
use embassy_time::Timer;
use mbm::client::{Client, Frame, Request, Serial};
use mbm::port::PolledIo;
use mbm::Error;
use mbm_embassy_example::console::{exit, Console};
use mbm_embassy_example::uart::{Uart, BAUD};
use mbm_embassy_example::{micros, start};

const UNIT: u8 = 17;
const ROUNDS: u16 = 50;

type Line<'a> = Serial<PolledIo<Uart, fn() -> u32>, Frame<[u8; 256]>, Request<'a>>;

/// Waits until a request has ended.
async fn next<'a>(client: &mut Client<Line<'a>, Request<'a>, 2>) -> Request<'a> {
    poll_fn(|context| {
        client.port().set_waker(context.waker());
        loop {
            if let Some(request) = client.poll(micros()) {
                return Poll::Ready(request);
            }
            // Not 0, so that other tasks run.
            let delay = client.poll_delay(micros()).max(20);
            let timer = pin!(Timer::after_micros(delay.into()));
            if timer.poll(context).is_pending() {
                return Poll::Pending;
            }
        }
    })
    .await
}

/// Reads two registers, and writes one. Returns the registers, and how many requests were answered.
async fn run() -> Result<([u16; 2], u16), Error> {
    let (mut read, mut written) = ([0; 2], [0; 1]);
    let (mut values, mut answered) = ([0; 2], 0);
    let port = PolledIo::serial(Uart, micros as fn() -> u32);
    let mut client: Client<_, _, 2> = Client::new(Serial::new(port, Frame::new([0; 256])));
    client.settings().set_baud_rate(BAUD);
    client.queue(Request::read_holding_registers(UNIT, 20, &mut read)?)?;
    client.queue(Request::write_multiple_registers(UNIT, 35, &mut written)?)?;
    while answered < 2 * ROUNDS {
        let mut request = next(&mut client).await;
        request.result()?;
        answered += 1;
        if let [first, second] = *request.registers() {
            values = [first, second];
        }
        if let [value] = request.registers_to_write() {
            *value += 1;
        }
        client.queue(request)?;
    }
    Ok((values, answered))
}

#[embassy_executor::main]
async fn main(_spawner: Spawner) {
    start();
    let code = match run().await {
        Ok(([first, second], answered)) => {
            let _ = writeln!(Console, "polled: {first} {second}, answered: {answered}");
            0
        }
        Err(error) => {
            let _ = writeln!(Console, "{error}");
            1
        }
    };
    exit(code);
}
