//! How each framing finds a request in the received bytes, and encodes a response.

use super::indication::{SERIAL, STREAM};
use super::line::{LatencyOrReadAhead, Receive, Server, ServerStorage, READ_AHEAD};
use super::{Indication, Reply, Units};
use crate::error::{Error, Status};
use crate::frame::ascii::{CharacterKind, Decoded};
use crate::frame::rtu::Crc16;
use crate::frame::{ascii, rtu, tcp, Framing};
use crate::pdu::custom::Function;
use crate::pdu::functions::{DIAGNOSTICS, ENCAPSULATED_INTERFACE_TRANSPORT};
use crate::pdu::length::{self, Length};
use crate::pdu::EXCEPTION;
use crate::pdu::MAX_PDU;
use crate::port::Port;
use crate::time;

/// Bytes that a full buffer drops at a time. A smaller number costs more time. A greater number
/// could drop the start of a request that nearly fills the buffer.
const DROPPED_AT_ONCE: usize = 4;

/// Most bytes that one poll reads, in case a peer floods the server with bytes that are not a
/// frame.
const MAX_BYTES_PER_POLL: u16 = 512;

/// The inter-character timeout of ASCII (serial line guide V1.02, 2.5.2.1).
const ASCII_TIMEOUT: u32 = time::millis(1000);

/// Longest time between two bytes of an RTU frame in a TCP stream.
const STREAM_TIMEOUT: u32 = time::millis(500);

/// Bytes of the RTU response to a write, which repeats address and value or quantity.
const ECHOED: usize = 8;

/// Bytes of the shortest TCP frame.
const MIN_TCP: usize = tcp::PDU + 1;

/// Bytes that the server reads from a TCP stream before the header is known: the length of most
/// requests, so that one call of the port is enough. [`Server::keep_read_ahead`] can store
/// bytes that belong to the next frame.
const FIRST_READ: usize = MIN_TCP + READ_AHEAD;

/// Bytes of an RTU buffer that are free for the PDU. They may be more than the longest PDU: a
/// user-defined function may keep its request there while it writes the response after it.
pub(super) const fn rtu_space(buffer: usize) -> usize {
    buffer.saturating_sub(rtu::OVERHEAD)
}

/// As [`rtu_space`], for ASCII: a frame has a colon, two characters for each byte of unit, PDU
/// and LRC, a carriage return and an end character.
pub(super) const fn ascii_space(buffer: usize) -> usize {
    (buffer.saturating_sub(3) / 2).saturating_sub(2)
}

/// As [`rtu_space`], for TCP.
pub(super) const fn tcp_space(buffer: usize) -> usize {
    buffer.saturating_sub(tcp::PDU)
}

/// The length of the RTU frame of a request with this function code: less than 0 if it is fixed,
/// index of the byte count if there is one, 0 if only silence ends the frame. (The rules of
/// [`length::request`] in the form that takes the least flash.)
#[inline(always)]
const fn length_rule(code: u8) -> i8 {
    match code {
        // Return Query Data may be longer.
        1..=6 | DIAGNOSTICS => -8,
        7 | 0x0B | 0x0C | 0x11 => -4,
        0x16 => -10,
        0x18 => -6,
        0x0F | 0x10 => 6,
        0x14 | 0x15 => 2,
        0x17 => 10,
        ENCAPSULATED_INTERFACE_TRANSPORT => -7,
        _ => 0,
    }
}

/// [`length_rule`] of each function code up to the last one that has a rule: 12 bytes of flash less
/// on a Cortex-M0+. An AVR does without: there the table takes 44 bytes of RAM.
#[allow(clippy::indexing_slicing)] // The compiler computes it.
static LENGTH_RULES: [i8; ENCAPSULATED_INTERFACE_TRANSPORT as usize + 1] = {
    let mut rules = [0; ENCAPSULATED_INTERFACE_TRANSPORT as usize + 1];
    let mut code = 0;
    while code < rules.len() {
        rules[code] = length_rule(code as u8);
        code += 1;
    }
    rules
};

impl<P: Port> Server<P, [u8; 256]> {
    /// A server on a serial line with RTU frames, with a buffer for any. Set the baud rate. See the
    /// example at [`Server::run`].
    pub const fn rtu(port: P) -> Self {
        let mut server = Server::new(port, [0; 256]);
        server.begin_rtu_in(256);
        server
    }

    /// A server of RTU frames in a TCP stream, with a buffer for any.
    ///
    /// ```
    /// # include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/doc/requests.rs"));
    /// # fn main() {
    /// # let port = requests(&[17, 6, 0x00, 0x6D, 0x03, 0x78, 0x1A, 0x55]);
    /// # let mut unit = mbm::server::Unit::new(17, mbm::server::Tables::NONE);
    /// let mut server = mbm::server::Server::rtu_over_tcp(port);
    /// let lost = server.run(&mut unit);
    /// # assert_eq!(lost, mbm::Error::LinkLost);
    /// # }
    /// ```
    pub const fn rtu_over_tcp(port: P) -> Self {
        let mut server = Server::new(port, [0; 256]);
        server.begin_rtu_over_tcp_in(256);
        server
    }
}

impl<P: Port> Server<P, [u8; 513]> {
    /// A server on a serial line with ASCII frames, with a buffer for any.
    ///
    /// ```
    /// # include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/doc/requests.rs"));
    /// # fn main() {
    /// # let port = requests(b":1106006D037801\r\n");
    /// # let tables = mbm::server::Tables::NONE.with_holding_registers(109, [0]);
    /// # let mut unit = mbm::server::Unit::new(17, tables);
    /// let mut server = mbm::server::Server::ascii(port);
    /// let lost = server.run(&mut unit);
    /// # assert_eq!(lost, mbm::Error::LinkLost);
    /// # assert_eq!(unit.device.holding_registers.cells, [888]);
    /// # }
    /// ```
    pub const fn ascii(port: P) -> Self {
        let mut server = Server::new(port, [0; 513]);
        server.begin_ascii_in(513);
        server
    }
}

impl<P: Port> Server<P, [u8; 260]> {
    /// A server of one connection on Modbus TCP, with a buffer for any frame.
    ///
    /// ```
    /// # include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/doc/requests.rs"));
    /// # fn main() {
    /// # let port = requests(&[0, 1, 0, 0, 0, 6, 17, 6, 0x00, 0x6D, 0x03, 0x78]);
    /// # let tables = mbm::server::Tables::NONE.with_holding_registers(109, [0]);
    /// # let mut unit = mbm::server::Unit::new(17, tables);
    /// let mut server = mbm::server::Server::tcp(port);
    /// let lost = server.run(&mut unit);
    /// # assert_eq!(lost, mbm::Error::LinkLost);
    /// # assert_eq!(unit.device.holding_registers.cells, [888]);
    /// # }
    /// ```
    pub const fn tcp(port: P) -> Self {
        let mut server = Server::new(port, [0; 260]);
        server.begin_tcp_in(260);
        server
    }
}

impl<P: Port, B: ServerStorage> Server<P, B> {
    /// Begins with RTU frames on a serial line, and the silence for an unknown baud rate.
    // For the C API; it may change in any version.
    #[doc(hidden)]
    pub fn begin_rtu(&mut self) {
        self.begin_rtu_in(self.storage.capacity());
    }

    #[inline(always)]
    const fn begin_rtu_in(&mut self, capacity: usize) {
        // If the buffer is too short for any frame, this wraps. `Server::pdu` is then empty.
        let space = capacity.wrapping_sub(rtu::OVERHEAD);
        self.begin(
            (rtu::PDU, SERIAL),
            space,
            Self::receive_rtu,
            Self::encode_rtu,
        );
        self.silence = time::DEFAULT_SILENCE;
    }

    /// Begins with RTU frames in a TCP stream. Silence does not separate frames there.
    // For the C API; it may change in any version.
    #[doc(hidden)]
    pub fn begin_rtu_over_tcp(&mut self) {
        self.begin_rtu_over_tcp_in(self.storage.capacity());
    }

    #[inline(always)]
    const fn begin_rtu_over_tcp_in(&mut self, capacity: usize) {
        let space = rtu_space(capacity);
        self.begin(
            (rtu::PDU, STREAM),
            space,
            Self::receive_by_length,
            Self::encode_rtu,
        );
        self.crc = Crc16::START;
        self.set_silence(STREAM_TIMEOUT);
    }

    /// Begins with ASCII frames on a serial line.
    // For the C API; it may change in any version.
    #[doc(hidden)]
    pub fn begin_ascii(&mut self) {
        self.begin_ascii_in(self.storage.capacity());
    }

    #[inline(always)]
    const fn begin_ascii_in(&mut self, capacity: usize) {
        let space = ascii_space(capacity);
        self.begin(
            (rtu::PDU, SERIAL),
            space,
            Self::receive_ascii,
            Self::encode_ascii,
        );
        self.crc = Crc16::START;
        self.delimiter = ascii::END;
        self.set_silence(ASCII_TIMEOUT);
    }

    /// Begins with Modbus TCP frames.
    // For the C API; it may change in any version.
    #[doc(hidden)]
    pub fn begin_tcp(&mut self) {
        self.begin_tcp_in(self.storage.capacity());
    }

    #[inline(always)]
    const fn begin_tcp_in(&mut self, capacity: usize) {
        let space = tcp_space(capacity);
        self.begin(
            (tcp::PDU, STREAM),
            space,
            Self::receive_tcp,
            Self::encode_tcp,
        );
        self.read_ahead = 0;
        self.set_silence(0);
    }

    /// Receives an RTU frame. It ends with a silence after its last byte. A silence inside a request
    /// to one of the server's units does not end it, because a UART or an adapter may hand bytes
    /// over in blocks: see [`Server::end_of_block`]. If poll is called late, the buffer may hold
    /// several frames. Then the last one counts: the client no longer waits for the response to
    /// an earlier one.
    fn receive_rtu(&mut self) -> Status {
        let received = self.read_bytes(usize::MAX, false);
        if received > 0 {
            return Status::OK;
        }
        if received != 0 {
            return Status::LINK_LOST;
        }
        if !self.is_silent() {
            return Status::OK;
        }
        self.end_of_block(&B::serves)
    }

    /// Handles a silence. A frame, or a block of it, ends with it. `serves` says which units the
    /// server has. As [`Server::look`].
    ///
    /// If the bytes contain the start of a request to a unit of the server, whose other bytes have
    /// not arrived, the server waits for them once, for as long as they take. But a frame that has
    /// the length that it announces ends the wait, because a client has begun anew after it has cut
    /// a request off. The echo of a response is missing only if a poll after its time finds no byte:
    /// a program that polls seldom reads it late.
    #[cfg_attr(target_os = "none", inline(never))]
    pub(super) fn end_of_block(&mut self, serves: &impl Fn(&B, u8) -> bool) -> Status {
        let end = usize::from(self.end);
        if end == 0 {
            self.give_up_echo();
            return Status::OK;
        }
        let start = rtu::find_last(self.storage.slice(0, end));
        let (mut first, mut awaited) = (0, 0);
        let announced = loop {
            let announced = self.announced_end(first, serves);
            if awaited <= end {
                awaited = announced;
            }
            if first == start {
                break announced;
            }
            first += 1;
        };
        if awaited > end && announced != end && !self.is_waiting {
            self.wait_for(awaited - end, self.deadline);
            return Status::OK;
        }
        let length = end - start;
        self.storage.move_down(start, length);
        let echo = self.echo.to_bytes();
        if length == usize::from(self.sent)
            && *self.storage.slice(length - 2, 2) == echo
            && !(self.has_no_echo && length == usize::from(self.request.length) + rtu::OVERHEAD)
        {
            self.has_no_echo = false;
            return self.drop_bytes();
        }
        let count = usize::from(self.storage.byte(rtu::PDU + 1));
        let is_request = announced == end || announced == start;
        if !is_request && (length == ECHOED || length == rtu::OVERHEAD + 2 + count) {
            // The length is that of a response. So the receiver may get the bytes that the
            // driver sends. The bit keeps the units from serving the frame.
            self.has_no_echo = false;
            if let [function] = self.storage.bytes(rtu::PDU, 1) {
                *function |= EXCEPTION;
            }
        } else if start == 0 && length > rtu::OVERHEAD {
            self.give_up_echo();
        }
        self.sent = 0;
        self.found_frame(length)
    }

    /// Index after the request whose first bytes are in the buffer from `start` on, as they announce
    /// its length: that of the longest frame if its byte count is missing. It is `start` if they are
    /// no request to a unit of the server, or if only silence ends it.
    #[cfg_attr(target_os = "none", inline(never))]
    fn announced_end(&mut self, start: usize, serves: &impl Fn(&B, u8) -> bool) -> usize {
        let known = usize::from(self.end) - start;
        let unit = self.storage.byte(start);
        if !serves(&self.storage, unit) {
            return start;
        }
        if known == 1 {
            return start + rtu::MAX_FRAME;
        }
        let code = self.storage.byte(start + 1);
        let rule = if cfg!(target_arch = "avr") {
            length_rule(code)
        } else {
            match LENGTH_RULES.get(usize::from(code)) {
                Some(rule) => *rule,
                None => return start,
            }
        };
        if rule <= 0 {
            return start.wrapping_sub(isize::from(rule) as usize);
        }
        let offset = rule as usize;
        if offset >= known {
            return start + rtu::MAX_FRAME;
        }
        start + offset + rtu::OVERHEAD + usize::from(self.storage.byte(start + offset))
    }

    /// Handles that a stream or an ASCII line has no more bytes now.
    fn receive_no_more(&mut self, received: isize) -> Status {
        if received < 0 {
            return Status::LINK_LOST;
        }
        if self.end == 0 || !self.is_silent() {
            return Status::OK;
        }
        self.last_frame()
    }

    /// Moves the last frame of the received bytes to the front. Any other bytes are dropped.
    #[inline(never)]
    fn last_frame(&mut self) -> Status {
        self.crc = Crc16::START;
        let end = usize::from(self.end);
        let start = rtu::find_last(self.storage.slice(0, end));
        self.storage.move_down(start, end - start);
        self.found_frame(end - start)
    }

    /// True for RTU frames on a serial line. A silence of t3.5 ends them. A buffer has less space
    /// for the PDU of an ASCII frame.
    // For the C API; it may change in any version.
    #[doc(hidden)]
    pub fn is_rtu_line(&self) -> bool {
        let space = self.storage.capacity().wrapping_sub(rtu::OVERHEAD);
        self.request.is_serial() && self.request.space == space as u16
    }

    /// Says whether the receiver gets the bytes that the driver sends. If so, the server drops a frame
    /// that is byte for byte its last response. If not, no request is taken for an echo. Without this
    /// call, the server drops such a frame until another frame, or none in time, has followed a
    /// response. Returns false if this is not an RTU line. (This is a function of its own, so that
    /// only programs that call it contain it.)
    pub fn set_echo_discard(&mut self, on: bool) -> bool {
        let without_echo: Receive<P, B> = Self::receive_rtu;
        let with_echo: Receive<P, B> = Self::receive_with_echo;
        let is_rtu = self.is_rtu_line();
        if is_rtu {
            self.receive = Some(if on { with_echo } else { without_echo });
            self.sent = 0;
            self.has_no_echo = !on;
        }
        is_rtu
    }

    /// As [`Server::receive_rtu`], on a line that has an echo even if a response came without it.
    fn receive_with_echo(&mut self) -> Status {
        self.has_no_echo = false;
        self.receive_rtu()
    }

    /// Drops the oldest bytes of a full buffer, and marks the request as longer than the buffer.
    /// The newest byte is at index 0. Returns the index to which it was moved. A buffer has more
    /// bytes than are dropped.
    #[cfg_attr(target_os = "none", inline(always))]
    pub(super) fn drop_oldest(&mut self) -> usize {
        self.request.overrun = true;
        let capacity = self.storage.capacity();
        let newest = self.storage.byte(0);
        self.storage
            .move_down(DROPPED_AT_ONCE, capacity - DROPPED_AT_ONCE);
        let place = capacity.wrapping_sub(DROPPED_AT_ONCE);
        if let [byte] = self.storage.bytes(place, 1) {
            *byte = newest;
        }
        place
    }

    /// The first `total` bytes are a frame, or too few for one.
    #[inline(always)]
    fn found_frame(&mut self, total: usize) -> Status {
        let mut length = total.wrapping_sub(rtu::OVERHEAD);
        if length > MAX_PDU {
            length = 0;
        }
        let unit = self.storage.byte(0);
        self.found_for(unit, length as u16)
    }

    /// Receives RTU frames from a TCP stream. If the first bytes show the length of the frame, the
    /// frame ends there. Silence ends a frame of unknown length. After an invalid frame, the
    /// server waits for silence before it looks for the next frame.
    fn receive_by_length(&mut self) -> Status {
        let mut taken = 0;
        while taken < MAX_BYTES_PER_POLL {
            let end = usize::from(self.end);
            let capacity = self.storage.capacity();
            let frame = self.storage.slice(0, end);
            let pdu = frame.get(rtu::PDU..).unwrap_or_default();
            let code = pdu.first().copied().unwrap_or(0);
            let total = match self.length(code) {
                _ if self.resyncing => None,
                Length::Exactly(length) => Some((length + rtu::OVERHEAD, true)),
                Length::AtLeast(length) => Some((length + rtu::PDU, false)),
                Length::Silence | Length::Unknown => None,
            };
            let total = total.filter(|(total, _)| *total <= capacity);
            let whole = match total {
                Some((total, whole)) => whole && end >= total,
                None => end > rtu::OVERHEAD,
            };
            if whole && self.crc.is_residue() {
                return self.last_frame();
            }
            if whole {
                self.resyncing = true;
            }
            let until = match total {
                Some((total, _)) if !self.resyncing => total,
                _ => usize::MAX,
            };
            let received = self.read_bytes_not_inlined(until);
            if received <= 0 {
                return self.receive_no_more(received);
            }
            taken += received as u16;
        }
        Status::OK
    }

    /// The length of the PDU whose first bytes have been received.
    fn length(&mut self, code: u8) -> Length {
        let function = self.storage.rule(code).map(|rule| Function {
            code,
            request: rule,
            response: rule,
        });
        let end = usize::from(self.end);
        let pdu = self
            .storage
            .slice(0, end)
            .get(rtu::PDU..)
            .unwrap_or_default();
        length::request(pdu, function.as_slice())
    }

    fn encode_rtu(&mut self, length: usize) -> usize {
        let end = rtu::PDU + length;
        self.echo = Crc16::START.with(self.storage.slice(0, end));
        let crc = self.echo.to_bytes();
        if let [low, high] = self.storage.bytes(end, 2) {
            [*low, *high] = crc;
        }
        end + 2
    }

    /// Receives an ASCII frame. Reads byte by byte, because each colon begins a new frame, and
    /// the bytes after a frame belong to the next frame.
    fn receive_ascii(&mut self) -> Status {
        for _ in 0..MAX_BYTES_PER_POLL {
            let end = usize::from(self.end);
            if end == self.storage.capacity() {
                self.request.overrun = true;
                return self.found(0);
            }
            let received = self.read_bytes_not_inlined(end + 1);
            if received < 0 {
                return Status::LINK_LOST;
            }
            if received == 0 {
                if !self.is_silent() {
                    return Status::OK;
                }
                if end == 0 {
                    self.give_up_echo();
                    return Status::OK;
                }
                return self.found(0);
            }
            let delimiter = self.delimiter;
            let last = self.storage.byte(end);
            let before = if end == 0 {
                0
            } else {
                self.storage.byte(end - 1)
            };
            match ascii::kind_of(before, last, delimiter) {
                CharacterKind::Start => {
                    self.storage.set_byte(0, last);
                    self.end = 1;
                }
                CharacterKind::Inside if end == 0 => self.end = 0,
                CharacterKind::Inside => {}
                CharacterKind::End => {
                    self.end = end as u16 + 1;
                    let crc = Crc16::START.with(self.storage.slice(0, end + 1));
                    // On a line without an echo, the bytes of the request are the same write again.
                    let is_expected =
                        !self.has_no_echo || end != 2 * usize::from(self.request.length) + 6;
                    if end + 1 == usize::from(self.sent) && crc == self.echo && is_expected {
                        self.has_no_echo = false;
                        self.crc = Crc16::START;
                        return self.drop_bytes();
                    }
                    let frame = self.storage.bytes(0, end + 1);
                    let length = match ascii::decode(frame, delimiter, true) {
                        Decoded::Valid(content) => content - 1,
                        _ => 0,
                    };
                    // Other bytes that have arrived may have been an echo, or a damaged one.
                    if length != 0 && crc == self.crc {
                        self.give_up_echo();
                    }
                    self.sent = 0;
                    return self.found(length.into());
                }
            }
        }
        Status::OK
    }

    fn encode_ascii(&mut self, length: usize) -> usize {
        let delimiter = self.delimiter;
        let unit = self.storage.byte(0);
        // Sub-function 03 of function 08 changes the end character, from this response on.
        if let &[_, DIAGNOSTICS, 0, 3, character, 0] = self.storage.slice(0, 6) {
            self.delimiter = character;
        }
        let capacity = self.storage.capacity();
        let frame = self.storage.bytes(0, capacity);
        let total = ascii::emit(frame, unit, delimiter, |_| Ok(length)).unwrap_or(0);
        self.echo = Crc16::START.with(self.storage.slice(0, total));
        total
    }

    /// Receives a TCP frame. Reads only one frame from the stream, so that its response can use
    /// the whole buffer. After a very short frame, a few bytes of the next frame may be read
    /// too; see [`Server::keep_read_ahead`].
    fn receive_tcp(&mut self) -> Status {
        if self.read_ahead != 0 {
            self.use_read_ahead();
        }
        loop {
            let end = usize::from(self.end);
            let mut until = FIRST_READ;
            match tcp::header(self.storage.slice(0, end)) {
                Ok(header) if end >= header.total => {
                    if end > header.total {
                        self.keep_read_ahead(header.total);
                    }
                    return self.found(header.total - tcp::PDU);
                }
                Ok(header) => until = header.total,
                Err(Error::IncompleteFrame) => {}
                Err(_) => return self.fail_stream(),
            }
            let received = self.read_bytes_not_inlined(until);
            if received < 0 {
                return Status::LINK_LOST;
            }
            if received == 0 {
                return Status::OK;
            }
        }
    }

    /// Stores the bytes after a frame of `length` bytes, which is shorter than [`FIRST_READ`]. They
    /// belong to the next frame.
    #[inline(always)]
    fn keep_read_ahead(&mut self, length: usize) {
        self.read_ahead = self.end as u8 - length as u8;
        if let [a, b, c, d] = *self.storage.slice(length, READ_AHEAD) {
            self.latency_or_read_ahead = LatencyOrReadAhead::read_ahead([a, b, c, d]);
        }
    }

    /// Begins the next frame with the bytes that [`Server::keep_read_ahead`] stored.
    #[inline(always)]
    fn use_read_ahead(&mut self) {
        if let Some(front) = self.storage.bytes(0, READ_AHEAD).first_chunk_mut() {
            *front = self.latency_or_read_ahead.as_read_ahead();
        }
        self.end = self.read_ahead.into();
        self.read_ahead = 0;
    }

    fn encode_tcp(&mut self, length: usize) -> usize {
        if let [high, low] = self.storage.bytes(4, 2) {
            [*high, *low] = tcp::length(length);
        }
        tcp::PDU + length
    }
}

/// Lets `units` serve the request frame in the first `length` bytes of `buffer`, and writes the
/// response frame over it, with a normal or an exception response. Returns the length of the
/// response frame. It is 0 if no response may be sent: the request frame is damaged or
/// incomplete, is addressed to another unit or broadcast, or the unit is in listen only mode.
/// `delimiter` is the end character of ASCII frames.
///
/// # Errors
/// [`Status::PENDING`] if a service is not finished. The request frame is then unchanged, except
/// for ASCII: its decoding has overwritten the frame. So put an ASCII frame into the buffer again
/// before the next call.
///
/// ```
/// use mbm::frame::{ascii::END, Framing};
/// use mbm::server::{respond, Tables, Unit};
///
/// let mut unit = Unit::new(17, Tables::NONE.with_holding_registers(107, [555, 100]));
/// let mut frame = [0; 260];
/// frame[..12].copy_from_slice(&[0, 5, 0, 0, 0, 6, 17, 3, 0, 107, 0, 2]);
/// let length = respond(Framing::Tcp, END, &mut frame, 12, &mut unit)?;
/// assert_eq!(frame[..length], [0, 5, 0, 0, 0, 7, 17, 3, 4, 0x02, 0x2B, 0, 100]);
/// # Ok::<(), mbm::Error>(())
/// ```
pub fn respond(
    framing: Framing,
    delimiter: u8,
    buffer: &mut [u8],
    length: usize,
    units: &mut (impl Units + ?Sized),
) -> Result<usize, Error> {
    let (mut info, space) = (Indication::NONE, buffer.len());
    let frame = buffer.get_mut(..length).unwrap_or_default();
    let adu = framing.parse(frame, delimiter);
    let (transaction, pdu) = adu.map_or((0, 0), |adu| {
        info.to = adu.unit;
        (adu.transaction, adu.pdu.len())
    });
    info.own = if framing.is_serial() { SERIAL } else { STREAM };
    info.length = pdu as u16;
    let space = match framing {
        Framing::Rtu | Framing::RtuOverTcp => rtu_space(space),
        Framing::Ascii => ascii_space(space),
        Framing::Tcp => tcp_space(space),
    };
    info.head = match framing {
        Framing::Tcp => tcp::PDU,
        _ => rtu::PDU,
    } as u8;
    info.space = space as u16;
    let start = usize::from(info.head);
    let Some(place) = buffer.get_mut(start..start + space) else {
        return Ok(0);
    };
    // The space must hold the request, and at least the two bytes of an exception.
    if pdu > place.len().min(MAX_PDU) || place.len() < 2 {
        return Ok(0);
    }
    let reply = units.serve(&info, place);
    if reply == Reply::PENDING {
        return Status::PENDING.result().map(|()| 0);
    }
    let mut written = reply.write_exception(place);
    if written == 0 {
        return Ok(0);
    }
    // A service may write a longer response, because it relies on the smallest buffer of a server.
    if written > place.len() {
        written = Reply::SERVER_DEVICE_FAILURE.write_exception(place);
    }
    let unit = info.to;
    framing.emit(buffer, transaction, unit, delimiter, |_| Ok(written))
}

/// The default end character of ASCII frames.
pub const DELIMITER: u8 = ascii::END;

#[cfg(test)]
mod tests {
    use super::*;

    struct Silent;

    impl Port for Silent {
        fn read(&mut self, _: &mut [u8]) -> Result<usize, Error> {
            Ok(0)
        }

        fn write(&mut self, bytes: &[u8]) -> Result<usize, Error> {
            Ok(bytes.len())
        }

        fn micros(&mut self) -> u32 {
            0
        }
    }

    #[test]
    fn the_announced_length_of_a_request_is_that_of_its_function() {
        for code in 0..=u8::MAX {
            for second in [0u8, 1, 0x0D, 0x0E] {
                for known in 1..=13 {
                    let mut frame = [17, code, 0, second, 0, 0, 4, 0, 0, 0, 6, 0, 0];
                    if code == ENCAPSULATED_INTERFACE_TRANSPORT {
                        frame[2] = second;
                    }
                    let mut server = Server::new(Silent, frame);
                    server.end = known as u16;
                    let announced = server.announced_end(0, &|_, unit| unit == 17);
                    assert_eq!(server.announced_end(0, &|_, _| false), 0);
                    let whole = match length::request(&frame[1..known], &[]) {
                        Length::Exactly(length) => length + rtu::OVERHEAD,
                        // A function of one length is known by its code.
                        Length::AtLeast(_) => {
                            assert!(announced > known, "{frame:02X?}, {known}");
                            continue;
                        }
                        // Silence ends them, but they are not shorter than that.
                        Length::Silence if code == DIAGNOSTICS => 8,
                        Length::Silence => 7,
                        Length::Unknown => 0,
                    };
                    assert_eq!(announced, whole, "{frame:02X?}, {known}");
                    let by_table = LENGTH_RULES.get(usize::from(code)).copied();
                    assert_eq!(by_table.unwrap_or(0), length_rule(code));
                }
            }
        }
    }
}
