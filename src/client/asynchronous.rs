//! A client whose functions are futures, over the traits of embedded-io-async.

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
use crate::port::{AsyncIo, Port};
use core::future::Future;
use embedded_hal_async::delay::DelayNs;
use embedded_io_async::{Read, Write};

/// A client whose functions are futures: each function of the standard, and functions of the user,
/// on a serial line (RTU, ASCII), on TCP, and in RTU frames through TCP.
///
/// ```
/// # include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/doc/executor.rs"));
/// use mbm::client::AsyncClient;
/// use mbm::port::AsyncIo;
///
/// async fn read() -> Result<[u16; 2], mbm::Error> {
///     let mut client = AsyncClient::tcp(AsyncIo::stream(socket(), micros, Delay));
///     client.holding_registers(17, 107).await
/// }
/// # fn main() { assert_eq!(block_on(read()), Ok([555, 100])); }
/// ```
///
/// A client has one request at a time. Tasks that share it do so by the mutex of their executor.
///
/// If the future of a request is dropped, the request is cancelled, and the RS-485 driver is switched
/// off. Another request may follow at once. It waits until what a UART has taken of the frame has left,
/// and sends what a socket has not taken: the device would take the rest for the beginning of the next
/// frame. A late reply to the request is not taken for the reply to another.
///
/// After [`Error::LinkLost`] on a stream all requests end with it, and are not sent, until the
/// program has opened the link anew, and calls [`AsyncClient::reconnect`].
///
/// A call leaves its request inside the client while it waits, so its future is small. `D` is as in
/// [`BlockingClient`](super::BlockingClient).
///
/// ```
/// # include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/doc/pump.rs"));
/// # include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/doc/executor.rs"));
/// # async fn example() -> Result<(), mbm::Error> {
/// # let port = mbm::port::AsyncIo::stream(tcp(), micros, Delay);
/// # let mut client = mbm::client::AsyncClient::tcp(port);
/// client.settings().response_timeout.set_timeout(500)?;
/// client.policy().retries = 2;
/// client.holding_registers::<2>(17, 107).await?;
/// assert_eq!(client.unanswered(), 0);
/// client.storage();
/// client.line().set_in_flight(1);
/// // After a lost connection: a new one, and the rest of the old one does not count.
/// client.port().device = tcp();
/// client.reconnect();
/// # Ok(())
/// # }
/// # fn main() { assert_eq!(block_on(example()), Ok(())); }
/// ```
///
/// ```
/// # include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/doc/pump.rs"));
/// # include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/doc/executor.rs"));
/// # async fn example() -> Result<(), mbm::Error> {
/// # let port = mbm::port::AsyncIo::stream(tcp(), micros, Delay);
/// # let mut client = mbm::client::AsyncClient::tcp(port);
/// client.settings().response_timeout.set_timeout(500)?;
/// client.policy().retries = 2;
/// client.holding_registers::<2>(17, 107).await?;
/// assert_eq!(client.unanswered(), 0);
/// client.storage();
/// client.line().set_in_flight(1);
/// // After a lost connection: a new one, and the rest of the old one does not count.
/// client.port().device = tcp();
/// client.reconnect();
/// # Ok(())
/// # }
/// # fn main() { assert_eq!(block_on(example()), Ok(())); }
/// ```
#[derive(Debug)]
pub struct AsyncClient<L, const D: usize = CALL_BYTES> {
    client: Client<L, Call<D>, 1>,
}

impl<P: Port> AsyncClient<Serial<P, Frame<[u8; 256]>, Call>> {
    /// A client on a serial line with RTU frames. Set the baud rate:
    ///
    /// ```
    /// # include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/doc/executor.rs"));
    /// # async fn read() -> Result<[u16; 2], mbm::Error> {
    /// use mbm::client::AsyncClient;
    /// use mbm::port::AsyncIo;
    ///
    /// let mut client = AsyncClient::rtu(AsyncIo::serial(uart(), micros, Delay));
    /// client.settings().set_baud_rate(19200);
    /// let [flow, total] = client.holding_registers(17, 107).await?;
    /// # Ok([flow, total])
    /// # }
    /// # fn main() { assert_eq!(block_on(read()), Ok([555, 100])); }
    /// ```
    pub const fn rtu(port: P) -> Self {
        AsyncClient::new(Serial::new(port, Frame::new([0; 256])))
    }

    /// A client that sends RTU frames through a TCP stream.
    ///
    /// ```
    /// # include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/doc/executor.rs"));
    /// # async fn read() -> Result<[u16; 2], mbm::Error> {
    /// # use mbm::{client::AsyncClient, port::AsyncIo};
    /// # let socket = uart;
    /// let mut client = AsyncClient::rtu_over_tcp(AsyncIo::stream(socket(), micros, Delay));
    /// client.holding_registers(17, 107).await
    /// # }
    /// # fn main() { assert_eq!(block_on(read()), Ok([555, 100])); }
    /// ```
    pub const fn rtu_over_tcp(port: P) -> Self {
        AsyncClient {
            client: Client::over_tcp(port, Frame::new([0; 256])),
        }
    }
}

impl<P: Port> AsyncClient<Serial<P, Frame<[u8; 513]>, Call>> {
    /// A client on a serial line with ASCII frames.
    ///
    /// ```
    /// # include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/doc/executor.rs"));
    /// # async fn read() -> Result<[u16; 2], mbm::Error> {
    /// # use mbm::{client::AsyncClient, port::AsyncIo};
    /// # let uart = ascii_uart;
    /// let mut client = AsyncClient::ascii(AsyncIo::serial(uart(), micros, Delay));
    /// client.settings().set_baud_rate(9600);
    /// client.holding_registers(17, 107).await
    /// # }
    /// # fn main() { assert_eq!(block_on(read()), Ok([555, 100])); }
    /// ```
    pub const fn ascii(port: P) -> Self {
        AsyncClient::new(Serial::ascii(port, Frame::new([0; 513])))
    }
}

impl<P: Port> AsyncClient<Tcp<P, TcpBuffers<[u8; 260], [u8; 260]>>> {
    /// A client on Modbus TCP. See the example at [`AsyncClient`].
    pub const fn tcp(port: P) -> Self {
        AsyncClient::new(Tcp::new(port, TcpBuffers::new([0; 260], [0; 260])))
    }
}

impl<L: Transport<Call<D>>, const D: usize> AsyncClient<L, D> {
    /// A client on this line, with buffers of your choice and a place for `D` bytes of data.
    ///
    /// ```
    /// # include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/doc/executor.rs"));
    /// # async fn read() -> Result<[u16; 2], mbm::Error> {
    /// use mbm::client::{AsyncClient, Frame, Serial};
    /// use mbm::port::AsyncIo;
    ///
    /// // Up to 20 registers.
    /// let line = Serial::new(AsyncIo::serial(uart(), micros, Delay), Frame::new([0; 50]));
    /// let mut client: AsyncClient<_, 40> = AsyncClient::new(line);
    /// client.holding_registers(17, 107).await
    /// # }
    /// # fn main() { assert_eq!(block_on(read()), Ok([555, 100])); }
    /// ```
    pub const fn new(line: L) -> Self {
        AsyncClient {
            client: Client::new(line),
        }
    }

    accessors! {
        "# include!(concat!(env!(\"CARGO_MANIFEST_DIR\"), \"/tests/doc/executor.rs\"));
# fn main() -> Result<(), mbm::Error> {
# let port = mbm::port::AsyncIo::stream(tcp(), micros, Delay);
# let mut client = mbm::client::AsyncClient::tcp(port);"
    }
}

impl<L, U, C, T, E, const D: usize> AsyncClient<L, D>
where
    L: Transport<Call<D>, Port = AsyncIo<U, C, T, E>>,
{
    /// Call this after the link was opened anew: see [`Client::reconnect`].
    ///
    /// ```
    /// # include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/doc/executor.rs"));
    /// # async fn read() -> Result<[u16; 2], mbm::Error> {
    /// # use mbm::{client::AsyncClient, port::AsyncIo, Error};
    /// # let connect = socket;
    /// # let mut client = AsyncClient::tcp(AsyncIo::stream(connect(), micros, Delay));
    /// loop {
    ///     match client.holding_registers(17, 107).await {
    ///         Err(Error::LinkLost) => {
    ///             client.port().device = connect();
    ///             client.reconnect();
    ///         }
    ///         result => return result,
    ///     }
    /// }
    /// # }
    /// # fn main() { assert_eq!(block_on(read()), Ok([555, 100])); }
    /// ```
    pub fn reconnect(&mut self) {
        self.client.port().reconnect();
        self.client.reconnect();
    }
}

impl<L, U, C, T, E, const D: usize> AsyncClient<L, D>
where
    L: Transport<Call<D>, Port = AsyncIo<U, C, T, E>>,
    U: Read + Write,
    C: FnMut() -> u32,
    T: DelayNs,
    E: FnMut(bool),
{
    /// Sends a request, and returns it with the response once it has ended. It is queued before the
    /// future is made, so that the future need not hold it.
    fn call(&mut self, request: Call<D>) -> impl Future<Output = Result<Call<D>, Error>> {
        // A future that was forgotten, and not dropped, has left its request.
        let _ = self.client.cancel(|_| true);
        let queued = self.client.queue(request).map_err(Error::from);
        let running = queued.map(|()| Running(&mut self.client));
        async {
            let running = running?;
            running.0.port().begin();
            // The device may answer a request whose frame is sent to its end only now.
            if send(running.0).await {
                let now = running.0.port().micros();
                running.0.line.note_sent_late(now);
            }
            running.0.port().take_old_bytes().await;
            loop {
                let now = running.0.port().micros();
                if let Some(ended) = running.0.poll(now) {
                    return ended.result();
                }
                go_on(running.0, now).await;
            }
        }
    }

    calls! { async; .await }
}

/// A pending request. If the future that has it is dropped, the request is cancelled.
struct Running<'a, L: Transport<Call<D>>, const D: usize>(&'a mut Client<L, Call<D>, 1>);

impl<L: Transport<Call<D>>, const D: usize> Drop for Running<'_, L, D> {
    fn drop(&mut self) {
        let _ = self.0.cancel(|_| true);
    }
}

/// Sends what is left of a frame. False if there is none.
async fn send<L, U, C, T, E, const D: usize>(client: &mut Client<L, Call<D>, 1>) -> bool
where
    L: Transport<Call<D>, Port = AsyncIo<U, C, T, E>>,
    U: Read + Write,
    C: FnMut() -> u32,
    T: DelayNs,
{
    let Some(length) = client.port().frame_length() else {
        return false;
    };
    let settings = client.settings();
    let characters = u32::from(settings.any_character()) * u32::from(length);
    let limit = characters.saturating_add(settings.response_timeout.get());
    let character = settings.character;
    let (port, frame) = client.line.accepted(length);
    port.send_and_hold(frame, limit, character).await;
    true
}

/// Waits until the next poll has something to do.
async fn go_on<L, U, C, T, E, const D: usize>(client: &mut Client<L, Call<D>, 1>, now: u32)
where
    L: Transport<Call<D>, Port = AsyncIo<U, C, T, E>>,
    U: Read + Write,
    C: FnMut() -> u32,
    T: DelayNs,
{
    if send(client).await {
        return;
    }
    let delay = client.poll_delay(now);
    let port = client.port();
    if delay > 0 {
        port.receive(delay).await;
    } else if port.is_stuck() {
        port.pause(0).await;
    }
}
