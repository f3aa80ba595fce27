//! What the programs on tokio share: a clock, a timer and a serial line.

use embedded_hal_async::delay::DelayNs;
use embedded_io_adapters::tokio_1::FromTokio;
use std::fs::OpenOptions;
use std::io;
use std::os::unix::fs::OpenOptionsExt;
use std::sync::LazyLock;
use std::time::{Duration, Instant};
use tokio::io::{join, Join};
use tokio::net::unix::pipe::{Receiver, Sender};

/// Microseconds since the program has begun.
pub fn micros() -> u32 {
    static BEGUN: LazyLock<Instant> = LazyLock::new(Instant::now);
    BEGUN.elapsed().as_micros() as u32
}

/// The timer of tokio.
#[derive(Debug)]
pub struct Delay;

impl DelayNs for Delay {
    async fn delay_ns(&mut self, nanoseconds: u32) {
        tokio::time::sleep(Duration::from_nanos(nanoseconds.into())).await;
    }
}

/// A serial line.
pub type Line = FromTokio<Join<Receiver, Sender>>;

/// Opens a serial line, for example `/dev/ttyUSB0`. The crate tokio-serial has one that sets the rate,
/// too.
///
/// # Errors
/// Why it cannot be opened.
pub fn open_line(path: &str) -> io::Result<Line> {
    /// Reads return at once.
    const NONBLOCK: i32 = 0o4000;
    let mut options = OpenOptions::new();
    options.read(true).write(true).custom_flags(NONBLOCK);
    let file = options.open(path)?;
    let receiver = Receiver::from_file_unchecked(file.try_clone()?)?;
    Ok(FromTokio::new(join(
        receiver,
        Sender::from_file_unchecked(file)?,
    )))
}

/// The programs of a page, which are tests.
#[cfg(doctest)]
#[doc = include_str!("../../../../docs/porting-from-tokio-modbus.md")]
pub struct Porting;
