//! A port over the traits of embedded-io-async, whose futures it polls once.

use super::transmission::Transmission;
use super::Port;
use crate::error::Error;
use crate::time::MOST_BITS;
use core::future::Future;
use core::pin::pin;
use core::task::{Context, Poll, Waker};
use embedded_io_async::{Read, Write};

/// A [`Port`] over a device that implements [`Read`] and [`Write`] of embedded-io-async, as the UARTs
/// and sockets of embassy do. It is for what polls: a client, a server, a master whose calls wait.
///
/// Each read, write and flush polls the future of the device once, and drops it. So the device must
/// lose no byte if its future is dropped: a dropped read leaves the bytes for the next one, and a
/// dropped write has sent nothing. A UART with buffers keeps this (`BufferedUart`,
/// `RingBufferedUartRx`), and so does a socket. A UART that begins a DMA transfer in the future does
/// not, and neither does a stream with TLS.
///
/// On tokio, poll on a thread of its own (`spawn_blocking`): in a task tokio lets a device succeed only 128
/// times between two awaits, and then it seems silent.
///
/// `clock` returns the time in microseconds, which wraps at 2^32. Some UARTs end a flush before the
/// last byte has left, so set the baud rate: `settings().set_baud_rate(..)`.
///
/// ```
/// use embedded_io_async::{Read, Write};
/// use mbm::client::BlockingClient;
/// use mbm::port::PolledIo;
///
/// fn read(uart: impl Read + Write, micros: fn() -> u32) -> Result<[u16; 2], mbm::Error> {
///     let mut client = BlockingClient::rtu(PolledIo::serial(uart, micros));
///     client.settings().set_baud_rate(19200);
///     client.holding_registers(17, 107)
/// }
/// ```
#[derive(Clone, Debug)]
pub struct PolledIo<D, C, E = fn(bool)> {
    /// The UART or socket.
    pub device: D,
    clock: C,
    driver: E,
    /// A read that fails has lost characters, and not the link.
    is_serial: bool,
    /// Of a baud rate that is known with an RS-485 driver only.
    transmission: Transmission,
    /// A stream that may hold bytes back until it is flushed.
    is_unflushed: bool,
    /// A flush has failed, and no read or write has said so.
    is_lost: bool,
    waker: Option<Waker>,
}

impl<D, C> PolledIo<D, C> {
    /// A port of a UART. A read that fails means that characters were damaged or lost, as after a
    /// framing error or an overrun: the CRC of the frame shows it. A write or flush that fails means
    /// that the link is lost.
    pub const fn serial(uart: D, clock: C) -> Self {
        PolledIo::new(uart, clock, true)
    }

    /// A port of a socket or a USB serial port. An error, or the end of the stream, means that
    /// the link is lost.
    ///
    /// ```
    /// use embedded_io_async::{Read, Write};
    /// use mbm::client::BlockingClient;
    /// use mbm::port::PolledIo;
    ///
    /// fn read(socket: impl Read + Write, micros: fn() -> u32) -> Result<[u16; 2], mbm::Error> {
    ///     let mut client = BlockingClient::tcp(PolledIo::stream(socket, micros));
    ///     client.holding_registers(17, 107)
    /// }
    /// ```
    pub const fn stream(socket: D, clock: C) -> Self {
        PolledIo::new(socket, clock, false)
    }

    const fn new(device: D, clock: C, is_serial: bool) -> Self {
        PolledIo {
            device,
            clock,
            driver: |_| {},
            is_serial,
            transmission: Transmission::UNKNOWN,
            is_unflushed: false,
            is_lost: false,
            waker: None,
        }
    }

    /// As this port, with an RS-485 driver: `driver` switches it on with `true` before the
    /// first byte is sent, and off after the last one. That has left once the device is flushed, and
    /// once its time has passed at this baud rate; the driver stays on for one character more.
    ///
    /// ```
    /// use embedded_io_async::{Read, Write};
    /// use mbm::client::BlockingClient;
    /// use mbm::port::PolledIo;
    ///
    /// fn read<U: Read + Write>(
    ///     uart: U,
    ///     micros: fn() -> u32,
    ///     switch_driver: fn(bool),
    /// ) -> Result<[u16; 2], mbm::Error> {
    ///     let port = PolledIo::serial(uart, micros).with_driver(switch_driver, 19200);
    ///     let mut client = BlockingClient::rtu(port);
    ///     client.settings().set_baud_rate(19200);
    ///     client.holding_registers(17, 107)
    /// }
    /// ```
    ///
    /// A character has 11 bits here, as with a parity or a second stop bit. For one of 10 bits
    /// there is [`with_driver_and_bits`](Self::with_driver_and_bits).
    pub fn with_driver<E: FnMut(bool)>(self, driver: E, baud: u32) -> PolledIo<D, C, E> {
        self.with_driver_and_bits(driver, baud, MOST_BITS)
    }

    /// As [`with_driver`](Self::with_driver), on a line whose characters have this number of bits, the start
    /// and stop bits included: 10 without a parity and with one stop bit. With 11 bits the driver would
    /// stay on for 25 characters too long after a frame of 256 bytes. A number that is too small may cut off the end.
    ///
    /// ```
    /// use embedded_io_async::{Read, Write};
    /// use mbm::port::{PolledIo, Port};
    ///
    /// fn of_8n1<U: Read + Write>(
    ///     uart: U,
    ///     micros: fn() -> u32,
    ///     switch_driver: fn(bool),
    /// ) -> impl Port {
    ///     PolledIo::serial(uart, micros).with_driver_and_bits(switch_driver, 19200, 10)
    /// }
    /// ```
    pub fn with_driver_and_bits<E: FnMut(bool)>(
        self,
        driver: E,
        baud: u32,
        bits: u8,
    ) -> PolledIo<D, C, E> {
        PolledIo {
            device: self.device,
            clock: self.clock,
            driver,
            is_serial: self.is_serial,
            transmission: Transmission::new(baud, bits),
            is_unflushed: self.is_unflushed,
            is_lost: self.is_lost,
            waker: self.waker,
        }
    }
}

impl<D, C, E> PolledIo<D, C, E> {
    /// From now on, the device wakes this task when bytes have arrived, or when it takes bytes again. For
    /// a program that polls in a task of an executor, and sleeps in between:
    ///
    /// ```
    /// use core::future::poll_fn;
    /// use core::task::Poll;
    /// use embedded_io_async::{Read, Write};
    /// use mbm::port::PolledIo;
    /// use mbm::server::{Server, Tables, Unit};
    ///
    /// async fn serve(socket: impl Read + Write, micros: fn() -> u32) {
    ///     let mut unit = Unit::new(17, Tables::NONE.with_holding_registers(107, [555, 100]));
    ///     let mut server = Server::tcp(PolledIo::stream(socket, micros));
    ///     poll_fn(|context| {
    ///         server.port.set_waker(context.waker());
    ///         while server.serve(micros(), &mut unit).is_ok() {
    ///             // On a serial line, a timer of the executor is to end the sleep after this time.
    ///             if server.poll_delay(micros()) > 0 {
    ///                 return Poll::Pending;
    ///             }
    ///         }
    ///         Poll::Ready(())
    ///     })
    ///     .await
    /// }
    /// ```
    pub fn set_waker(&mut self, waker: &Waker) {
        match &mut self.waker {
            Some(old) => old.clone_from(waker),
            None => self.waker = Some(waker.clone()),
        }
    }

    /// The count of a read or write that has ended. A serial line that fails, or has done nothing, is
    /// tried again: in that case the device wakes nobody.
    fn ended(&self, count: Option<usize>) -> Result<usize, Error> {
        match count {
            Some(count) if count > 0 => Ok(count),
            _ if !self.is_serial => Err(Error::LinkLost),
            _ => {
                if let Some(waker) = &self.waker {
                    waker.wake_by_ref();
                }
                Ok(0)
            }
        }
    }
}

impl<D: Write, C, E> PolledIo<D, C, E> {
    /// Flushes the device. Returns false if it is not flushed yet.
    fn try_flush(&mut self) -> bool {
        let Poll::Ready(flushed) = poll(&self.waker, self.device.flush()) else {
            return false;
        };
        self.is_lost |= flushed.is_err();
        self.is_unflushed = false;
        true
    }
}

impl<D, C, E> Port for PolledIo<D, C, E>
where
    D: Read + Write,
    C: FnMut() -> u32,
    E: FnMut(bool),
{
    fn read(&mut self, bytes: &mut [u8]) -> Result<usize, Error> {
        // Without a byte to read the device would be at its end.
        if bytes.is_empty() {
            return Ok(0);
        }
        if self.is_unflushed {
            self.try_flush();
        }
        if core::mem::take(&mut self.is_lost) {
            return Err(Error::LinkLost);
        }
        match poll(&self.waker, self.device.read(bytes)) {
            Poll::Pending => Ok(0),
            Poll::Ready(read) => self.ended(read.ok()),
        }
    }

    fn write(&mut self, bytes: &[u8]) -> Result<usize, Error> {
        if bytes.is_empty() {
            return Ok(0);
        }
        if core::mem::take(&mut self.is_lost) {
            return Err(Error::LinkLost);
        }
        let written = match poll(&self.waker, self.device.write(bytes)) {
            Poll::Pending => return Ok(0),
            Poll::Ready(Ok(written)) => self.ended(Some(written))?,
            Poll::Ready(Err(_)) => return Err(Error::LinkLost),
        };
        self.transmission.note(written, (self.clock)());
        if !self.is_serial {
            self.is_unflushed = true;
            self.try_flush();
        }
        Ok(written)
    }

    fn micros(&mut self) -> u32 {
        (self.clock)()
    }

    fn flush(&mut self) -> bool {
        // A socket may be flushed only once the peer has acknowledged all bytes.
        let is_flushed = !self.is_serial || self.try_flush();
        is_flushed && (!self.transmission.is_known() || self.transmission.has_ended((self.clock)()))
    }

    fn knows_when_sent(&self) -> bool {
        self.transmission.is_known() || !self.is_serial
    }

    fn pre_transmission(&mut self) {
        self.transmission.begin();
        (self.driver)(true);
    }

    fn post_transmission(&mut self) {
        (self.driver)(false);
    }
}

/// Polls a future once, and drops it.
fn poll<F: Future>(waker: &Option<Waker>, future: F) -> Poll<F::Output> {
    let waker = waker.as_ref().unwrap_or(Waker::noop());
    pin!(future).poll(&mut Context::from_waker(waker))
}
