//! A port over the traits of the standard library.

use super::Port;
use crate::error::Error;
use std::io::{self, ErrorKind, Read, Write};
use std::net::{TcpStream, ToSocketAddrs};
use std::thread::sleep;
use std::time::{Duration, Instant};

/// The longest sleep in [`Port::idle`]: a byte that arrives meanwhile waits for as long.
const LONGEST_SLEEP: Duration = Duration::from_millis(1);

/// A port over a socket, a serial port or whatever else reads and writes without waiting. Its clock is
/// that of the system. A call that waits sleeps for up to a millisecond at a time.
///
/// ```no_run
/// use mbm::client::BlockingClient;
/// use mbm::port::StdIo;
///
/// let mut client = BlockingClient::tcp(StdIo::connect("192.168.1.10:502")?);
/// let [flow, total] = client.holding_registers(17, 107)?;
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug)]
pub struct StdIo<T> {
    io: T,
    begun: Instant,
    is_serial: bool,
}

impl StdIo<TcpStream> {
    /// Connects to a server, for example `"192.168.1.10:502"`.
    ///
    /// # Errors
    /// Why there is no connection.
    pub fn connect(address: impl ToSocketAddrs) -> io::Result<Self> {
        StdIo::accepted(TcpStream::connect(address)?)
    }

    /// A connection that a listener has accepted, or that was made otherwise. It is set to
    /// non-blocking, and sends each frame at once.
    ///
    /// ```no_run
    /// use mbm::port::StdIo;
    /// use mbm::server::{Server, Tables, Unit};
    /// use std::net::TcpListener;
    ///
    /// let mut unit = Unit::new(17, Tables::NONE.with_holding_registers(107, [555, 100, 0, 0]));
    /// let listener = TcpListener::bind("0.0.0.0:502")?;
    /// loop {
    ///     let connection = StdIo::accepted(listener.accept()?.0)?;
    ///     Server::tcp(connection).run(&mut unit);
    /// }
    /// # Ok::<(), std::io::Error>(())
    /// ```
    ///
    /// # Errors
    /// Why the socket cannot be set to this.
    pub fn accepted(stream: TcpStream) -> io::Result<Self> {
        stream.set_nonblocking(true)?;
        stream.set_nodelay(true)?;
        Ok(StdIo::stream(stream))
    }
}

impl<T> StdIo<T> {
    /// A connection that reads and writes without waiting. Its end is a lost link.
    ///
    /// ```no_run
    /// use mbm::port::StdIo;
    /// use std::os::unix::net::UnixStream;
    ///
    /// let socket = UnixStream::connect("/run/modbus.sock")?;
    /// socket.set_nonblocking(true)?;
    /// let mut port = StdIo::stream(socket);
    /// let address = port.get_mut().peer_addr()?;
    /// # Ok::<(), std::io::Error>(())
    /// ```
    pub fn stream(io: T) -> Self {
        let begun = Instant::now();
        StdIo {
            io,
            begun,
            is_serial: false,
        }
    }

    /// A serial port that reads and writes without waiting, or with a timeout of a few milliseconds. It
    /// does not say when the last byte has left, so client and server compute that from the baud rate.
    ///
    /// ```no_run
    /// use mbm::client::BlockingClient;
    /// use mbm::port::StdIo;
    /// use std::fs::File;
    ///
    /// # fn open() -> File { unimplemented!() }
    /// let line: File = open(); // Or that of the crate serialport.
    /// let mut client = BlockingClient::rtu(StdIo::serial(line));
    /// client.settings().set_baud_rate(19200);
    /// let [flow, total] = client.holding_registers(17, 107)?;
    /// # Ok::<(), mbm::Error>(())
    /// ```
    pub fn serial(io: T) -> Self {
        StdIo {
            is_serial: true,
            ..StdIo::stream(io)
        }
    }

    /// The socket or serial port.
    ///
    /// ```no_run
    /// use mbm::port::StdIo;
    ///
    /// let mut port = StdIo::connect("192.168.1.10:502")?;
    /// let server = port.get_mut().peer_addr()?;
    /// # Ok::<(), std::io::Error>(())
    /// ```
    pub fn get_mut(&mut self) -> &mut T {
        &mut self.io
    }

    /// What a read or write has done: 0 bytes if it would have to wait. A serial port has no end: it
    /// has no byte now.
    fn now(&self, result: io::Result<usize>) -> Result<usize, Error> {
        match result {
            Ok(0) if !self.is_serial => Err(Error::LinkLost),
            Ok(count) => Ok(count),
            Err(error) => match error.kind() {
                ErrorKind::WouldBlock | ErrorKind::Interrupted | ErrorKind::TimedOut => Ok(0),
                _ => Err(Error::LinkLost),
            },
        }
    }
}

impl<T: Read + Write> Port for StdIo<T> {
    fn read(&mut self, bytes: &mut [u8]) -> Result<usize, Error> {
        if bytes.is_empty() {
            return Ok(0);
        }
        let result = self.io.read(bytes);
        self.now(result)
    }

    fn write(&mut self, bytes: &[u8]) -> Result<usize, Error> {
        if bytes.is_empty() {
            return Ok(0);
        }
        let result = self.io.write(bytes);
        self.now(result)
    }

    fn micros(&mut self) -> u32 {
        self.begun.elapsed().as_micros() as u32
    }

    fn idle(&mut self, micros: u32) {
        sleep(Duration::from_micros(micros.into()).min(LONGEST_SLEEP));
    }

    fn knows_when_sent(&self) -> bool {
        !self.is_serial
    }
}
