//! A master whose functions are futures, over the traits of embedded-io-async.

use super::calls::{calls, example};
use super::Master;
use crate::engine::{Settings, Words};
use crate::error::Error;
use crate::pdu::{quantity, MAX_READ_BITS, MAX_READ_REGISTERS};
use crate::port::{AsyncIo, Port};
use core::task::Poll;
use embedded_hal_async::delay::DelayNs;
use embedded_io_async::{Read, Write};

/// A master of one RTU line, whose functions are futures. It has one request at a time.
///
/// - `D` is the UART: [`Read`] and [`Write`] of embedded-io-async. Its read must lose no byte if
///   its future is dropped, as a UART with a receive buffer does. A read that fails means that
///   characters were damaged or lost. A write or flush that fails, and a read or write of 0 bytes,
///   mean that the link is lost.
/// - `C` is the clock, in microseconds, which wraps at 2^32. `T` is [`DelayNs`] of
///   embedded-hal-async. An executor's timer has both.
/// - `S` are the buffers, as those of [`Master`]. Values are copied between them and the slices of
///   a call.
///
/// If the future of a request is dropped, the request is cancelled, and the driver is switched
/// off. Another request may follow at once. It waits until what the UART has taken of the frame has
/// left.
///
/// ```
/// # include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/doc/executor.rs"));
/// use mbm::master::{AsyncMaster, Buffers};
///
/// async fn read() -> Result<[u16; 2], mbm::Error> {
///     let buffers = Buffers::new([0; 64], [0; 20], [0; 20]);
///     let mut master = AsyncMaster::new(17, uart(), micros, Delay, buffers);
///     master.settings().set_baud_rate(19200);
///     let words = master.holding_registers(107).await?;
///     assert_eq!(master.exception_code(), 0);
///     assert_eq!(master.storage().counters[0], 1);
///     master.set_unit(18);
///     let _uart = master.device();
///     Ok(words)
/// }
/// # fn main() { assert_eq!(block_on(read()), Ok([555, 100])); }
/// ```
#[derive(Debug)]
pub struct AsyncMaster<D, C, T, S: Words, E = fn(bool)> {
    master: Master<AsyncIo<D, C, T, E>, S>,
}

impl<D, C: FnMut() -> u32, T, S: Words> AsyncMaster<D, C, T, S> {
    /// A master that sends requests to `unit`.
    pub const fn new(unit: u8, device: D, clock: C, timer: T, buffers: S) -> Self {
        AsyncMaster::with_driver(unit, device, clock, timer, buffers, |_| {})
    }
}

impl<D, C: FnMut() -> u32, T, S: Words, E: FnMut(bool)> AsyncMaster<D, C, T, S, E> {
    /// As [`AsyncMaster::new`], with an RS-485 driver: `driver` switches it on with `true` before
    /// the first byte is sent, and off after the last one.
    ///
    /// ```
    /// # include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/doc/executor.rs"));
    /// use mbm::master::{AsyncMaster, Buffers};
    ///
    /// async fn read() -> Result<[u16; 2], mbm::Error> {
    ///     let buffers = Buffers::new([0; 64], [0; 20], [0; 20]);
    ///     let driver = |on: bool| { /* Sets the pin of the driver. */ };
    ///     let mut master = AsyncMaster::with_driver(17, uart(), micros, Delay, buffers, driver);
    ///     master.settings().set_baud_rate(19200);
    ///     master.holding_registers(107).await
    /// }
    /// # fn main() { assert_eq!(block_on(read()), Ok([555, 100])); }
    /// ```
    pub const fn with_driver(
        unit: u8,
        device: D,
        clock: C,
        timer: T,
        buffers: S,
        driver: E,
    ) -> Self {
        let port = AsyncIo::serial_with_driver(device, clock, timer, driver);
        AsyncMaster {
            master: Master::new(unit, port, buffers),
        }
    }

    /// Timeouts, retries and other settings of requests.
    pub fn settings(&mut self) -> &mut Settings {
        self.master.settings()
    }

    /// The buffers, with the counters.
    pub fn storage(&mut self) -> &mut S {
        self.master.storage()
    }

    /// The UART.
    pub fn device(&mut self) -> &mut D {
        &mut self.master.port().device
    }

    /// Sets the unit for later requests; 0 means broadcast.
    pub fn set_unit(&mut self, unit: u8) {
        self.master.set_unit(unit);
    }

    /// The exception code of the last reply as received; 0 if it was no exception.
    pub fn exception_code(&self) -> u8 {
        self.master.exception_code()
    }
}

impl<D, C, T, S, E> AsyncMaster<D, C, T, S, E>
where
    D: Read + Write,
    C: FnMut() -> u32,
    T: DelayNs,
    S: Words,
    E: FnMut(bool),
{
    /// Makes a request, and waits until it has ended.
    async fn request(
        &mut self,
        start: impl FnOnce(&mut Master<AsyncIo<D, C, T, E>, S>) -> Result<(), Error>,
    ) -> Result<(), Error> {
        // A future that was forgotten, and not dropped, has left its request.
        self.master.cancel();
        self.master.port().begin();
        if send(&mut self.master).await {
            let line = &mut self.master.line;
            let now = line.port.micros();
            line.note_sent_late(now);
        }
        start(&mut self.master)?;
        let running = Running(&mut self.master);
        running.0.port().take_old_bytes().await;
        loop {
            if let Poll::Ready(result) = running.0.poll() {
                return result;
            }
            go_on(running.0).await;
        }
    }

    fn take_words(&self, registers: &mut [u16]) -> Result<(), Error> {
        self.master.take_words(registers)
    }

    fn take_bits(&self, bits: &mut [bool]) -> Result<(), Error> {
        self.master.take_bits(bits)
    }

    calls! { async; .await }
}

/// A pending request. If the future that has it is dropped, the request is cancelled.
struct Running<'a, D, C: FnMut() -> u32, T, S: Words, E: FnMut(bool)>(
    &'a mut Master<AsyncIo<D, C, T, E>, S>,
);

impl<D, C: FnMut() -> u32, T, S: Words, E: FnMut(bool)> Drop for Running<'_, D, C, T, S, E> {
    fn drop(&mut self) {
        self.0.cancel();
    }
}

/// Sends a frame, or what is left of it. False if there is none.
async fn send<D, C, T, S, E>(master: &mut Master<AsyncIo<D, C, T, E>, S>) -> bool
where
    D: Read + Write,
    C: FnMut() -> u32,
    T: DelayNs,
    S: Words,
    E: FnMut(bool),
{
    let Some(length) = master.port().frame_length() else {
        return false;
    };
    let line = &mut master.line;
    let settings = &line.settings;
    let characters = u32::from(settings.any_character()) << 8;
    let limit = characters.saturating_add(settings.response_timeout.get());
    let frame = line.storage.slice(0, length as u8);
    let character = settings.character;
    line.port.send_and_hold(frame, limit, character).await;
    true
}

/// Waits until the next poll has something to do.
async fn go_on<D, C, T, S, E>(master: &mut Master<AsyncIo<D, C, T, E>, S>)
where
    D: Read + Write,
    C: FnMut() -> u32,
    T: DelayNs,
    S: Words,
    E: FnMut(bool),
{
    if send(master).await {
        return;
    }
    let delay = master.poll_delay();
    if !master.is_waiting() {
        // The device is stuck, or the driver stays on for `delay`.
        master.port().pause(delay).await;
    } else if delay > 0 {
        master.port().receive(delay).await;
    }
}
