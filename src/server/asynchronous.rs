//! A server whose functions are futures, over the traits of embedded-io-async.

use super::line::{Server, ServerPhase, ServerStorage, UNKNOWN_CHARACTER};
use super::{Addressing, Indication, Reply, Units};
use crate::error::{Error, Status};
use crate::frame::{rtu, Framing};
use crate::port::{hold, AsyncIo, Port};
use crate::time::{elapsed, millis, Micros, LONGEST};
use core::future::{ready, Future};
use embedded_hal_async::delay::DelayNs;
use embedded_io_async::{Read, Write};

/// The time that a device has to take a response, in addition to that of the characters: a UART, and
/// a socket, whose client may have stopped reading.
const UART_TIMEOUT: Micros = millis(2_000);
const SOCKET_TIMEOUT: Micros = millis(10_000);

/// The units of an [`AsyncServer`]. All [`Units`] are such units. Implement this trait if they await
/// something: a mutex of your executor, a sensor, another line.
///
/// ```
/// # include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/doc/executor.rs"));
/// use mbm::pdu::request::Request;
/// use mbm::pdu::response::Response;
/// use mbm::port::AsyncIo;
/// use mbm::server::{Addressing, AsyncServer, AsyncUnits, Indication, Reply};
///
/// /// Unit 17, which serves input register 0.
/// struct Thermometer;
///
/// # impl Thermometer { async fn measure(&mut self) -> u16 { 215 } }
/// impl AsyncUnits for Thermometer {
///     async fn answer(&mut self, info: &Indication, pdu: &mut [u8]) -> Reply {
///         if info.to != 17 || info.addressing(pdu[0]) != Addressing::OWN {
///             return Reply::NO_RESPONSE;
///         }
///         match Request::parse(&pdu[..info.length.into()]) {
///             Ok(Request::ReadRegisters { function: 4, address: 0, quantity: 1 }) => {
///                 let data = &self.measure().await.to_be_bytes();
///                 let response = Response::ReadRegisters { function: 4, data };
///                 response.emit(pdu).map_or(Reply::SERVER_DEVICE_FAILURE, Reply::length)
///             }
///             Ok(Request::ReadRegisters { function: 4, .. }) => Reply::ILLEGAL_DATA_ADDRESS,
///             _ => Reply::ILLEGAL_FUNCTION,
///         }
///     }
/// }
///
/// # async fn run() {
/// # let wire = wire(&[17, 4, 0, 0, 0, 1, 0x33, 0x5A]);
/// # let socket = wire.clone();
/// let mut server = AsyncServer::rtu_over_tcp(AsyncIo::stream(socket, micros, Delay));
/// let lost = server.run(&mut Thermometer).await;
/// # assert_eq!(lost, mbm::Error::LinkLost);
/// # assert_eq!(wire.sent(), [17, 4, 2, 0, 215, 0x38, 0xAD]);
/// # }
/// # fn main() { block_on(run()) }
/// ```
pub trait AsyncUnits {
    /// As [`Units::serve`]. If the future is dropped, the next call gets the same request: leave `pdu`
    /// as it is until nothing more is awaited.
    fn answer(&mut self, info: &Indication, pdu: &mut [u8]) -> impl Future<Output = Reply>;

    /// As [`Units::has`].
    ///
    /// ```
    /// use mbm::server::{AsyncUnits, Indication, Reply};
    ///
    /// /// Unit 17 of a device that is read by a future.
    /// struct Sensor;
    ///
    /// impl AsyncUnits for Sensor {
    ///     async fn answer(&mut self, _: &Indication, _: &mut [u8]) -> Reply {
    ///         Reply::SERVER_DEVICE_FAILURE
    ///     }
    ///
    ///     fn contains(&self, unit: u8) -> bool {
    ///         unit == 17
    ///     }
    /// }
    /// ```
    fn contains(&self, unit: u8) -> bool {
        let _ = unit;
        true
    }
}

impl<U: Units + ?Sized> AsyncUnits for U {
    fn answer(&mut self, info: &Indication, pdu: &mut [u8]) -> impl Future<Output = Reply> {
        ready(Units::serve(self, info, pdu))
    }

    fn contains(&self, unit: u8) -> bool {
        Units::has(self, unit)
    }
}

/// A server on one line or connection, whose functions are futures. `P` is an [`AsyncIo`], `B` the
/// frame buffer.
///
/// ```
/// # include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/doc/executor.rs"));
/// use mbm::port::AsyncIo;
/// use mbm::server::{AsyncServer, Tables, Unit};
///
/// # async fn run() {
/// # let uart = wire(&[17, 6, 0x00, 0x6D, 0x03, 0x78, 0x1A, 0x55]);
/// let mut server = AsyncServer::rtu(AsyncIo::serial(uart, micros, Delay));
/// server.set_baud_rate(9600);
/// let mut unit = Unit::new(17, Tables::NONE.with_holding_registers(107, [555, 100, 0, 0]));
/// assert_eq!(server.run(&mut unit).await, mbm::Error::LinkLost);
/// // A master wrote 888 to register 109.
/// assert_eq!(unit.device.holding_registers.cells, [555, 100, 888, 0]);
/// # }
/// # fn main() { block_on(run()) }
/// ```
///
/// You may drop a future of the server, for example in a `select`, and call it again. A request that
/// was received, or received in part, is served then. A response that was sent in part
///
/// - is sent to its end on a stream: the client would take the rest for the beginning of the next one;
/// - on a serial line goes on if the server runs again within the silence that ends a frame. Otherwise
///   it is given up, because the line may belong to others by then. The RS-485 driver goes off when the
///   future is dropped. So a program that drops often awaits [`AsyncServer::serve`] to its end, or
///   gives the server a task.
///
/// ```
/// # include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/doc/executor.rs"));
/// # use mbm::{port::AsyncIo, server::AsyncServer};
/// # fn main() {
/// // For a line on which an adapter holds bytes back, and a driver that must stay on for longer:
/// let mut server = AsyncServer::rtu(AsyncIo::serial(uart(), micros, Delay));
/// server.set_baud_rate(9600);
/// server.set_silence(5000);
/// server.set_receive_latency(20);
/// server.set_echo_discard(true);
/// server.set_post_flush_hold(2);
/// assert_eq!(server.storage().len(), 256);
/// # }
/// ```
#[derive(Debug)]
pub struct AsyncServer<P, B> {
    server: Server<P, B>,
    /// When the response was begun.
    begun: Micros,
    /// When the future was dropped that was sending.
    stopped: Micros,
    /// The time up to which the driver stays on after a frame.
    held: Micros,
    post_flush_characters: u8,
}

impl<P: Port> AsyncServer<P, [u8; 256]> {
    /// A server on a serial line with RTU frames, with a buffer for any. Set the baud rate. See the
    /// example at [`AsyncServer`].
    pub const fn rtu(port: P) -> Self {
        AsyncServer::new(Server::rtu(port))
    }

    /// A server of RTU frames in a TCP stream, with a buffer for any. See the example at
    /// [`AsyncUnits`].
    ///
    /// ```
    /// # include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/doc/executor.rs"));
    /// # use mbm::{port::AsyncIo, server::{AsyncServer, Tables, Unit}};
    /// # async fn run() {
    /// # let socket = wire(&[17, 6, 0x00, 0x6D, 0x03, 0x78, 0x1A, 0x55]);
    /// # let mut unit = Unit::new(17, Tables::NONE.with_holding_registers(109, [0]));
    /// let mut server = AsyncServer::rtu_over_tcp(AsyncIo::stream(socket, micros, Delay));
    /// let lost = server.run(&mut unit).await;
    /// # assert_eq!(lost, mbm::Error::LinkLost);
    /// # assert_eq!(unit.device.holding_registers.cells, [888]);
    /// # }
    /// # fn main() { block_on(run()) }
    /// ```
    pub const fn rtu_over_tcp(port: P) -> Self {
        AsyncServer::new(Server::rtu_over_tcp(port))
    }
}

impl<P: Port> AsyncServer<P, [u8; 513]> {
    /// A server on a serial line with ASCII frames, with a buffer for any.
    ///
    /// ```
    /// # include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/doc/executor.rs"));
    /// # use mbm::{port::AsyncIo, server::{AsyncServer, Tables, Unit}};
    /// # async fn run() {
    /// # let uart = wire(b":1106006D037801\r\n");
    /// # let mut unit = Unit::new(17, Tables::NONE.with_holding_registers(109, [0]));
    /// let mut server = AsyncServer::ascii(AsyncIo::serial(uart, micros, Delay));
    /// let lost = server.run(&mut unit).await;
    /// # assert_eq!(lost, mbm::Error::LinkLost);
    /// # assert_eq!(unit.device.holding_registers.cells, [888]);
    /// # }
    /// # fn main() { block_on(run()) }
    /// ```
    pub const fn ascii(port: P) -> Self {
        AsyncServer::new(Server::ascii(port))
    }
}

impl<P: Port> AsyncServer<P, [u8; 260]> {
    /// A server of one connection on Modbus TCP, with a buffer for any frame.
    ///
    /// ```
    /// # include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/doc/executor.rs"));
    /// # use mbm::{port::AsyncIo, server::{AsyncServer, Tables, Unit}};
    /// # async fn run() {
    /// # let socket = wire(&[0, 1, 0, 0, 0, 6, 17, 6, 0x00, 0x6D, 0x03, 0x78]);
    /// # let mut unit = Unit::new(17, Tables::NONE.with_holding_registers(109, [0]));
    /// let mut server = AsyncServer::tcp(AsyncIo::stream(socket, micros, Delay));
    /// let lost = server.run(&mut unit).await;
    /// # assert_eq!(lost, mbm::Error::LinkLost);
    /// # assert_eq!(unit.device.holding_registers.cells, [888]);
    /// # }
    /// # fn main() { block_on(run()) }
    /// ```
    pub const fn tcp(port: P) -> Self {
        AsyncServer::new(Server::tcp(port))
    }
}

impl<P: Port, B: ServerStorage> AsyncServer<P, B> {
    const fn new(server: Server<P, B>) -> Self {
        AsyncServer {
            server,
            begun: 0,
            stopped: 0,
            held: 0,
            post_flush_characters: 0,
        }
    }

    /// As [`Server::with_framing`].
    ///
    /// ```
    /// # include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/doc/executor.rs"));
    /// use mbm::frame::Framing;
    /// use mbm::port::AsyncIo;
    /// use mbm::server::AsyncServer;
    ///
    /// # fn main() {
    /// // Frames of up to 64 bytes.
    /// let port = AsyncIo::serial(uart(), micros, Delay);
    /// let mut server = AsyncServer::with_framing(Framing::Rtu, port, [0; 64]);
    /// server.set_baud_rate(19200);
    /// # }
    /// ```
    pub fn with_framing(framing: Framing, port: P, storage: B) -> Self {
        AsyncServer::new(Server::with_framing(framing, port, storage))
    }

    /// As [`Server::set_baud_rate`].
    pub fn set_baud_rate(&mut self, baud: u32) {
        self.server.set_baud_rate(baud);
    }

    /// As [`Server::set_silence`].
    pub const fn set_silence(&mut self, microseconds: u32) {
        self.server.set_silence(microseconds);
    }

    /// As [`Server::set_receive_latency`].
    pub fn set_receive_latency(&mut self, milliseconds: u16) {
        self.server.set_receive_latency(milliseconds);
    }

    /// As [`Server::set_echo_discard`].
    pub fn set_echo_discard(&mut self, on: bool) -> bool {
        self.server.set_echo_discard(on)
    }

    /// Keeps the RS-485 driver on for the time of so many characters after each flush, for a UART whose
    /// flush ends while bytes are left in the hardware. With 0, as at first, that time is one character
    /// if the baud rate is set, and more after a flush that was too early for all bytes to have left. A
    /// UART that leaves several bytes behind a long response needs the number of them.
    ///
    /// ```
    /// # include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/doc/executor.rs"));
    /// # use mbm::{port::AsyncIo, server::AsyncServer};
    /// # fn switch_driver(_: bool) {}
    /// # fn main() {
    /// let port = AsyncIo::serial_with_driver(uart(), micros, Delay, switch_driver);
    /// let mut server = AsyncServer::rtu(port);
    /// server.set_baud_rate(19200);
    /// // A transmitter with 32 bytes, whose flush does not wait for them.
    /// server.set_post_flush_hold(32);
    /// // The receiver gets what the driver sends.
    /// server.set_echo_discard(true);
    /// // The UART hands bytes over at once.
    /// server.set_receive_latency(0);
    /// # }
    /// ```
    pub const fn set_post_flush_hold(&mut self, characters: u8) {
        self.post_flush_characters = characters;
    }

    /// The port, with the device.
    pub const fn port(&mut self) -> &mut P {
        &mut self.server.port
    }

    /// The buffer.
    pub const fn storage(&mut self) -> &mut B {
        &mut self.server.storage
    }
}

impl<D, C, T, E, B> AsyncServer<AsyncIo<D, C, T, E>, B>
where
    C: FnMut() -> u32,
    E: FnMut(bool),
    B: ServerStorage,
{
    /// Call this after the link was opened anew, as for the next client of a socket: all that belongs
    /// to the old one is forgotten.
    ///
    /// ```
    /// # include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/doc/executor.rs"));
    /// # use mbm::{port::AsyncIo, server::{AsyncServer, Tables, Unit}};
    /// # async fn accept() -> Wire { wire(&[0, 1, 0, 0, 0, 6, 17, 6, 0x00, 0x6D, 0x03, 0x78]) }
    /// # async fn run() {
    /// # let mut unit = Unit::new(17, Tables::NONE.with_holding_registers(109, [0]));
    /// let mut server = AsyncServer::tcp(AsyncIo::stream(accept().await, micros, Delay));
    /// loop {
    ///     let lost = server.run(&mut unit).await;
    ///     # if std::mem::take(&mut unit.device.holding_registers.cells) == [0] { return; }
    ///     server.port().device = accept().await;
    ///     server.reconnect();
    ///     # server.port().device = wire(&[]);
    /// }
    /// # }
    /// # fn main() { block_on(run()) }
    /// ```
    pub fn reconnect(&mut self) {
        let server = &mut self.server;
        server.port.reconnect();
        if server.phase == ServerPhase::Send {
            server.give_up_response();
        }
        if server.request.is_serial() {
            server.listen();
        } else if server.keeps_time() {
            server.begin_rtu_over_tcp();
        } else {
            server.begin_tcp();
        }
    }
}

impl<D, C, T, E, B> AsyncServer<AsyncIo<D, C, T, E>, B>
where
    D: Read + Write,
    C: FnMut() -> u32,
    T: DelayNs,
    E: FnMut(bool),
    B: ServerStorage,
{
    /// Serves requests until the link is lost, or the client sends what is not Modbus: see
    /// [`AsyncServer::serve`], and the example at [`AsyncServer`].
    pub async fn run(&mut self, units: &mut (impl AsyncUnits + ?Sized)) -> Error {
        let mut result = self.resume().await;
        loop {
            match result {
                Ok(()) => result = self.serve_next(units).await,
                Err(error) => return error,
            }
        }
    }

    /// Waits for a request, lets the units serve it, and sends the response, if there is one. Requests
    /// to other units of the line count too.
    ///
    /// ```
    /// # include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/doc/executor.rs"));
    /// # use mbm::{port::AsyncIo, server::{AsyncServer, Tables, Unit}};
    /// # async fn run() -> Result<(), mbm::Error> {
    /// # let uart = wire(&[17, 6, 0x00, 0x6D, 0x03, 0x78, 0x1A, 0x55]);
    /// # let mut server = AsyncServer::rtu(AsyncIo::serial(uart, micros, Delay));
    /// # let mut unit = Unit::new(17, Tables::NONE.with_holding_registers(109, [0]));
    /// loop {
    ///     server.serve(&mut unit).await?;
    ///     if unit.device.holding_registers.cells[0] == 888 {
    ///         // What the program does with the value stands here.
    ///         # return Ok(());
    ///     }
    /// }
    /// # }
    /// # fn main() { assert_eq!(block_on(run()), Ok(())) }
    /// ```
    ///
    /// # Errors
    /// [`Error::LinkLost`]: the connection has ended, or takes no bytes; the UART fails to send, or has
    /// read 0 bytes. [`Error::MalformedFrame`]: what the client sends is not Modbus TCP; close the
    /// connection.
    pub async fn serve(&mut self, units: &mut (impl AsyncUnits + ?Sized)) -> Result<(), Error> {
        self.resume().await?;
        self.serve_next(units).await
    }

    async fn serve_next(&mut self, units: &mut (impl AsyncUnits + ?Sized)) -> Result<(), Error> {
        let server = &mut self.server;
        loop {
            let now = server.port.micros();
            // Not in the `match`: a borrow of units that are not `Sync` would outlive an await.
            let found = server.look_for(now, &|unit| units.contains(unit));
            match found {
                Status::PENDING => {
                    let info = server.request;
                    let function = server.pdu().first().copied().unwrap_or(0);
                    let mut reply = units.answer(&info, server.pdu()).await;
                    let is_for_units = info.addressing(function) == Addressing::OWN;
                    if reply != Reply::PENDING && (!is_for_units || receive_newer(server).await) {
                        reply = Reply::NO_RESPONSE;
                    }
                    if server.answer(reply) {
                        self.begun = server.port.micros();
                        return self.send().await;
                    }
                    let delay = server.poll_delay(now);
                    server.port.pause(delay).await;
                    continue;
                }
                status => status.result()?,
            }
            let now = server.port.micros();
            let delay = server.poll_delay(now);
            if delay > 0 && server.port.unread() == 0 {
                server.port.receive(delay).await;
            }
        }
    }

    /// Goes on with the response whose future was dropped, or gives it up.
    async fn resume(&mut self) -> Result<(), Error> {
        let server = &mut self.server;
        let port = &mut server.port;
        if server.phase == ServerPhase::Send {
            let (length, sent) = port.progress();
            let goes_on = if !server.request.is_serial() {
                true
            } else if length > 0 && sent == 0 {
                self.begun = port.micros();
                !receive_newer(server).await
            } else {
                elapsed(port.micros(), self.stopped) < server.silence
            };
            let port = &mut server.port;
            if goes_on {
                port.pre_transmission();
                self.send().await?;
            } else if sent < length {
                server.give_up_response();
            } else {
                server.now = port.micros();
                server.end_transmission();
            }
        }
        let port = &mut self.server.port;
        port.begin();
        // Before the server finds that none has arrived for longer than a frame may pause.
        port.take_old_bytes().await;
        Ok(())
    }

    /// Sends the response, if there is one.
    async fn send(&mut self) -> Result<(), Error> {
        if self.server.phase != ServerPhase::Send {
            return Ok(());
        }
        let sending = Sending(self);
        let AsyncServer {
            server,
            begun,
            held,
            post_flush_characters,
            ..
        } = &mut *sending.0;
        if server.sent < server.end {
            server.go_on().result()?;
        }
        if let Some(length) = server.port.frame_length() {
            let timeout = match server.request.is_serial() {
                true => UART_TIMEOUT,
                false => SOCKET_TIMEOUT,
            };
            let character = u32::from(server.character);
            let frame = server.storage.slice(0, length.into());
            server
                .port
                .send(frame, timeout + character * u32::from(length))
                .await;
            let now = server.port.micros();
            let time = if *post_flush_characters > 0 {
                character * u32::from(*post_flush_characters)
            } else if server.request.is_serial() && server.character != UNKNOWN_CHARACTER {
                hold(server.character, length, elapsed(now, *begun))
            } else {
                0
            };
            *held = now.wrapping_add(time);
        }
        let left = held.wrapping_sub(server.port.micros());
        if left < LONGEST {
            server.port.hold(left).await;
        }
        if server.port.is_lost() || server.port.is_stuck() {
            server.give_up_response();
        } else {
            server.now = server.port.micros();
            server.go_on().result()?;
        }
        match server.port.is_lost() {
            true => Err(Error::LinkLost),
            false => Ok(()),
        }
    }
}

/// Receives what has arrived. True if the client on a serial line has sent another frame: it has given up
/// the response to the last one. Fewer bytes may be noise.
async fn receive_newer<D, C, T, E, B>(server: &mut Server<AsyncIo<D, C, T, E>, B>) -> bool
where
    D: Read + Write,
    T: DelayNs,
{
    let is_serial = server.request.is_serial();
    while is_serial && server.port.unread() <= rtu::OVERHEAD {
        let unread = server.port.unread();
        server.port.take_old_bytes().await;
        if server.port.unread() == unread {
            return false;
        }
    }
    is_serial
}

/// A response that is being sent. If the future is dropped, the driver is switched off.
struct Sending<'a, P: Port, B: ServerStorage>(&'a mut AsyncServer<P, B>);

impl<P: Port, B: ServerStorage> Drop for Sending<'_, P, B> {
    fn drop(&mut self) {
        let server = &mut self.0.server;
        if server.phase == ServerPhase::Send {
            server.port.post_transmission();
            self.0.stopped = server.port.micros();
        }
    }
}
