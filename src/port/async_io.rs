//! A port over the traits of embedded-io-async, for UARTs and sockets that are awaited.

use super::Port;
use crate::error::Error;
use crate::time::{elapsed, Micros, Micros16};
use core::future::{poll_fn, ready, Future};
use core::pin::{pin, Pin};
use core::task::Poll;
use embedded_hal_async::delay::DelayNs;
use embedded_io_async::{Read, Write};

/// Bytes that are received in one piece.
const PIECE: usize = 64;

/// The pause before the next poll while the device does not go on, in microseconds.
const PAUSE: u32 = 200;

/// What is to be sent. The bytes stay in the buffer of the port's owner.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum Outgoing {
    /// Nothing.
    None,
    /// A frame, of which the device has taken the first `sent` bytes.
    Frame { length: u16, sent: u16 },
    /// The device did not take the frame in time.
    Stuck,
}

/// A [`Port`] over a device that is awaited, for clients and servers whose functions are futures:
///
/// ```
/// # include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/doc/executor.rs"));
/// use mbm::client::AsyncClient;
/// use mbm::port::AsyncIo;
///
/// async fn read() -> Result<[u16; 2], mbm::Error> {
///     let mut client = AsyncClient::rtu(AsyncIo::serial(uart(), micros, Delay));
///     client.settings().set_baud_rate(19200);
///     client.holding_registers(17, 107).await
/// }
/// # fn main() { assert_eq!(block_on(read()), Ok([555, 100])); }
/// ```
///
/// They await the device. For a client or server that is polled, the port receives nothing.
///
/// - `D` is the device: [`Read`] and [`Write`] of embedded-io-async. Its read must lose no byte if
///   its future is dropped, as a UART with a receive buffer does; and a socket must have sent none if
///   the future of a write is dropped.
/// - `C` is the clock, in microseconds, which wraps at 2^32. `T` is [`DelayNs`] of
///   embedded-hal-async. An executor's timer has both.
// The port accepts each frame as a whole. Its owner polls the core, then awaits `send` if the core has
// written a frame, otherwise `receive` or `pause`.
#[derive(Debug)]
pub struct AsyncIo<D, C, T, E = fn(bool)> {
    /// The UART or socket.
    pub device: D,
    clock: C,
    timer: T,
    driver: E,
    /// A read that fails has lost characters, and not the link. A link that was lost is tried again.
    is_serial: bool,
    outgoing: Outgoing,
    is_lost: bool,
    received: [u8; PIECE],
    /// The range of `received` that the core has not read yet.
    start: usize,
    end: usize,
}

impl<D, C: FnMut() -> u32, T, E: FnMut(bool)> Port for AsyncIo<D, C, T, E> {
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
        if self.is_lost && !self.is_serial {
            return Err(Error::LinkLost);
        }
        // The core writes the whole frame in one call, as all of it is accepted.
        let length = bytes.len() as u16;
        self.outgoing = Outgoing::Frame { length, sent: 0 };
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

impl<D, C, T> AsyncIo<D, C, T> {
    /// A port of a UART. A read that fails means that characters were damaged or lost, as after a
    /// framing error or an overrun. A write or flush that fails, and a read or write of 0 bytes, mean
    /// that the link is lost; the next request tries it again.
    pub const fn serial(uart: D, clock: C, timer: T) -> Self {
        AsyncIo::serial_with_driver(uart, clock, timer, |_| {})
    }

    /// A port of a socket, or of another stream that keeps all bytes in order, as USB. An error, the
    /// end of the stream, or a frame that the socket does not take in time, mean that the link is lost,
    /// until the program has opened it anew.
    ///
    /// ```
    /// # include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/doc/executor.rs"));
    /// # async fn read() -> Result<[u16; 2], mbm::Error> {
    /// # use mbm::{client::AsyncClient, port::AsyncIo};
    /// let mut client = AsyncClient::tcp(AsyncIo::stream(socket(), micros, Delay));
    /// client.holding_registers(17, 107).await
    /// # }
    /// # fn main() { assert_eq!(block_on(read()), Ok([555, 100])); }
    /// ```
    pub const fn stream(socket: D, clock: C, timer: T) -> Self {
        AsyncIo::new(socket, clock, timer, |_| {}, false)
    }
}

impl<D, C, T, E> AsyncIo<D, C, T, E> {
    /// As [`AsyncIo::serial`], with an RS-485 driver: `driver` switches it on with `true` before the
    /// first byte is sent, and off after the last one.
    ///
    /// ```
    /// # include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/doc/executor.rs"));
    /// # async fn read() -> Result<[u16; 2], mbm::Error> {
    /// # use mbm::{client::AsyncClient, port::AsyncIo};
    /// # use std::cell::Cell;
    /// # let pin = Cell::new(false);
    /// let driver = |is_on| pin.set(is_on);
    /// let port = AsyncIo::serial_with_driver(uart(), micros, Delay, driver);
    /// let mut client = AsyncClient::rtu(port);
    /// client.holding_registers(17, 107).await
    /// # }
    /// # fn main() { assert_eq!(block_on(read()), Ok([555, 100])); }
    /// ```
    pub const fn serial_with_driver(uart: D, clock: C, timer: T, driver: E) -> Self {
        AsyncIo::new(uart, clock, timer, driver, true)
    }

    const fn new(device: D, clock: C, timer: T, driver: E, is_serial: bool) -> Self {
        AsyncIo {
            device,
            clock,
            timer,
            driver,
            is_serial,
            outgoing: Outgoing::None,
            is_lost: false,
            received: [0; PIECE],
            start: 0,
            end: 0,
        }
    }

    /// Begins a request, or what else the core may send. A serial line that was lost is tried again. If
    /// the device has taken a part of the frame of a request that was given up, a stream keeps it, since
    /// its rest is to be sent before any other. On a serial line that part is to leave: the frame that
    /// follows must be a frame by itself.
    pub(crate) fn begin(&mut self) {
        self.outgoing = match self.outgoing {
            Outgoing::Frame { length, sent } if sent > 0 => Outgoing::Frame {
                length: if self.is_serial { sent } else { length },
                sent,
            },
            _ => Outgoing::None,
        };
        if self.is_serial {
            self.is_lost = false;
        }
    }

    /// Forgets all that belongs to a link that was lost: a new one is in its place.
    pub(crate) fn reconnect(&mut self) {
        self.outgoing = Outgoing::None;
        self.is_lost = false;
        self.end = self.start;
    }

    /// True if the device did not take a frame in time.
    pub(crate) fn is_stuck(&self) -> bool {
        self.outgoing == Outgoing::Stuck
    }

    /// True if the link is lost.
    pub(crate) fn is_lost(&self) -> bool {
        self.is_lost
    }

    /// How many received bytes the core has not read.
    pub(crate) fn unread(&self) -> usize {
        self.end - self.start
    }

    /// The length of the frame that is being sent, and how many of its bytes the device has taken.
    pub(crate) fn progress(&self) -> (u16, u16) {
        match self.outgoing {
            Outgoing::Frame { length, sent } => (length, sent),
            Outgoing::None | Outgoing::Stuck => (0, 0),
        }
    }

    /// The length of the frame that the core has written and that is to be sent; `None` if there is
    /// none.
    pub(crate) fn frame_length(&self) -> Option<u16> {
        match self.outgoing {
            Outgoing::Frame { length, .. } => Some(length),
            Outgoing::None | Outgoing::Stuck => None,
        }
    }

    /// The place for received bytes; empty if the core has to read first.
    fn place(&mut self) -> (&mut D, &mut T, &mut [u8]) {
        if self.start == self.end {
            self.start = 0;
            self.end = 0;
        }
        let place = self.received.get_mut(self.end..).unwrap_or_default();
        (&mut self.device, &mut self.timer, place)
    }

    /// Notes whether the link is lost.
    fn note_link(&mut self, is_lost: bool) {
        self.is_lost = is_lost || self.is_lost && !self.is_serial;
    }

    /// Notes that the device has filled `count` bytes of the place; 0 if it is at its end.
    fn note_received(&mut self, count: usize) {
        self.note_link(count == 0);
        self.end = (self.end + count).min(PIECE);
    }
}

impl<D: Read + Write, C: FnMut() -> u32, T: DelayNs, E> AsyncIo<D, C, T, E> {
    /// As [`AsyncIo::send`]. On a serial line with a known time of a character it also waits until the
    /// bytes can have left: some UARTs end a flush while bytes are left in the hardware.
    pub(crate) async fn send_and_hold(&mut self, frame: &[u8], limit: u32, character: Micros16) {
        let begun = (self.clock)();
        self.send(frame, limit).await;
        let has_sent = self.outgoing == Outgoing::None && !self.is_lost;
        if self.is_serial && has_sent && character > 0 {
            let passed = elapsed((self.clock)(), begun);
            let left = hold(character, frame.len() as u16, passed);
            // The core keeps the driver on after a flush that was right, if that is set.
            if left > character.into() {
                self.timer.delay_us(left).await;
            }
        }
    }
}

impl<D: Read + Write, C, T: DelayNs, E> AsyncIo<D, C, T, E> {
    /// Takes what arrived before a request, so that the core does not search it for the reply.
    pub(crate) async fn take_old_bytes(&mut self) {
        // A device that has lost characters may say so before it returns the others.
        for _ in 0..2 {
            let (device, _, place) = self.place();
            if place.is_empty() {
                return;
            }
            let read = first(pin!(device.read(place)), pin!(ready(()))).await;
            match read {
                Some(Ok(count)) => return self.note_received(count),
                Some(Err(_)) => self.note_link(!self.is_serial),
                None => return,
            }
        }
    }

    /// Sends `frame`, the one that the core has written. The device has `limit` microseconds for it.
    pub(crate) async fn send(&mut self, frame: &[u8], limit: u32) {
        let (device, outgoing) = (&mut self.device, &mut self.outgoing);
        // Not `write_all`, which panics if the device takes no byte.
        let sent = first(
            pin!(async {
                while let Outgoing::Frame { length, sent } = *outgoing {
                    let rest = frame.get(sent.into()..length.into()).unwrap_or_default();
                    if rest.is_empty() {
                        break;
                    }
                    let taken = device.write(rest).await?.min(rest.len()) as u16;
                    if taken == 0 {
                        return Ok(false);
                    }
                    let sent = sent + taken;
                    *outgoing = Outgoing::Frame { length, sent };
                }
                device.flush().await?;
                Ok::<_, D::Error>(true)
            }),
            pin!(self.timer.delay_us(limit)),
        )
        .await;
        self.outgoing = match sent {
            None if self.is_serial => Outgoing::Stuck,
            _ => Outgoing::None,
        };
        self.note_link(match sent {
            Some(Ok(true)) => false,
            Some(Ok(false) | Err(_)) => true,
            // The rest of the frame would be taken for the beginning of the next one.
            None => !self.is_serial,
        });
    }

    /// Waits for `delay` microseconds, or until bytes have arrived.
    pub(crate) async fn receive(&mut self, delay: u32) {
        let is_lost = self.is_lost;
        let (device, timer, place) = self.place();
        if is_lost {
            // The core has to see it.
            return timer.delay_us(delay.min(PAUSE)).await;
        }
        if place.is_empty() {
            return timer.delay_us(delay).await;
        }
        let read = first(pin!(device.read(place)), pin!(timer.delay_us(delay))).await;
        match read {
            Some(Ok(count)) => self.note_received(count),
            Some(Err(_)) if !self.is_serial => self.is_lost = true,
            // A device that fails at once again must not keep other tasks from running.
            Some(Err(_)) => self.timer.delay_us(delay.min(PAUSE)).await,
            None => {}
        }
    }

    /// Waits for `delay` microseconds after a frame was sent.
    pub(crate) async fn hold(&mut self, delay: u32) {
        if delay > 0 && !self.is_lost && !self.is_stuck() {
            self.timer.delay_us(delay).await;
        }
    }

    /// Waits for `delay` microseconds; for a moment if it is 0, because the core does not know when
    /// the device goes on.
    pub(crate) async fn pause(&mut self, delay: u32) {
        let delay = if delay == 0 { PAUSE } else { delay };
        self.timer.delay_us(delay).await;
    }
}

/// The time for which a driver stays on after a flush that has ended `passed` microseconds after the
/// first of so many characters: for one more, and for all if the flush was too early. Characters of 10
/// bits cannot have left before; `character` has 11.
pub(crate) const fn hold(character: Micros16, count: u16, passed: Micros) -> Micros {
    let character = character as Micros;
    let time = character * count as Micros;
    if passed >= time / 11 * 10 {
        return character;
    }
    (time + character).saturating_sub(passed)
}

/// The result of `future`; `None` if `timer` has ended before.
async fn first<F: Future, T: Future<Output = ()>>(
    mut future: Pin<&mut F>,
    mut timer: Pin<&mut T>,
) -> Option<F::Output> {
    poll_fn(|context| match future.as_mut().poll(context) {
        Poll::Ready(result) => Poll::Ready(Some(result)),
        Poll::Pending => timer.as_mut().poll(context).map(|()| None),
    })
    .await
}
