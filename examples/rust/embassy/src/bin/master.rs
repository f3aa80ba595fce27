//! A master on embassy. Two tasks share the line by a mutex: one reads registers, one writes them and
//! reads them back. Then requests are given up after every fraction of their time, each before a request
//! that is answered.
#![no_std]
#![no_main]

use core::fmt::Write;
use embassy_executor::Spawner;
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use embassy_sync::mutex::Mutex;
use embassy_sync::signal::Signal;
use embassy_time::{with_timeout, Delay, Duration, Timer};
use mbm::master::{AsyncMaster, Buffers};
use mbm::Error;
use mbm_embassy_example::console::{exit, Console};
use mbm_embassy_example::uart::{Uart, BAUD};
use mbm_embassy_example::{micros, start};

const UNIT: u8 = 17;
/// No device has this id.
const ABSENT: u8 = 18;
const ROUNDS: u16 = 60;

type Words = Buffers<[u8; 64], [u16; 20], [u16; 20]>;
type Line = AsyncMaster<Uart, fn() -> u32, Delay, Words>;

static LINE: Mutex<CriticalSectionRawMutex, Line> = {
    // The frame buffer, the words that a read fills, the words that a write sends.
    let buffers = Buffers::new([0; 64], [0; 20], [0; 20]);
    Mutex::new(AsyncMaster::new(UNIT, Uart, micros, Delay, buffers))
};

type Count = Signal<CriticalSectionRawMutex, Result<u16, Error>>;
static READ: Count = Count::new();
static WRITTEN: Count = Count::new();

/// Reads two registers again and again. No task writes them. Returns how many reads had the values of the
/// first read.
async fn read() -> Result<u16, Error> {
    let first: [u16; 2] = LINE.lock().await.holding_registers(20).await?;
    let mut same = 0;
    for _ in 0..ROUNDS {
        let again = LINE.lock().await.holding_registers(20).await?;
        same += u16::from(again == first);
        Timer::after_millis(1).await;
    }
    Ok(same)
}

/// Writes two registers again and again, and reads them in another request. Returns how many reads had the
/// values that were written.
async fn write() -> Result<u16, Error> {
    let mut same = 0;
    for round in 0..ROUNDS {
        let values = [round, !round];
        LINE.lock()
            .await
            .write_multiple_registers(30, &values)
            .await?;
        Timer::after_millis(1).await;
        let back = LINE.lock().await.holding_registers(30).await?;
        same += u16::from(back == values);
    }
    Ok(same)
}

#[embassy_executor::task]
async fn reader() {
    READ.signal(read().await);
}

#[embassy_executor::task]
async fn writer() {
    WRITTEN.signal(write().await);
}

/// Gives requests up. Returns how many were given up, and how many of all requests after them were
/// answered with the right values.
async fn give_up() -> Result<(u16, u16), Error> {
    let line = &mut *LINE.lock().await;
    let (first, other): ([u16; 2], [u16; 2]) = (
        line.holding_registers(20).await?,
        line.holding_registers(40).await?,
    );
    let (mut given_up, mut right) = (0, 0);
    line.set_unit(ABSENT);
    let limit = Duration::from_millis(20);
    if with_timeout(limit, line.holding_registers::<2>(20))
        .await
        .is_err()
    {
        given_up += 1;
    }
    line.set_unit(UNIT);
    for micros in (0..6_000).step_by(100) {
        let limit = Duration::from_micros(micros);
        match with_timeout(limit, line.holding_registers(20)).await {
            Ok(answered) if answered? != first => continue,
            Ok(_) => {}
            Err(_) => given_up += 1,
        }
        right += u16::from(line.holding_registers(40).await? == other);
    }
    Ok((given_up, right))
}

async fn run(spawner: Spawner) -> Result<(), Error> {
    LINE.lock().await.settings().set_baud_rate(BAUD);
    if let (Ok(reader), Ok(writer)) = (reader(), writer()) {
        spawner.spawn(reader);
        spawner.spawn(writer);
    }
    let (read, written) = (READ.wait().await?, WRITTEN.wait().await?);
    let _ = writeln!(Console, "of {ROUNDS}: {read} read, {written} written");
    let (given_up, right) = give_up().await?;
    let _ = writeln!(
        Console,
        "given up: {given_up}, right after it: {right} of 60"
    );
    Ok(())
}

#[embassy_executor::main]
async fn main(spawner: Spawner) {
    start();
    if let Err(error) = run(spawner).await {
        let _ = writeln!(Console, "{error}");
        exit(1);
    }
    exit(0);
}
