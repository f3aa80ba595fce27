//! A master whose functions are futures, over the traits of embedded-io-async.

use super::calls::calls;
use super::Master;
use crate::engine::{Settings, Words};
use crate::error::Error;
use crate::pdu::{quantity, MAX_READ_BITS, MAX_READ_REGISTERS};
use crate::port::Port;
use core::future::{poll_fn, ready, Future};
use core::pin::pin;
use core::task::Poll;
use embedded_hal_async::delay::DelayNs;
use embedded_io_async::{Read, Write};

/// Bytes that are received in one piece.
const PIECE: usize = 64;

/// The pause before the next poll while the device does not go on, in microseconds.
const PAUSE: u32 = 200;

/// What is to be sent.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum Outgoing {
    /// Nothing.
    None,
    /// This many bytes of the frame buffer.
    Frame(u8),
    /// The device did not take the frame in time.
    Stuck,
}

/// The port between the engine, which never waits, and the device, which is awaited. The frame to
/// send stays in the frame buffer.
#[derive(Debug)]
struct Bridge<C, E> {
    clock: C,
    driver: E,
    outgoing: Outgoing,
    is_lost: bool,
    received: [u8; PIECE],
    /// The range of `received` that the engine has not read yet.
    start: usize,
    end: usize,
}

impl<C: FnMut() -> u32, E: FnMut(bool)> Port for Bridge<C, E> {
    fn read(&mut self, bytes: &mut [u8]) -> Result<usize, Error> {
        let received = self.received.get(self.start..self.end).unwrap_or_default();
        if received.is_empty() && self.is_lost {
            return Err(Error::LinkLost);
        }
        let mut count = 0;
        for (place, byte) in bytes.iter_mut().zip(received) {
            *place = *byte;
            count += 1;
        }
        self.start += count;
        Ok(count)
    }

    fn write(&mut self, bytes: &[u8]) -> Result<usize, Error> {
        // The engine writes the whole frame in one call, as all of it is accepted.
        let length = bytes.len() as u8;
        self.outgoing = Outgoing::Frame(length);
        Ok(length.into())
    }

    fn micros(&mut self) -> u32 {
        (self.clock)()
    }

    fn flush(&mut self) -> bool {
        self.outgoing == Outgoing::None
    }

    fn pre_transmission(&mut self) {
        (self.driver)(true);
    }

    fn post_transmission(&mut self) {
        (self.driver)(false);
    }
}

impl<C, E> Bridge<C, E> {
    const fn new(clock: C, driver: E) -> Self {
        Bridge {
            clock,
            driver,
            outgoing: Outgoing::None,
            is_lost: false,
            received: [0; PIECE],
            start: 0,
            end: 0,
        }
    }

    /// The place for received bytes; empty if the engine has to read first.
    fn place(&mut self) -> &mut [u8] {
        if self.start == self.end {
            self.start = 0;
            self.end = 0;
        }
        self.received.get_mut(self.end..).unwrap_or_default()
    }

    /// Notes that the device has filled `count` bytes of the place; 0 if it is at its end.
    fn note_received(&mut self, count: usize) {
        self.is_lost = count == 0;
        self.end = (self.end + count).min(PIECE);
    }
}

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
/// off. The next request can follow at once.
#[derive(Debug)]
pub struct AsyncMaster<D, C, T, S: Words, E = fn(bool)> {
    master: Master<Bridge<C, E>, S>,
    device: D,
    timer: T,
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
    pub const fn with_driver(
        unit: u8,
        device: D,
        clock: C,
        timer: T,
        buffers: S,
        driver: E,
    ) -> Self {
        AsyncMaster {
            master: Master::new(unit, Bridge::new(clock, driver), buffers),
            device,
            timer,
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
        &mut self.device
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
        start: impl FnOnce(&mut Master<Bridge<C, E>, S>) -> Result<(), Error>,
    ) -> Result<(), Error> {
        // A future that was forgotten, and not dropped, has left its request.
        self.master.cancel();
        let port = self.master.port();
        port.is_lost = false;
        port.outgoing = Outgoing::None;
        start(&mut self.master)?;
        let running = Running(self);
        running.0.take_old_bytes().await;
        loop {
            if let Poll::Ready(result) = running.0.master.poll() {
                return result;
            }
            running.0.go_on().await;
        }
    }

    /// Takes what arrived before the request, so that the engine does not search it for the reply.
    async fn take_old_bytes(&mut self) {
        // A device that has lost characters may say so before it returns the others.
        for _ in 0..2 {
            let port = self.master.port();
            let place = port.place();
            if place.is_empty() {
                return;
            }
            match first(self.device.read(place), ready(())).await {
                Some(Ok(count)) => return port.note_received(count),
                Some(Err(_)) => {}
                None => return,
            }
        }
    }

    /// Waits until the next poll has something to do.
    async fn go_on(&mut self) {
        let line = &mut self.master.line;
        if let Outgoing::Frame(length) = line.port.outgoing {
            let settings = &line.settings;
            let characters = u32::from(settings.any_character()) << 8;
            let limit = characters.saturating_add(settings.response_timeout.get());
            let frame = line.storage.slice(0, length);
            let device = &mut self.device;
            // Not `write_all`, which panics if the device takes no byte.
            let send = async {
                let mut rest = frame;
                while !rest.is_empty() {
                    match device.write(rest).await? {
                        0 => return Ok(false),
                        sent => rest = rest.get(sent..).unwrap_or_default(),
                    }
                }
                device.flush().await?;
                Ok::<_, D::Error>(true)
            };
            let sent = first(send, self.timer.delay_us(limit)).await;
            let port = &mut line.port;
            port.outgoing = match sent {
                Some(_) => Outgoing::None,
                None => Outgoing::Stuck,
            };
            port.is_lost = matches!(sent, Some(Ok(false) | Err(_)));
            return;
        }
        let delay = self.master.poll_delay();
        if !self.master.is_waiting() {
            // The device is stuck, or the driver stays on for `delay`.
            let pause = if delay == 0 { PAUSE } else { delay };
            return self.timer.delay_us(pause).await;
        }
        if delay == 0 {
            return;
        }
        let port = self.master.port();
        let place = port.place();
        if place.is_empty() {
            return self.timer.delay_us(delay).await;
        }
        match first(self.device.read(place), self.timer.delay_us(delay)).await {
            Some(Ok(count)) => port.note_received(count),
            // A device that fails at once again must not keep other tasks from running.
            Some(Err(_)) => self.timer.delay_us(delay.min(PAUSE)).await,
            None => {}
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
    &'a mut AsyncMaster<D, C, T, S, E>,
);

impl<D, C: FnMut() -> u32, T, S: Words, E: FnMut(bool)> Drop for Running<'_, D, C, T, S, E> {
    fn drop(&mut self) {
        self.0.master.cancel();
    }
}

/// The result of `future`; `None` if `timer` has ended before.
async fn first<F: Future>(future: F, timer: impl Future<Output = ()>) -> Option<F::Output> {
    let (mut future, mut timer) = (pin!(future), pin!(timer));
    poll_fn(|context| match future.as_mut().poll(context) {
        Poll::Ready(result) => Poll::Ready(Some(result)),
        Poll::Pending => timer.as_mut().poll(context).map(|()| None),
    })
    .await
}
