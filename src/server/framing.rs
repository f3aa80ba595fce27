//! How each framing finds a request in what arrives, and seals a response.

use super::info::SERIAL;
use super::line::{EncodeAdu, Receive, Server, ServerStorage};
use crate::error::Status;
use crate::frame::ascii::{CharacterKind, Decoded};
use crate::frame::checksum::Crc16;
use crate::frame::{ascii, rtu, tcp};
use crate::pdu::custom::Function;
use crate::pdu::length::{self, Length};
use crate::pdu::limits::MAX_PDU;
use crate::port::Port;
use crate::time;
use crate::FIRMWARE;

/// Bytes that are given up at once where the buffer is full: fewer cost more time, more
/// cost a request that takes all of the buffer but a few bytes.
const SLIDE: usize = 4;

/// Bytes that one poll takes at most, where a peer floods with what is no frame.
const MOST_BYTES: u16 = 512;

/// The inter-character timeout of ASCII (serial line guide V1.02, 2.5.2.1).
const ASCII_TIMEOUT: u32 = time::millis(1000);

/// What a frame that tells its length may take to arrive between two bytes.
const STREAM_TIMEOUT: u32 = time::millis(500);

/// The shortest TCP frame.
const LEAST_TCP: usize = tcp::PDU + 1;

/// What is taken of a TCP stream before its header is known: what most requests
/// have, so that a host asks once. [`Server::keep_read_ahead`] puts aside 4 bytes.
const AT_ONCE: usize = if FIRMWARE { LEAST_TCP } else { LEAST_TCP + 4 };

/// What a PDU may take of a buffer for RTU. More than a PDU is room for the
/// response of a user's function beside its request.
pub(super) const fn rtu_space(buffer: usize) -> usize {
    buffer.saturating_sub(rtu::OVERHEAD)
}

/// As [`rtu_space`], for ASCII: colon, two characters a byte of unit, PDU and LRC,
/// carriage return and delimiter.
pub(super) const fn ascii_space(buffer: usize) -> usize {
    (buffer.saturating_sub(3) / 2).saturating_sub(2)
}

/// As [`rtu_space`], for TCP.
pub(super) const fn tcp_space(buffer: usize) -> usize {
    buffer.saturating_sub(tcp::PDU)
}

/// The status of a port that gave no byte.
#[inline(always)]
fn nothing_heard(received: i16) -> Status {
    if received < 0 {
        Status::LINK_LOST
    } else {
        Status::OK
    }
}

impl<P: Port, B: ServerStorage> Server<P, B> {
    /// Listens for RTU frames, which silence ends, at an untold baud rate.
    pub fn begin_rtu(&mut self) {
        // A buffer too short for any frame has no room: a slice of so much is empty.
        let space = self.storage.capacity().wrapping_sub(rtu::OVERHEAD);
        self.begin(1, space, Self::receive_rtu, Self::encode_rtu);
        self.set_silence(time::DEFAULT_SILENCE);
        self.request.own = SERIAL;
    }

    /// Listens for RTU frames in a stream, where silence tells nothing.
    pub fn begin_rtu_over_tcp(&mut self) {
        let space = rtu_space(self.storage.frame().len());
        self.begin(1, space, Self::receive_by_length, Self::encode_rtu);
        self.set_silence(STREAM_TIMEOUT);
    }

    /// Listens for ASCII frames.
    pub fn begin_ascii(&mut self) {
        let space = ascii_space(self.storage.frame().len());
        self.begin(1, space, Self::receive_ascii, Self::encode_ascii);
        self.delimiter = ascii::END;
        self.set_silence(ASCII_TIMEOUT);
        self.request.own = SERIAL;
    }

    /// Listens for TCP frames.
    pub fn begin_tcp(&mut self) {
        let space = tcp_space(self.storage.frame().len());
        self.begin(
            tcp::PDU as u8,
            space,
            Self::receive_tcp,
            |server, length| server.encode_tcp(length),
        );
    }

    /// A frame is what stands between two silences. Where there was silence that
    /// nobody saw, for poll came late, the last frame counts: one of ours that
    /// is followed by another is no longer waited for.
    fn receive_rtu(&mut self) -> Status {
        let received = self.read_bytes(usize::MAX);
        if received > 0 {
            return Status::OK;
        }
        self.receive_no_more(received)
    }

    /// The port gave no byte: a frame has ended where that lasts.
    #[cfg_attr(target_os = "none", inline(always))]
    #[cfg_attr(not(target_os = "none"), inline(never))]
    fn receive_no_more(&mut self, received: i16) -> Status {
        if received < 0 {
            return Status::LINK_LOST;
        }
        if self.end == 0 || !self.is_silent() {
            return Status::OK;
        }
        self.last_frame()
    }

    /// As [`Server::receive_no_more`], for all framings but the most common.
    fn receive_no_more_apart(&mut self, received: i16) -> Status {
        if received < 0 {
            return Status::LINK_LOST;
        }
        if self.end == 0 || !self.is_silent() {
            return Status::OK;
        }
        self.last_frame_apart()
    }

    #[inline(never)]
    fn last_frame_apart(&mut self) -> Status {
        self.last_frame()
    }

    /// True for RTU frames on a serial line, which t3.5 ends.
    pub fn is_rtu_line(&self) -> bool {
        let rtu: EncodeAdu<P, B> = Self::encode_rtu;
        let is_rtu = |encode_adu| core::ptr::fn_addr_eq(encode_adu, rtu);
        self.request.is_serial() && self.encode_adu.is_some_and(is_rtu)
    }

    /// Says whether the receiver hears what the driver sends, so that as many
    /// bytes as were sent are dropped behind each response; false if this is no
    /// RTU line. (A function of its own, so that only who calls it carries it.)
    pub fn set_echo_discard(&mut self, on: bool) -> bool {
        let plain: Receive<P, B> = Self::receive_rtu;
        let echoing: Receive<P, B> = Self::receive_behind_echo;
        let is_rtu = self.is_rtu_line();
        if is_rtu {
            self.receive = Some(if on { echoing } else { plain });
            self.sent = 0;
        }
        is_rtu
    }

    /// As [`Server::receive_rtu`], once our own echo has passed, or the line been
    /// silent without one.
    fn receive_behind_echo(&mut self) -> Status {
        if self.sent == 0 {
            return self.receive_rtu();
        }
        // It comes from here on.
        if !self.resyncing {
            self.resyncing = true;
            self.last_byte = self.now;
        }
        let received = self.read_bytes_apart(self.sent.into());
        if received < 0 {
            return Status::LINK_LOST;
        }
        if received > 0 {
            self.sent -= received as u16;
            self.listen();
        } else if self.is_silent() {
            self.sent = 0;
        }
        Status::OK
    }

    /// Gives up the oldest bytes of a full buffer, whose first is the newest: where that
    /// stands from now on. A buffer has more bytes than are given up.
    #[cfg_attr(target_os = "none", inline(always))]
    #[cfg_attr(not(target_os = "none"), inline(never))]
    pub(super) fn slide(&mut self) -> usize {
        self.request.overrun = true;
        let capacity = self.storage.capacity();
        let newest = self.storage.byte(0);
        self.storage.keep(SLIDE, capacity);
        let place = capacity.wrapping_sub(SLIDE);
        if let [byte] = self.storage.part(place, place + 1) {
            *byte = newest;
        }
        place
    }

    /// Moves the last frame of what arrived to the front.
    #[inline(always)]
    fn last_frame(&mut self) -> Status {
        let mut length = usize::from(self.end);
        if !self.crc.is_residue() || self.request.overrun {
            let start = rtu::find_last(self.storage.part(0, length));
            self.storage.keep(start, length);
            length -= start;
        }
        // Where there is no frame, nothing is left of what arrived.
        length = length.wrapping_sub(rtu::OVERHEAD);
        if length > MAX_PDU {
            length = 0;
        }
        let unit = self.storage.byte(0);
        self.found_for(unit, length as u16)
    }

    /// Frames that tell their length are taken one by one; for others, and to
    /// find the way back, there is silence.
    fn receive_by_length(&mut self) -> Status {
        let mut taken = 0;
        while taken < MOST_BYTES {
            let end = usize::from(self.end);
            let frame = self.storage.frame();
            let capacity = frame.len();
            let pdu = frame.get(rtu::PDU..end).unwrap_or_default();
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
                return self.last_frame_apart();
            }
            if whole {
                self.resyncing = true;
            }
            let until = match total {
                Some((total, _)) if !self.resyncing => total,
                _ => usize::MAX,
            };
            let received = self.read_bytes_apart(until);
            if received <= 0 {
                return self.receive_no_more_apart(received);
            }
            taken += received as u16;
        }
        Status::OK
    }

    /// The length of the request that has begun to arrive.
    fn length(&mut self, code: u8) -> Length {
        let function = self.storage.rule(code).map(|rule| Function {
            code,
            request: rule,
            response: rule,
        });
        let end = usize::from(self.end);
        let pdu = self.storage.frame().get(rtu::PDU..end).unwrap_or_default();
        length::request(pdu, function.as_slice())
    }

    fn encode_rtu(&mut self, length: usize) -> usize {
        let end = rtu::PDU + length;
        let crc = Crc16::START.with(self.storage.part(0, end)).to_bytes();
        if let [low, high] = self.storage.part(end, end + 2) {
            [*low, *high] = crc;
        }
        end + 2
    }

    /// Byte by byte, for a colon begins a frame wherever it stands, and what
    /// follows a frame belongs to the next.
    fn receive_ascii(&mut self) -> Status {
        for _ in 0..MOST_BYTES {
            let end = usize::from(self.end);
            if end == self.storage.capacity() {
                self.request.overrun = true;
                return self.found(0);
            }
            let received = self.read_bytes_apart(end + 1);
            if received < 0 {
                return Status::LINK_LOST;
            }
            if received == 0 {
                if end == 0 || !self.is_silent() {
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
                    self.storage.part(0, 1).fill(last);
                    self.end = 1;
                }
                CharacterKind::Inside if end == 0 => self.end = 0,
                CharacterKind::Inside => {}
                CharacterKind::End => {
                    let frame = self.storage.part(0, end + 1);
                    let length = match ascii::decode(frame, delimiter, true) {
                        Decoded::Valid(content) => content - 1,
                        _ => 0,
                    };
                    return self.found(length.into());
                }
            }
        }
        Status::OK
    }

    fn encode_ascii(&mut self, length: usize) -> usize {
        let delimiter = self.delimiter;
        let frame = self.storage.frame();
        let unit = frame.first().copied().unwrap_or(0);
        // Sub-function 03 of 08 holds for the messages behind it.
        if let Some(&[_, 0x08, 0, 3, character, 0]) = frame.first_chunk() {
            self.delimiter = character;
        }
        let frame = self.storage.frame();
        ascii::emit(frame, unit, delimiter, |_| Ok(length)).unwrap_or(0)
    }

    /// Never more than one frame is taken from the stream, so that its response
    /// has the whole buffer; but for a few bytes behind a very short one.
    fn receive_tcp(&mut self) -> Status {
        self.receive_on()
    }

    /// As [`Server::receive_tcp`], where nothing has arrived yet: takes at once what most
    /// requests have. For hosts.
    #[inline(always)]
    pub(super) fn receive_at_once(&mut self) -> Status {
        let Some(front) = self.storage.frame().first_chunk_mut::<AT_ONCE>() else {
            return self.receive_on();
        };
        let received = self.port.read(front);
        if received != AT_ONCE as i16 {
            return self.received_less(received);
        }
        self.end = AT_ONCE as u16;
        match tcp::header(front) {
            Ok(header) if header.total == AT_ONCE => {
                self.found_for(header.unit, (AT_ONCE - tcp::PDU) as u16)
            }
            Ok(header) if header.total > AT_ONCE => self.receive_rest(header.total, header.unit),
            _ => self.receive_on(),
        }
    }

    /// Less than what most requests have has arrived, or nothing.
    #[inline(never)]
    fn received_less(&mut self, received: i16) -> Status {
        if received <= 0 {
            return nothing_heard(received);
        }
        self.end = received as u16;
        self.receive_on()
    }

    /// Takes what is left of a frame of `total` bytes.
    #[inline(never)]
    fn receive_rest(&mut self, total: usize, unit: u8) -> Status {
        let received = self.take(total);
        if usize::from(self.end) == total {
            return self.found_for(unit, (total - tcp::PDU) as u16);
        }
        if received > 0 {
            return self.receive_on();
        }
        nothing_heard(received)
    }

    /// Goes on with what begins in the buffer.
    #[cfg_attr(not(target_os = "none"), inline(never))]
    fn receive_on(&mut self) -> Status {
        loop {
            let end = usize::from(self.end);
            let mut until = AT_ONCE;
            let frame = self.storage.frame();
            match tcp::header(frame.get(..end).unwrap_or_default()) {
                Ok(header) => until = header.total,
                Err(Status::INCOMPLETE_FRAME) => {}
                Err(_) => return self.fail_stream(),
            }
            if end >= until {
                return self.found_in_stream(until);
            }
            let received = if FIRMWARE {
                self.read_bytes_apart(until)
            } else {
                self.take(until)
            };
            if received <= 0 {
                return nothing_heard(received);
            }
        }
    }

    /// The first frame of what arrived is of this length.
    #[inline(always)]
    fn found_in_stream(&mut self, length: usize) -> Status {
        let end = usize::from(self.end);
        if AT_ONCE > LEAST_TCP && end != length {
            self.keep_read_ahead(length);
        }
        self.found(length - tcp::PDU)
    }

    /// Puts aside what stands behind a frame that is shorter than what is taken
    /// at once.
    #[cold]
    fn keep_read_ahead(&mut self, length: usize) {
        let end = usize::from(self.end);
        let behind = self.storage.frame().get(length..end).unwrap_or_default();
        let mut aside = [0; 4];
        for (place, byte) in aside.iter_mut().zip(behind) {
            *place = *byte;
        }
        self.last_byte = u32::from_ne_bytes(aside);
        self.read_ahead = behind.len() as u8;
    }

    /// Begins the next frame with what was put aside.
    #[cold]
    pub(super) fn use_read_ahead(&mut self) {
        let aside = self.last_byte.to_ne_bytes();
        let count = core::mem::take(&mut self.read_ahead);
        let aside = aside.get(..count.into()).unwrap_or_default();
        for (place, byte) in self.storage.frame().iter_mut().zip(aside) {
            *place = *byte;
        }
        self.end = count.into();
    }

    #[inline(always)]
    pub(super) fn encode_tcp(&mut self, length: usize) -> usize {
        if let [high, low] = self.storage.part(4, 6) {
            [*high, *low] = tcp::length(length);
        }
        tcp::PDU + length
    }
}
