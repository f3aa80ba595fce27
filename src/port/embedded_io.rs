//! A port over the traits of the crate embedded-io, for UARTs and sockets of a HAL.

use super::transmission::Transmission;
use super::Port;
use crate::error::Error;
use crate::time::MOST_BITS;
use ::embedded_io::{Read, ReadReady, Write, WriteReady};

/// A [`Port`] over a device that implements [`Read`], [`ReadReady`], [`Write`] and
/// [`WriteReady`].
///
/// `clock` returns the time in microseconds, which wraps at 2^32. The traits do not say when the last
/// byte has left, so set the baud rate: `settings().set_baud_rate(..)`.
///
/// ```
/// use embedded_io::{Read, ReadReady, Write, WriteReady};
/// use mbm::client::BlockingClient;
/// use mbm::port::EmbeddedIo;
///
/// fn read<U: Read + ReadReady + Write + WriteReady>(
///     uart: U,
///     micros: fn() -> u32,
///     switch_driver: fn(bool),
/// ) -> Result<[u16; 2], mbm::Error> {
///     let port = EmbeddedIo::serial(uart, micros).with_driver(switch_driver, 19200);
///     let mut client = BlockingClient::rtu(port);
///     client.settings().set_baud_rate(19200);
///     client.holding_registers(17, 107)
/// }
/// ```
#[derive(Clone, Debug)]
pub struct EmbeddedIo<D, C, E = fn(bool)> {
    /// The UART or socket.
    pub device: D,
    clock: C,
    driver: E,
    /// A read that fails has lost characters, and not the link.
    is_serial: bool,
    /// Of a baud rate that is known with an RS-485 driver only.
    transmission: Transmission,
}

impl<D, C> EmbeddedIo<D, C> {
    /// A port of a UART. A read that fails means that characters were damaged or lost, as after a
    /// framing error or an overrun: the CRC of the frame shows it. A write that fails means that
    /// the link is lost.
    pub const fn serial(uart: D, clock: C) -> Self {
        EmbeddedIo {
            device: uart,
            clock,
            driver: |_| {},
            is_serial: true,
            transmission: Transmission::UNKNOWN,
        }
    }

    /// A port of a socket or a USB serial port. An error, or the end of the stream, means that
    /// the link is lost.
    ///
    /// ```
    /// use embedded_io::{Read, ReadReady, Write, WriteReady};
    /// use mbm::client::BlockingClient;
    /// use mbm::port::EmbeddedIo;
    ///
    /// fn read<S: Read + ReadReady + Write + WriteReady>(
    ///     socket: S,
    ///     micros: fn() -> u32,
    /// ) -> Result<[u16; 2], mbm::Error> {
    ///     let mut client = BlockingClient::tcp(EmbeddedIo::stream(socket, micros));
    ///     client.holding_registers(17, 107)
    /// }
    /// ```
    pub const fn stream(socket: D, clock: C) -> Self {
        EmbeddedIo {
            device: socket,
            clock,
            driver: |_| {},
            is_serial: false,
            transmission: Transmission::UNKNOWN,
        }
    }

    /// As this port, with an RS-485 driver: `driver` switches it on with `true` before the
    /// first byte is sent, and off after the last one. The port computes from the baud rate
    /// when that byte has left; the driver stays on for one character more.
    ///
    /// A character has 11 bits here, as with a parity or a second stop bit. For one of 10 bits
    /// there is [`with_driver_and_bits`](Self::with_driver_and_bits).
    pub fn with_driver<E: FnMut(bool)>(self, driver: E, baud: u32) -> EmbeddedIo<D, C, E> {
        self.with_driver_and_bits(driver, baud, MOST_BITS)
    }

    /// As [`with_driver`](Self::with_driver), on a line whose characters have this number of bits, the start
    /// and stop bits included: 10 without a parity and with one stop bit. With 11 bits the driver would
    /// stay on for 25 characters too long after a frame of 256 bytes. A number that is too small cuts off the end.
    ///
    /// ```
    /// use embedded_io::{Read, ReadReady, Write, WriteReady};
    /// use mbm::port::{EmbeddedIo, Port};
    ///
    /// fn of_8n1<U: Read + ReadReady + Write + WriteReady>(
    ///     uart: U,
    ///     micros: fn() -> u32,
    ///     switch_driver: fn(bool),
    /// ) -> impl Port {
    ///     EmbeddedIo::serial(uart, micros).with_driver_and_bits(switch_driver, 19200, 10)
    /// }
    /// ```
    pub fn with_driver_and_bits<E: FnMut(bool)>(
        self,
        driver: E,
        baud: u32,
        bits: u8,
    ) -> EmbeddedIo<D, C, E> {
        EmbeddedIo {
            device: self.device,
            clock: self.clock,
            driver,
            is_serial: self.is_serial,
            transmission: Transmission::new(baud, bits),
        }
    }
}

impl<D, C, E> Port for EmbeddedIo<D, C, E>
where
    D: Read + ReadReady + Write + WriteReady,
    C: FnMut() -> u32,
    E: FnMut(bool),
{
    fn read(&mut self, bytes: &mut [u8]) -> Result<usize, Error> {
        let failed = match self.is_serial {
            true => Ok(0),
            false => Err(Error::LinkLost),
        };
        match self.device.read_ready() {
            Ok(false) => Ok(0),
            Ok(true) => match self.device.read(bytes) {
                Ok(0) if !bytes.is_empty() => failed,
                Ok(read) => Ok(read),
                Err(_) => failed,
            },
            Err(_) => failed,
        }
    }

    fn write(&mut self, bytes: &[u8]) -> Result<usize, Error> {
        match self.device.write_ready() {
            Ok(false) => Ok(0),
            Ok(true) => match self.device.write(bytes) {
                Ok(written) => {
                    self.transmission.note(written, (self.clock)());
                    Ok(written)
                }
                Err(_) => Err(Error::LinkLost),
            },
            Err(_) => Err(Error::LinkLost),
        }
    }

    fn micros(&mut self) -> u32 {
        (self.clock)()
    }

    fn flush(&mut self) -> bool {
        !self.knows_when_sent() || self.transmission.has_ended((self.clock)())
    }

    fn knows_when_sent(&self) -> bool {
        self.transmission.is_known()
    }

    fn pre_transmission(&mut self) {
        self.transmission.begin();
        (self.driver)(true);
    }

    fn post_transmission(&mut self) {
        (self.driver)(false);
    }
}
