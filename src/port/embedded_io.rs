//! A port over the traits of the crate embedded-io, for UARTs and sockets of a HAL.

use super::Port;
use crate::error::Error;
use crate::time::{character, elapsed, Micros, Micros16};
use ::embedded_io::{Read, ReadReady, Write, WriteReady};

/// A [`Port`] over a device that implements [`Read`], [`ReadReady`], [`Write`] and
/// [`WriteReady`].
///
/// `clock` returns the time in microseconds, which wraps at 2^32. The traits do not say when the last
/// byte has left, so set the baud rate: `settings().set_baud_rate(..)`.
#[derive(Clone, Debug)]
pub struct EmbeddedIo<D, C, E = fn(bool)> {
    /// The UART or socket.
    pub device: D,
    clock: C,
    driver: E,
    /// A read that fails has lost characters, and not the link.
    is_serial: bool,
    /// The time of a character, with an RS-485 driver; 0 without one.
    character: Micros16,
    /// The accepted bytes have left `wait` microseconds after `since`.
    since: Micros,
    wait: Micros,
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
            character: 0,
            since: 0,
            wait: 0,
        }
    }

    /// A port of a socket or a USB serial port. An error, or the end of the stream, means that
    /// the link is lost.
    pub const fn stream(socket: D, clock: C) -> Self {
        EmbeddedIo {
            device: socket,
            clock,
            driver: |_| {},
            is_serial: false,
            character: 0,
            since: 0,
            wait: 0,
        }
    }

    /// As this port, with an RS-485 driver: `driver` switches it on with `true` before the
    /// first byte is sent, and off after the last one. The port computes from the baud rate
    /// when that byte has left; the driver stays on for one character more.
    pub fn with_driver<E: FnMut(bool)>(self, driver: E, baud: u32) -> EmbeddedIo<D, C, E> {
        EmbeddedIo {
            device: self.device,
            clock: self.clock,
            driver,
            is_serial: self.is_serial,
            character: character(baud),
            since: self.since,
            wait: self.wait,
        }
    }
}

impl<D, C: FnMut() -> u32, E> EmbeddedIo<D, C, E> {
    /// Notes that the device has accepted bytes.
    fn note_sent(&mut self, bytes: usize) {
        let (now, character) = ((self.clock)(), u32::from(self.character));
        if elapsed(now, self.since) >= self.wait {
            self.since = now;
            self.wait = character;
        }
        let more = character.saturating_mul(bytes as u32);
        self.wait = self.wait.saturating_add(more);
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
                    self.note_sent(written);
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
        !self.knows_when_sent() || elapsed((self.clock)(), self.since) >= self.wait
    }

    fn knows_when_sent(&self) -> bool {
        self.character > 0
    }

    fn pre_transmission(&mut self) {
        // The last frame has left, however long ago: the clock may have wrapped.
        self.wait = 0;
        (self.driver)(true);
    }

    fn post_transmission(&mut self) {
        (self.driver)(false);
    }
}
