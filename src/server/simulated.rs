//! A port at whose other end units answer.

use super::framing::{respond, DELIMITER};
use super::Units;
use crate::bytes::copy;
use crate::error::Error;
use crate::frame::{tcp, Framing};
use crate::port::Port;

/// Bytes of the longest frame.
const LONGEST: usize = Framing::Ascii.max_frame();

/// Microseconds that pass with each look at the clock.
const STEP: u32 = 100;

/// A [`Port`] at whose other end units answer, without a UART or socket: for tests of a program with a
/// master or client. The examples of this crate use it.
///
/// ```
/// use mbm::client::BlockingClient;
/// use mbm::server::{SimulatedPort, Tables, Unit};
///
/// let meter = Unit::new(17, Tables::NONE.with_holding_registers(107, [555, 100]));
/// let mut client = BlockingClient::tcp(SimulatedPort::tcp(meter));
/// client.write_single_register(17, 108, 200)?;
/// assert_eq!(client.holding_registers(17, 107)?, [555, 200]);
/// // The port is a part of the client, and the meter of the port.
/// assert_eq!(client.port().units.device.holding_registers.cells, [555, 200]);
/// # Ok::<(), mbm::Error>(())
/// ```
///
/// Each frame is answered at once. The clock advances with each look at it, so a test does not wait
/// for a timeout either.
#[derive(Debug)]
pub struct SimulatedPort<U> {
    /// The units, as of [`Server::serve`](super::Server::serve).
    pub units: U,
    /// True if nothing is answered, as if the cable were cut.
    pub is_silent: bool,
    /// The number of frames that were sent to the units.
    pub frames: u32,
    framing: Framing,
    now: u32,
    /// The answers, from index `start` to before `end`, that were not read yet.
    answers: [u8; 2 * LONGEST],
    start: usize,
    end: usize,
}

impl<U: Units> SimulatedPort<U> {
    const fn new(framing: Framing, units: U) -> Self {
        SimulatedPort {
            units,
            is_silent: false,
            frames: 0,
            framing,
            now: 0,
            answers: [0; 2 * LONGEST],
            start: 0,
            end: 0,
        }
    }

    /// A serial line with RTU frames.
    ///
    /// ```
    /// use mbm::client::BlockingClient;
    /// use mbm::server::{SimulatedPort, Tables, Unit};
    ///
    /// let meter = Unit::new(17, Tables::NONE.with_holding_registers(107, [555, 100]));
    /// let mut client = BlockingClient::rtu(SimulatedPort::rtu(meter));
    /// assert_eq!(client.holding_registers(17, 107), Ok([555, 100]));
    ///
    /// client.port().is_silent = true;
    /// assert_eq!(client.holding_registers::<2>(17, 107), Err(mbm::Error::ResponseTimedOut));
    /// ```
    pub const fn rtu(units: U) -> Self {
        SimulatedPort::new(Framing::Rtu, units)
    }

    /// A serial line with ASCII frames.
    ///
    /// ```
    /// use mbm::client::BlockingClient;
    /// use mbm::server::{SimulatedPort, Tables, Unit};
    ///
    /// let meter = Unit::new(17, Tables::NONE.with_holding_registers(107, [555, 100]));
    /// let mut client = BlockingClient::ascii(SimulatedPort::ascii(meter));
    /// assert_eq!(client.holding_registers(17, 107), Ok([555, 100]));
    /// ```
    pub const fn ascii(units: U) -> Self {
        SimulatedPort::new(Framing::Ascii, units)
    }

    /// A connection with Modbus TCP frames.
    ///
    /// ```
    /// use mbm::client::BlockingClient;
    /// use mbm::server::{SimulatedPort, Tables, Unit};
    ///
    /// // A unit with the id 0 answers whichever id a TCP frame has.
    /// let pump = Unit::new(0, Tables::NONE.with_coils(0, [true, false]));
    /// let mut client = BlockingClient::tcp(SimulatedPort::tcp(pump));
    /// assert_eq!(client.coils(255, 0), Ok([true, false]));
    /// ```
    pub const fn tcp(units: U) -> Self {
        SimulatedPort::new(Framing::Tcp, units)
    }

    /// A connection with RTU frames.
    ///
    /// ```
    /// use mbm::client::BlockingClient;
    /// use mbm::server::{SimulatedPort, Tables, Unit};
    ///
    /// let meter = Unit::new(17, Tables::NONE.with_holding_registers(107, [555, 100]));
    /// let mut client = BlockingClient::rtu_over_tcp(SimulatedPort::rtu_over_tcp(meter));
    /// assert_eq!(client.holding_registers(17, 107), Ok([555, 100]));
    /// ```
    pub const fn rtu_over_tcp(units: U) -> Self {
        SimulatedPort::new(Framing::RtuOverTcp, units)
    }

    /// Takes the first frame of `bytes`, unless there is no place for its answer. Returns how many
    /// bytes it has.
    fn take(&mut self, bytes: &[u8]) -> usize {
        if self.start == self.end {
            (self.start, self.end) = (0, 0);
        }
        let length = match (self.framing, tcp::header(bytes)) {
            (Framing::Tcp, Ok(header)) => header.total,
            _ => bytes.len(),
        };
        let length = length.min(bytes.len());
        let Some(place) = self.answers.get_mut(self.end..self.end + LONGEST) else {
            return 0;
        };
        self.frames = self.frames.wrapping_add(1);
        if !self.is_silent && length <= LONGEST {
            copy(place, bytes.get(..length).unwrap_or_default());
            // A unit that is not finished does not answer.
            let answer = respond(self.framing, DELIMITER, place, length, &mut self.units);
            self.end += answer.unwrap_or(0);
        }
        length
    }

    /// Takes answers out.
    fn give(&mut self, bytes: &mut [u8]) -> usize {
        let answers = self.answers.get(self.start..self.end).unwrap_or_default();
        copy(bytes, answers);
        let count = answers.len().min(bytes.len());
        self.start += count;
        count
    }
}

impl<U: Units> Port for SimulatedPort<U> {
    fn read(&mut self, bytes: &mut [u8]) -> Result<usize, Error> {
        Ok(self.give(bytes))
    }

    fn write(&mut self, bytes: &[u8]) -> Result<usize, Error> {
        Ok(self.take(bytes))
    }

    fn micros(&mut self) -> u32 {
        self.now = self.now.wrapping_add(STEP);
        self.now
    }

    fn idle(&mut self, micros: u32) {
        self.now = self.now.wrapping_add(micros);
    }
}

/// A device for [`AsyncMaster`](crate::master::AsyncMaster) and the like. A read waits until there is an
/// answer.
#[cfg(feature = "embedded-io-async")]
mod awaited {
    use super::{SimulatedPort, Units};
    use core::convert::Infallible;
    use core::future::poll_fn;
    use core::task::Poll;
    use embedded_io_async::{ErrorType, Read, Write};

    impl<U> ErrorType for SimulatedPort<U> {
        type Error = Infallible;
    }

    /// Waits until `step` has done something.
    async fn until_some(mut step: impl FnMut() -> usize) -> usize {
        poll_fn(|context| match step() {
            0 => {
                context.waker().wake_by_ref();
                Poll::Pending
            }
            count => Poll::Ready(count),
        })
        .await
    }

    impl<U: Units> Read for SimulatedPort<U> {
        async fn read(&mut self, bytes: &mut [u8]) -> Result<usize, Infallible> {
            match bytes.is_empty() {
                true => Ok(0),
                false => Ok(until_some(|| self.give(bytes)).await),
            }
        }
    }

    impl<U: Units> Write for SimulatedPort<U> {
        async fn write(&mut self, bytes: &[u8]) -> Result<usize, Infallible> {
            match bytes.is_empty() {
                true => Ok(0),
                false => Ok(until_some(|| self.take(bytes)).await),
            }
        }

        async fn flush(&mut self) -> Result<(), Infallible> {
            Ok(())
        }
    }
}
