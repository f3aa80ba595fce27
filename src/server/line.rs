//! A server on one line or connection. The program calls its `poll`.
//!
//! The server finds a request and gives its PDU to the program. The program carries the request
//! out without a reference to the server, and passes the reply back. Then the server sends it. A
//! framing is two function pointers, so firmware contains only the framings that it begins with.

use super::{Indication, Reply, Units};
use crate::engine::Storage;
use crate::error::{Error, Status};
use crate::frame::rtu::Crc16;
use crate::frame::{ascii, rtu, tcp, Framing};
use crate::pdu::custom::Rule;
use crate::pdu::MAX_PDU;
use crate::port::Port;
use crate::time::{self, elapsed, sure_to_be_sending, Micros, Micros16};

/// Time until the next poll if only the port or a service can bring progress.
const EXTERNAL_POLL_DELAY: u32 = time::millis(1);

/// The default of [`Server::set_receive_latency`] in microseconds: the 16 ms of a USB adapter, on a host
/// whose clock tick or load adds some more. It is shorter than the response timeout of a client.
const RECEIVE_LATENCY: u32 = time::millis(50);

/// For how many characters a UART with a FIFO waits, after the last one, before it hands over
/// fewer bytes than it usually does (ESP32: 10).
const FIFO_TIMEOUT: usize = 10;

/// The length of a character in microseconds while the baud rate is unknown: a little more than
/// that at 9600 baud, so no rate in use has it. (A number of few bits takes less flash.)
pub(super) const UNKNOWN_CHARACTER: u16 = 1_152;

/// The storage of a server: the frame buffer of [`Storage`], which holds a request, then its
/// response, and more that is optional.
///
/// ```
/// use mbm::server::ServerStorage;
///
/// // Arrays of bytes are storage.
/// let storage = [0; 256];
/// assert!(storage.serves(17));
/// assert_eq!(storage.rule(65), None);
/// ```
pub trait ServerStorage: Storage<Count = usize> {
    /// True if the server serves this unit. On an RTU line it waits for the rest of a request to
    /// such a unit. [`Server::serve`] also asks [`Units::has`].
    fn serves(&self, unit: u8) -> bool {
        let _ = unit;
        true
    }

    /// The length rule for requests of a user-defined function.
    fn rule(&self, function: u8) -> Option<Rule> {
        let _ = function;
        None
    }
}

impl ServerStorage for &mut [u8] {}

impl<const N: usize> ServerStorage for [u8; N] {}

/// The phase of a server.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
#[repr(u8)]
pub(super) enum ServerPhase {
    /// The server waits for a request.
    Listen,
    /// A request was found. The server waits for its reply.
    Request,
    /// The port sends the response. The driver of the line is enabled.
    Send,
}

/// Looks for a request in the received bytes. Returns [`Status::PENDING`] if there is one. Its PDU
/// is then in the buffer at index `request.head`, and its length is `request.length`.
pub(super) type Receive<P, B> = fn(&mut Server<P, B>) -> Status;

/// Turns the response PDU in the buffer, of this length, into a frame. Returns its length.
pub(super) type EncodeAdu<P, B> = fn(&mut Server<P, B>, usize) -> usize;

/// Most bytes of the next frame that the server has read. The shortest frame buffer has space
/// for as many after each frame that is shorter than what the server reads first.
pub(super) const READ_AHEAD: usize = 4;

/// A serial line keeps its receive latency here: see [`Server::set_receive_latency`]. TCP has no such
/// latency, and keeps the bytes of the next frame that it has read with the last one. (A field for
/// each takes 4 bytes of RAM more in each server.)
#[derive(Clone, Copy, Debug)]
pub(super) struct LatencyOrReadAhead(u32);

impl LatencyOrReadAhead {
    /// That of a serial line.
    pub(super) const fn latency(latency: Micros) -> LatencyOrReadAhead {
        LatencyOrReadAhead(latency)
    }

    /// The latency of a serial line.
    pub(super) fn as_latency(self) -> Micros {
        self.0
    }

    /// That of a TCP connection.
    pub(super) fn read_ahead(bytes: [u8; READ_AHEAD]) -> LatencyOrReadAhead {
        LatencyOrReadAhead(u32::from_ne_bytes(bytes))
    }

    /// The bytes of the next frame of a TCP connection.
    pub(super) fn as_read_ahead(self) -> [u8; READ_AHEAD] {
        self.0.to_ne_bytes()
    }
}

/// A server on one line or connection.
///
/// ```
/// # include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/doc/pump.rs"));
/// # fn main() -> Result<(), mbm::Error> {
/// use mbm::server::{Server, Tables, Unit};
///
/// let mut server = Server::rtu(rtu());
/// server.set_baud_rate(19200);
/// server.set_receive_latency(20);
/// server.set_silence(2000);
/// server.set_echo_discard(true);
/// let mut unit = Unit::new(17, Tables::NONE.with_holding_registers(107, [555, 100, 0, 0]));
///
/// // In the main loop, with the time of the clock:
/// # let now = 0;
/// server.serve(now, &mut unit)?;
/// let sleep = server.poll_delay(now);
/// # Ok(())
/// # }
/// ```
// The small fields come first: see `Engine`.
#[repr(C)]
#[derive(Clone, Debug)]
pub struct Server<P, B> {
    pub(super) phase: ServerPhase,
    /// In a stream of RTU frames: the received bytes are not a frame of known length.
    pub(super) resyncing: bool,
    /// A response of the server was not the next frame that it received: the line has no echo.
    pub(super) has_no_echo: bool,
    /// No byte has arrived since [`Server::wait_for`]. It counts only after received bytes.
    pub(super) is_waiting: bool,
    /// The CRC of the received bytes, but not on an RTU line.
    pub(super) crc: Crc16,
    /// Index in the buffer after the received bytes, or after the response to send.
    pub(super) end: u16,
    /// How many bytes of the response were sent; 0 once none of them is expected as an echo.
    pub(super) sent: u16,
    /// The CRC of the response that may come back. In ASCII it is that of its characters.
    pub(super) echo: Crc16,
    /// The request that was found last.
    pub request: Indication,
    /// The time up to which further bytes of a frame or of an echo may arrive; see
    /// [`Server::keeps_time`].
    pub(super) deadline: Micros,
    /// The storage that the caller supplies.
    pub storage: B,
    /// The end character of ASCII frames.
    pub(super) delimiter: u8,
    /// Over TCP: how many bytes of the next frame are stored in `latency_or_read_ahead`.
    pub(super) read_ahead: u8,
    /// On an RTU line: the length of a character in microseconds.
    pub(super) character: Micros16,
    pub(super) now: Micros,
    /// The silence that ends a frame. Set it with [`Server::set_silence`].
    pub silence: Micros,
    pub(super) latency_or_read_ahead: LatencyOrReadAhead,
    pub(super) receive: Option<Receive<P, B>>,
    pub(super) encode_adu: Option<EncodeAdu<P, B>>,
    /// The byte stream.
    pub port: P,
}

impl<P: Port, B: ServerStorage> Server<P, B> {
    /// A server that has no framing yet.
    // For the C API; it may change in any version.
    #[doc(hidden)]
    pub const fn new(port: P, storage: B) -> Self {
        Server {
            phase: ServerPhase::Listen,
            resyncing: false,
            has_no_echo: false,
            is_waiting: false,
            delimiter: ascii::END,
            read_ahead: 0,
            crc: Crc16::START,
            end: 0,
            sent: 0,
            echo: Crc16::START,
            character: UNKNOWN_CHARACTER,
            request: Indication::NONE,
            deadline: 0,
            now: 0,
            silence: time::DEFAULT_SILENCE,
            latency_or_read_ahead: LatencyOrReadAhead::latency(RECEIVE_LATENCY),
            receive: None,
            encode_adu: None,
            storage,
            port,
        }
    }

    /// A server that has begun with this framing. 256 bytes of storage hold any RTU frame, 513 any
    /// ASCII frame, 260 any frame on TCP.
    ///
    /// ```
    /// # include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/doc/pump.rs"));
    /// # fn main() -> Result<(), mbm::Error> {
    /// use mbm::frame::Framing;
    /// use mbm::server::Server;
    ///
    /// let server = Server::with_framing(Framing::Tcp, tcp(), [0; 260]);
    /// assert!(!server.is_sending());
    /// # Ok(())
    /// # }
    /// ```
    pub fn with_framing(framing: Framing, port: P, storage: B) -> Self {
        let mut server = Server::new(port, storage);
        match framing {
            Framing::Rtu => server.begin_rtu(),
            Framing::Ascii => server.begin_ascii(),
            Framing::Tcp => server.begin_tcp(),
            Framing::RtuOverTcp => server.begin_rtu_over_tcp(),
        }
        server
    }

    /// Sets the framing and waits for a request. A request that has arrived in part is dropped.
    #[inline(always)]
    pub(super) const fn begin(
        &mut self,
        (head, own): (usize, u8),
        space: usize,
        receive: Receive<P, B>,
        encode_adu: EncodeAdu<P, B>,
    ) {
        self.request.head = head as u8;
        self.request.own = own;
        self.request.space = space as u16;
        self.receive = Some(receive);
        self.encode_adu = Some(encode_adu);
        self.request.again = true;
        self.has_no_echo = false;
        self.sent = 0;
        self.character = UNKNOWN_CHARACTER;
        self.latency_or_read_ahead = LatencyOrReadAhead::latency(RECEIVE_LATENCY);
        self.listen();
    }

    /// True while the server sends a response, with the driver of the line enabled.
    ///
    /// ```
    /// # include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/doc/pump.rs"));
    /// # fn main() -> Result<(), mbm::Error> {
    /// use mbm::server::Server;
    ///
    /// assert!(!Server::tcp(tcp()).is_sending());
    /// # Ok(())
    /// # }
    /// ```
    #[inline(always)]
    pub fn is_sending(&self) -> bool {
        self.phase == ServerPhase::Send
    }

    /// Sets the silence that ends a frame, in microseconds: t3.5 for RTU, the
    /// inter-character timeout for ASCII.
    pub const fn set_silence(&mut self, microseconds: u32) {
        self.silence = time::clamped(microseconds);
    }

    /// Sets the silence that ends an RTU frame, t3.5, and the time that missing bytes take, from
    /// the baud rate in bits per second; 0 means that the rate is unknown, and counts as 9600. Set
    /// it after [`Server::with_framing`].
    pub fn set_baud_rate(&mut self, baud: u32) {
        self.silence = time::silence(baud);
        self.character = match baud {
            0 => UNKNOWN_CHARACTER,
            baud => time::character(baud),
        };
    }

    /// Sets how long the UART or an adapter may hold received bytes back on a serial line, in
    /// milliseconds; 50 at first. If a request to a unit of the server lacks bytes that it announces
    /// after t3.5, the server waits for the time of those bytes and ten more at the baud rate, and for
    /// this time.
    pub fn set_receive_latency(&mut self, milliseconds: u16) {
        if self.keeps_time() {
            self.latency_or_read_ahead = LatencyOrReadAhead::latency(time::millis(milliseconds));
        }
    }

    /// Waits for the next request.
    #[cfg_attr(target_os = "none", inline(never))]
    pub(super) const fn listen(&mut self) {
        self.phase = ServerPhase::Listen;
        self.end = 0;
        self.request.overrun = false;
        self.resyncing = false;
    }

    /// True if the server has begun with a framing.
    // For the C API; it may change in any version.
    #[doc(hidden)]
    #[inline(always)]
    pub fn has_framing(&self) -> bool {
        self.receive.is_some() && self.encode_adu.is_some()
    }

    /// True if [`Server::poll`] needs the right time. Over TCP any time will do.
    // For the C API; it may change in any version.
    #[doc(hidden)]
    #[inline(always)]
    pub fn keeps_time(&self) -> bool {
        usize::from(self.request.head) != tcp::PDU
    }

    /// Receives and sends as far as is possible at the time `now` (microseconds) without waiting.
    /// Returns [`Status::PENDING`] if a request waits for its reply; [`Status::LINK_LOST`];
    /// [`Status::MALFORMED_FRAME`] if the stream is not Modbus TCP;
    /// [`Status::NOT_INITIALISED`] without a framing; otherwise [`Status::OK`].
    ///
    /// ```
    /// # include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/doc/pump.rs"));
    /// # fn main() -> Result<(), mbm::Error> {
    /// use mbm::server::{Reply, Server};
    /// use mbm::Status;
    ///
    /// // A program that serves requests by itself, here with exception 01.
    /// let mut server = Server::tcp(tcp());
    /// # let now = 0;
    /// if server.poll(now) == Status::PENDING {
    ///     let function = server.pdu()[0];
    ///     server.answer(Reply::ILLEGAL_FUNCTION);
    /// }
    /// # Ok(())
    /// # }
    /// ```
    pub fn poll(&mut self, now: u32) -> Status {
        match self.look(now) {
            Status::OK => self.go_on(),
            status => status,
        }
    }

    /// The first half of [`Server::poll`]: looks for a request.
    // For the C API; it may change in any version.
    #[doc(hidden)]
    #[inline(always)]
    pub fn look(&mut self, now: u32) -> Status {
        self.now = now;
        match self.phase {
            ServerPhase::Request => return Status::PENDING,
            ServerPhase::Send => return Status::OK,
            ServerPhase::Listen => self.request.again = false,
        }
        match self.receive {
            Some(receive) => receive(self),
            None => Status::NOT_INITIALISED,
        }
    }

    /// As [`Server::look`]. `has` says which units the server has: see [`Units::has`].
    #[inline(always)]
    pub(super) fn look_for(&mut self, now: u32, has: &impl Fn(u8) -> bool) -> Status {
        let (was_waiting, deadline) = (self.is_waiting, self.deadline);
        let status = self.look(now);
        if was_waiting || !self.is_waiting {
            return status;
        }
        (self.is_waiting, self.deadline) = (false, deadline);
        self.end_of_block(&|_, unit| has(unit))
    }

    /// The second half of [`Server::poll`]: sends the response, if there is one.
    // For the C API; it may change in any version.
    #[doc(hidden)]
    #[inline(always)]
    pub fn go_on(&mut self) -> Status {
        if self.phase == ServerPhase::Send {
            self.send()
        } else {
            Status::OK
        }
    }

    /// Gives the stream up: from now on each poll returns [`Status::MALFORMED_FRAME`].
    pub(super) fn fail_stream(&mut self) -> Status {
        self.receive = Some(|_| Status::MALFORMED_FRAME);
        Status::MALFORMED_FRAME
    }

    /// Reads bytes into the buffer after the received bytes, up to the index `until` or to the end
    /// of the buffer, and updates the CRC if it is used. Returns how many, or a negative number if
    /// the link is lost. If the buffer is full, reads one byte and drops the oldest bytes for it.
    /// They are dropped only once such a byte arrives, because the full buffer may hold a frame.
    #[cfg_attr(target_os = "none", inline(always))]
    pub(super) fn read_bytes(&mut self, until: usize, uses_crc: bool) -> isize {
        let capacity = self.storage.capacity();
        let mut end = usize::from(self.end);
        let mut start = end;
        let mut until = until.min(capacity);
        let is_full = end == capacity;
        if is_full {
            start = 0;
            until = 1;
        }
        let received = isize::from(
            self.port
                .read_count(self.storage.bytes(start, until - start)),
        );
        if received > 0 {
            self.deadline = self.now.wrapping_add(self.silence);
            if is_full {
                start = self.drop_oldest();
            }
            end = start + received as usize;
            self.end = end as u16;
            self.is_waiting = false;
            if uses_crc {
                self.crc = self.crc.with(self.storage.slice(start, end - start));
            }
        }
        received
    }

    /// As [`Server::read_bytes`], for the framings other than RTU. It is not inlined. With one
    /// function for all, a server takes 52 bytes more on a Cortex-M0+ and 100 on an AVR.
    #[inline(never)]
    pub(super) fn read_bytes_not_inlined(&mut self, until: usize) -> isize {
        self.read_bytes(until, usize::from(self.request.head) == rtu::PDU)
    }

    /// True if the line has been silent for long enough to end a frame. (One subtraction, because
    /// 32-bit arithmetic costs much on an AVR.)
    #[inline(always)]
    pub(super) fn is_silent(&self) -> bool {
        self.now.wrapping_sub(self.deadline) as i32 >= 0
    }

    /// Waits for `count` bytes, for as long as they may take from `start` on.
    #[cfg_attr(target_os = "none", inline(never))]
    pub(super) fn wait_for(&mut self, count: usize, start: u32) {
        self.is_waiting = true;
        self.deadline = start;
        time::add_characters(&mut self.deadline, count + FIFO_TIMEOUT, self.character);
        self.deadline = self
            .deadline
            .wrapping_add(self.latency_or_read_ahead.as_latency());
    }

    /// Notes that the line has no echo: after a response, another frame than its echo has come,
    /// or none in time.
    #[inline(always)]
    pub(super) fn give_up_echo(&mut self) {
        if self.sent != 0 {
            self.sent = 0;
            self.has_no_echo = true;
        }
    }

    /// Microseconds from `now` for which poll has nothing to do unless the port has bytes to
    /// read. It is 1000 while a service is not finished, or while a stream accepts no bytes of
    /// the response: poll earlier if that changes. It is 0 after that, until poll has read the
    /// port: bytes that arrived meanwhile may have ended a wait already. While a response
    /// leaves on an RTU line whose rate is known, it is a time for which characters are sure to
    /// leave, and 0 for the last ones: the driver must go off in time. After that it is the
    /// time in which an echo may arrive: a program that slept until the next bytes would take
    /// these for the echo.
    pub fn poll_delay(&self, now: u32) -> u32 {
        match self.phase {
            ServerPhase::Listen if self.request.again => 0,
            ServerPhase::Listen if !self.keeps_time() => u32::MAX,
            ServerPhase::Listen if self.end == 0 && !self.awaits_echo() => u32::MAX,
            ServerPhase::Listen => match self.deadline.wrapping_sub(now) {
                left @ ..=time::LONGEST => left,
                _ => 0,
            },
            ServerPhase::Send if self.request.is_serial() => self.sending_delay(now),
            _ => EXTERNAL_POLL_DELAY,
        }
    }

    /// True while an echo of the last response may arrive.
    fn awaits_echo(&self) -> bool {
        self.sent != 0 && self.request.is_serial()
    }

    /// As [`Server::poll_delay`], while a response leaves on a serial line: neither its next byte nor
    /// switching off the driver may be late.
    fn sending_delay(&self, now: u32) -> u32 {
        if self.sent < self.end || self.character == UNKNOWN_CHARACTER {
            return 0;
        }
        // The response began after the silence that ended the request.
        sure_to_be_sending(self.character, self.end).saturating_sub(elapsed(now, self.deadline))
    }

    /// Stores that a request was found, with a PDU of `length` bytes; 0 if it is damaged.
    #[cfg_attr(target_os = "none", inline(never))]
    pub(super) fn found(&mut self, length: usize) -> Status {
        self.crc = Crc16::START;
        let unit = self.storage.byte(usize::from(self.request.head) - 1);
        self.found_for(unit, if length > MAX_PDU { 0 } else { length as u16 })
    }

    /// As [`Server::found`], with the unit id, and a length that is valid for a PDU.
    #[inline(always)]
    pub(super) fn found_for(&mut self, unit: u8, length: u16) -> Status {
        self.request.to = unit;
        self.request.length = length;
        self.phase = ServerPhase::Request;
        Status::PENDING
    }

    /// The PDU of the request, with the space after it that the response may fill.
    ///
    /// ```
    /// # include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/doc/pump.rs"));
    /// # fn main() -> Result<(), mbm::Error> {
    /// use mbm::server::{Reply, Server};
    ///
    /// fn answer(server: &mut Server<impl mbm::port::Port, [u8; 260]>) {
    ///     // Function 65 returns one byte.
    ///     if let [65, place, ..] = server.pdu() {
    ///         *place = 7;
    ///         server.answer(Reply::length(2));
    ///     }
    /// }
    /// # Ok(())
    /// # }
    /// ```
    pub fn pdu(&mut self) -> &mut [u8] {
        let head = usize::from(self.request.head);
        let space = usize::from(self.request.space);
        let capacity = self.storage.capacity();
        let frame = self.storage.bytes(0, capacity);
        frame.get_mut(head..head + space).unwrap_or_default()
    }

    /// As [`Server::poll`], but `units` serve the request, and their reply is sent. One call
    /// serves one request at most, so a flood of requests does not block the program.
    ///
    /// # Errors
    /// As [`Server::poll`].
    ///
    /// ```
    /// # include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/doc/pump.rs"));
    /// # fn main() -> Result<(), mbm::Error> {
    /// use mbm::server::{Server, Tables, Unit};
    ///
    /// let mut server = Server::tcp(tcp());
    /// let mut unit = Unit::new(17, Tables::NONE.with_holding_registers(107, [555, 100, 0, 0]));
    /// // In the main loop, with the time of the clock:
    /// # let now = 0;
    /// server.serve(now, &mut unit)?;
    /// # Ok(())
    /// # }
    /// ```
    pub fn serve(&mut self, now: u32, units: &mut (impl Units + ?Sized)) -> Result<(), Error> {
        match self.look_for(now, &|unit| units.has(unit)) {
            Status::PENDING => {
                let info = self.request;
                let reply = units.serve(&info, self.pdu());
                if !self.answer(reply) {
                    return Ok(());
                }
            }
            status => status.result()?,
        }
        self.go_on().result()
    }

    /// Serves requests until the link is lost. Between two polls the port may sleep, in
    /// [`Port::idle`]. A program that has other work calls [`Server::serve`] itself.
    ///
    /// ```
    /// # include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/doc/requests.rs"));
    /// # fn main() {
    /// use mbm::server::{Server, Tables, Unit};
    ///
    /// # let port = requests(&[17, 6, 0x00, 0x6D, 0x03, 0x78, 0x1A, 0x55]);
    /// let mut server = Server::rtu(port);
    /// server.set_baud_rate(9600);
    /// let mut unit = Unit::new(17, Tables::NONE.with_holding_registers(107, [555, 100, 0, 0]));
    /// assert_eq!(server.run(&mut unit), mbm::Error::LinkLost);
    /// // A master wrote 888 to register 109.
    /// assert_eq!(unit.device.holding_registers.cells, [555, 100, 888, 0]);
    /// # }
    /// ```
    pub fn run(&mut self, units: &mut (impl Units + ?Sized)) -> Error {
        loop {
            let now = self.port.micros();
            if let Err(error) = self.serve(now, units) {
                return error;
            }
            let delay = self.poll_delay(now);
            if delay > 0 {
                self.port.idle(delay);
            }
        }
    }

    /// Takes the reply to the request. The PDU of a response has overwritten that of the request.
    /// For [`Reply::PENDING`] the server keeps the request and returns false.
    ///
    /// ```
    /// use mbm::server::{Reply, Server};
    ///
    /// fn refuse(server: &mut Server<impl mbm::port::Port, [u8; 260]>) {
    ///     server.answer(Reply::SERVER_DEVICE_FAILURE);
    /// }
    /// ```
    pub fn answer(&mut self, reply: Reply) -> bool {
        self.answer_served(reply.or_illegal())
    }

    /// As [`Server::answer`], for a reply other than [`Reply::NOT_HANDLED`]. With one function for
    /// both, a server takes 8 bytes more on a Cortex-M0+ and 10 on an AVR.
    // For the C API; it may change in any version.
    #[doc(hidden)]
    #[cfg_attr(target_os = "none", inline(always))]
    pub fn answer_served(&mut self, reply: Reply) -> bool {
        if reply == Reply::PENDING {
            self.request.again = true;
            return false;
        }
        let head = usize::from(self.request.head);
        let length = reply.write_served_exception(self.storage.bytes(head, 2));
        match self.encode_adu {
            Some(encode_adu) if length != 0 => {
                self.end = encode_adu(self, length) as u16;
                self.sent = 0;
                self.phase = ServerPhase::Send;
                self.port.pre_transmission();
            }
            _ => self.listen(),
        }
        true
    }

    fn send(&mut self) -> Status {
        let mut status = Status::OK;
        let rest = self
            .storage
            .slice(self.sent.into(), (self.end - self.sent).into());
        if !rest.is_empty() {
            let sent = self.port.write_count(rest);
            if sent < 0 {
                status = Status::LINK_LOST;
            } else {
                self.sent += sent as u16;
            }
        }
        if status == Status::LINK_LOST || (self.sent == self.end && self.port.flush()) {
            self.end_transmission();
        } else {
            self.request.again = true;
        }
        status
    }

    pub(super) fn end_transmission(&mut self) {
        self.port.post_transmission();
        self.listen();
        self.wait_for(self.sent.into(), self.now);
    }

    /// Stops sending a response, of which no echo is expected.
    #[cfg(feature = "embedded-io-async")]
    pub(super) fn give_up_response(&mut self) {
        self.port.post_transmission();
        self.listen();
        self.sent = 0;
    }

    /// Drops the received bytes, and expects no echo any more.
    #[cfg_attr(target_os = "none", inline(always))]
    pub(super) fn drop_bytes(&mut self) -> Status {
        self.end = 0;
        self.sent = 0;
        self.request.overrun = false;
        Status::OK
    }
}
