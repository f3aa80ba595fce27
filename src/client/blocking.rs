//! A client whose calls wait for their end.

use super::accessors::{accessor, accessors};
use super::call::{
    take_records, Call, CommEventCounter, CommEventLog, Groups, ReadRecords, WriteRecords,
    CALL_BYTES,
};
use super::calls::{calls, example};
use super::storage::TcpBuffers;
use super::tcp::Tcp;
use super::transaction::Serial;
use super::{Client, Policy, Transport};
use crate::engine::{Frame, Settings};
use crate::error::Error;
use crate::pdu::custom::Rule;
use crate::pdu::functions::{coil_value, FunctionSpec};
use crate::pdu::identification::{DeviceIdCode, IdentificationReply};
use crate::pdu::identification_stream::{Next, ObjectStream};
use crate::pdu::{quantity, MAX_READ_BITS, MAX_READ_REGISTERS};
use crate::port::Port;

/// A client whose calls wait for their end: each function of the standard, and functions of the
/// user, on a serial line (RTU, ASCII), on TCP, and in RTU frames through TCP.
///
/// ```
/// # include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/doc/device.rs"));
/// use mbm::client::BlockingClient;
///
/// # fn main() -> Result<(), mbm::Error> {
/// # let port = device(Framing::Tcp);
/// let mut client = BlockingClient::tcp(port);
/// let [flow, total] = client.holding_registers(17, 107)?;
/// assert_eq!([flow, total], [555, 100]);
///
/// let mut words = [0; 4];
/// client.write_multiple_registers(17, 107, &[1, 2, 3])?;
/// client.read_holding_registers(17, 107, &mut words)?;
/// assert_eq!(words, [1, 2, 3, 0]);
/// # Ok(())
/// # }
/// ```
///
/// A quantity that is known when the program is compiled, and that the standard does not allow, does
/// not compile:
///
/// ```compile_fail
/// # include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/doc/device.rs"));
/// # fn main() -> Result<(), mbm::Error> {
/// # let mut client = mbm::client::BlockingClient::tcp(device(Framing::Tcp));
/// let words: [u16; 126] = client.holding_registers(17, 0)?; // 125 is the most.
/// # Ok(())
/// # }
/// ```
///
/// ```compile_fail
/// # include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/doc/pump.rs"));
/// # fn main() -> Result<(), mbm::Error> {
/// # let mut client = mbm::client::BlockingClient::tcp(tcp());
/// let coils: [bool; 2001] = client.coils(17, 0)?; // 2000 is the most.
/// # Ok(())
/// # }
/// ```
///
/// Nor does a number that is no code of a device identification:
///
/// ```compile_fail
/// # include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/doc/pump.rs"));
/// # fn main() -> Result<(), mbm::Error> {
/// # let mut client = mbm::client::BlockingClient::tcp(tcp());
/// client.read_device_identification(17, 7, 0, &mut [0; 250])?;
/// # Ok(())
/// # }
/// ```
///
/// Between two polls the client calls [`Port::idle`], in which a port may sleep. A program that must
/// not wait queues a [`Request`](super::Request) in a [`Client`]; the client here has such a one
/// inside, with a queue for one request.
///
/// `D` is how many bytes of data the client has a place for. It takes three times as many bytes of
/// RAM: firmware that reads only 20 registers at once may have a [`BlockingClient::new`] of 40.
///
/// ```
/// # include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/doc/pump.rs"));
/// # fn main() -> Result<(), mbm::Error> {
/// # let mut client = mbm::client::BlockingClient::tcp(tcp());
/// client.settings().response_timeout.set_timeout(500)?;
/// client.policy().retries = 2;
/// client.holding_registers::<2>(17, 107)?;
/// assert_eq!(client.unanswered(), 0);
/// assert_eq!(client.port().frames, 1);
/// // The memory of the client, and its line.
/// let (_buffers, _line) = (client.storage(), ());
/// client.line().set_in_flight(1);
/// // After a lost connection: a new one, and the rest of the old one does not count.
/// *client.port() = tcp();
/// client.reconnect();
/// # Ok(())
/// # }
/// ```
///
/// ```
/// # include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/doc/pump.rs"));
/// # fn main() -> Result<(), mbm::Error> {
/// # let mut client = mbm::client::BlockingClient::tcp(tcp());
/// client.settings().response_timeout.set_timeout(500)?;
/// client.policy().retries = 2;
/// client.holding_registers::<2>(17, 107)?;
/// assert_eq!(client.unanswered(), 0);
/// assert_eq!(client.port().frames, 1);
/// // The memory of the client, and its line.
/// let (_buffers, _line) = (client.storage(), ());
/// client.line().set_in_flight(1);
/// // After a lost connection: a new one, and the rest of the old one does not count.
/// *client.port() = tcp();
/// client.reconnect();
/// # Ok(())
/// # }
/// ```
#[derive(Debug)]
pub struct BlockingClient<L, const D: usize = CALL_BYTES> {
    client: Client<L, Call<D>, 1>,
}

impl<P: Port> BlockingClient<Serial<P, Frame<[u8; 256]>, Call>> {
    /// A client on a serial line with RTU frames. Set the baud rate:
    ///
    /// ```
    /// # include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/doc/device.rs"));
    /// # fn main() -> Result<(), mbm::Error> {
    /// # let port = device(Framing::Rtu);
    /// let mut client = mbm::client::BlockingClient::rtu(port);
    /// client.settings().set_baud_rate(19200);
    /// assert_eq!(client.holding_registers(17, 107)?, [555, 100]);
    /// # Ok(())
    /// # }
    /// ```
    pub const fn rtu(port: P) -> Self {
        BlockingClient::new(Serial::new(port, Frame::new([0; 256])))
    }

    /// A client that sends RTU frames through a TCP stream.
    ///
    /// ```
    /// # include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/doc/device.rs"));
    /// # fn main() -> Result<(), mbm::Error> {
    /// # let port = device(Framing::RtuOverTcp);
    /// let mut client = mbm::client::BlockingClient::rtu_over_tcp(port);
    /// assert_eq!(client.holding_registers(17, 107)?, [555, 100]);
    /// # Ok(())
    /// # }
    /// ```
    pub const fn rtu_over_tcp(port: P) -> Self {
        BlockingClient {
            client: Client::over_tcp(port, Frame::new([0; 256])),
        }
    }
}

impl<P: Port> BlockingClient<Serial<P, Frame<[u8; 513]>, Call>> {
    /// A client on a serial line with ASCII frames.
    ///
    /// ```
    /// # include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/doc/device.rs"));
    /// # fn main() -> Result<(), mbm::Error> {
    /// # let port = device(Framing::Ascii);
    /// let mut client = mbm::client::BlockingClient::ascii(port);
    /// client.settings().set_baud_rate(9600);
    /// assert_eq!(client.holding_registers(17, 107)?, [555, 100]);
    /// # Ok(())
    /// # }
    /// ```
    pub const fn ascii(port: P) -> Self {
        BlockingClient::new(Serial::ascii(port, Frame::new([0; 513])))
    }
}

impl<P: Port> BlockingClient<Tcp<P, TcpBuffers<[u8; 260], [u8; 260]>>> {
    /// A client on Modbus TCP. See the example at [`BlockingClient`].
    pub const fn tcp(port: P) -> Self {
        BlockingClient::new(Tcp::new(port, TcpBuffers::new([0; 260], [0; 260])))
    }
}

impl<L: Transport<Call<D>>, const D: usize> BlockingClient<L, D> {
    /// A client on this line, with buffers of your choice and a place for `D` bytes of data.
    ///
    /// ```
    /// # include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/doc/device.rs"));
    /// use mbm::client::{BlockingClient, Frame, Serial};
    ///
    /// # fn main() -> Result<(), mbm::Error> {
    /// # let port = device(Framing::Rtu);
    /// // Up to 20 registers.
    /// let mut client: BlockingClient<_, 40> =
    ///     BlockingClient::new(Serial::new(port, Frame::new([0; 50])));
    /// assert_eq!(client.holding_registers(17, 107)?, [555, 100]);
    /// assert_eq!(client.holding_registers::<21>(17, 107), Err(mbm::Error::BufferTooSmall));
    /// # Ok(())
    /// # }
    /// ```
    pub const fn new(line: L) -> Self {
        BlockingClient {
            client: Client::new(line),
        }
    }

    /// Call this after the link was opened anew: see [`Client::reconnect`].
    ///
    /// ```
    /// # include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/doc/pump.rs"));
    /// # fn main() -> Result<(), mbm::Error> {
    /// # let mut client = mbm::client::BlockingClient::tcp(tcp());
    /// # let connect = tcp;
    /// if client.holding_registers::<2>(17, 107) == Err(mbm::Error::LinkLost) {
    ///     *client.port() = connect();
    ///     client.reconnect();
    /// }
    /// # Ok(())
    /// # }
    /// ```
    pub fn reconnect(&mut self) {
        self.client.reconnect();
    }

    accessors! {
        "# fn main() -> Result<(), mbm::Error> {
    # let mut client = mbm::client::BlockingClient::tcp(tcp());"
    }
}

impl<L: Transport<Call<D>, Port: Port>, const D: usize> BlockingClient<L, D> {
    /// Sends a request, waits until it has ended, and returns it with the response.
    fn call(&mut self, request: Call<D>) -> Result<Call<D>, Error> {
        self.client.queue(request)?;
        loop {
            let now = self.client.port().micros();
            if let Some(ended) = self.client.poll(now) {
                return ended.result();
            }
            let delay = self.client.poll_delay(now);
            if delay > 0 {
                self.client.port().idle(delay);
            }
        }
    }

    calls! { ; }
}
