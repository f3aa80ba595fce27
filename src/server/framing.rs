//! How each framing finds a request in what arrives, and seals a response.

use super::heading::SERIAL;
use super::line::{Lent, Receive, Seal, Server};
use crate::error::Status;
use crate::frame::ascii::{Content, Mark};
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
/// have, so that a host asks once. [`Server::keep_ahead`] puts aside 4 bytes.
const AT_ONCE: usize = if FIRMWARE { LEAST_TCP } else { LEAST_TCP + 4 };

/// What a PDU may take of a buffer for RTU. More than a PDU is room for the
/// response of a user's function beside its request.
pub(super) const fn rtu_room(buffer: usize) -> usize {
    buffer.saturating_sub(rtu::OVERHEAD)
}

/// As [`rtu_room`], for ASCII: colon, two characters a byte of unit, PDU and LRC,
/// carriage return and delimiter.
pub(super) const fn ascii_room(buffer: usize) -> usize {
    (buffer.saturating_sub(3) / 2).saturating_sub(2)
}

/// As [`rtu_room`], for TCP.
pub(super) const fn tcp_room(buffer: usize) -> usize {
    buffer.saturating_sub(tcp::PDU)
}

/// The status of a port that gave no byte.
#[inline(always)]
fn nothing_heard(heard: i16) -> Status {
    if heard < 0 {
        Status::LINK_LOST
    } else {
        Status::OK
    }
}

impl<P: Port, B: Lent> Server<P, B> {
    /// Listens for RTU frames, which silence ends, at an untold baud rate.
    pub fn begin_rtu(&mut self) {
        // A buffer too short for any frame has no room: a slice of so much is empty.
        let room = self.lent.capacity().wrapping_sub(rtu::OVERHEAD);
        self.begin(1, room, Self::receive_rtu, Self::seal_rtu);
        self.set_silence(time::DEFAULT_SILENCE);
        self.request.own = SERIAL;
    }

    /// Listens for RTU frames in a stream, where silence tells nothing.
    pub fn begin_rtu_over_tcp(&mut self) {
        let room = rtu_room(self.lent.frame().len());
        self.begin(1, room, Self::receive_by_length, Self::seal_rtu);
        self.set_silence(STREAM_TIMEOUT);
    }

    /// Listens for ASCII frames.
    pub fn begin_ascii(&mut self) {
        let room = ascii_room(self.lent.frame().len());
        self.begin(1, room, Self::receive_ascii, Self::seal_ascii);
        self.delimiter = ascii::END;
        self.set_silence(ASCII_TIMEOUT);
        self.request.own = SERIAL;
    }

    /// Listens for TCP frames.
    pub fn begin_tcp(&mut self) {
        let room = tcp_room(self.lent.frame().len());
        self.begin(tcp::PDU as u8, room, Self::receive_tcp, |server, length| {
            server.seal_tcp(length)
        });
    }

    /// A frame is what stands between two silences. Where there was silence that
    /// nobody saw, for poll came late, the last frame counts: one of ours that
    /// is followed by another is no longer waited for.
    fn receive_rtu(&mut self) -> Status {
        let heard = self.hear(usize::MAX);
        if heard > 0 {
            return Status::OK;
        }
        self.receive_no_more(heard)
    }

    /// The port gave no byte: a frame has ended where that lasts.
    #[cfg_attr(target_os = "none", inline(always))]
    #[cfg_attr(not(target_os = "none"), inline(never))]
    fn receive_no_more(&mut self, heard: i16) -> Status {
        if heard < 0 {
            return Status::LINK_LOST;
        }
        if self.end == 0 || !self.is_silent() {
            return Status::OK;
        }
        self.last_frame()
    }

    /// As [`Server::receive_no_more`], for all framings but the most common.
    fn receive_no_more_apart(&mut self, heard: i16) -> Status {
        if heard < 0 {
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
        let rtu: Seal<P, B> = Self::seal_rtu;
        let is_rtu = |seal| core::ptr::fn_addr_eq(seal, rtu);
        self.request.is_serial() && self.seal.is_some_and(is_rtu)
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
        if !self.astray {
            self.astray = true;
            self.last_byte = self.now;
        }
        let heard = self.hear_apart(self.sent.into());
        if heard < 0 {
            return Status::LINK_LOST;
        }
        if heard > 0 {
            self.sent -= heard as u16;
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
        let capacity = self.lent.capacity();
        let newest = self.lent.byte(0);
        self.lent.keep(SLIDE, capacity);
        let place = capacity.wrapping_sub(SLIDE);
        if let [byte] = self.lent.part(place, place + 1) {
            *byte = newest;
        }
        place
    }

    /// Moves the last frame of what arrived to the front.
    #[inline(always)]
    fn last_frame(&mut self) -> Status {
        let mut length = usize::from(self.end);
        if !self.crc.is_residue() || self.request.overrun {
            let start = rtu::last(self.lent.part(0, length));
            self.lent.keep(start, length);
            length -= start;
        }
        // Where there is no frame, nothing is left of what arrived.
        length = length.wrapping_sub(rtu::OVERHEAD);
        if length > MAX_PDU {
            length = 0;
        }
        let unit = self.lent.byte(0);
        self.found_for(unit, length as u16)
    }

    /// Frames that tell their length are taken one by one; for others, and to
    /// find the way back, there is silence.
    fn receive_by_length(&mut self) -> Status {
        let mut taken = 0;
        while taken < MOST_BYTES {
            let end = usize::from(self.end);
            let frame = self.lent.frame();
            let capacity = frame.len();
            let pdu = frame.get(rtu::PDU..end).unwrap_or_default();
            let code = pdu.first().copied().unwrap_or(0);
            let total = match self.length(code) {
                _ if self.astray => None,
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
                self.astray = true;
            }
            let until = match total {
                Some((total, _)) if !self.astray => total,
                _ => usize::MAX,
            };
            let heard = self.hear_apart(until);
            if heard <= 0 {
                return self.receive_no_more_apart(heard);
            }
            taken += heard as u16;
        }
        Status::OK
    }

    /// The length of the request that has begun to arrive.
    fn length(&mut self, code: u8) -> Length {
        let function = self.lent.rule(code).map(|rule| Function {
            code,
            request: rule,
            response: rule,
        });
        let end = usize::from(self.end);
        let pdu = self.lent.frame().get(rtu::PDU..end).unwrap_or_default();
        length::request(pdu, function.as_slice())
    }

    fn seal_rtu(&mut self, length: usize) -> usize {
        let end = rtu::PDU + length;
        let crc = Crc16::START.with(self.lent.part(0, end)).to_bytes();
        if let [low, high] = self.lent.part(end, end + 2) {
            [*low, *high] = crc;
        }
        end + 2
    }

    /// Byte by byte, for a colon begins a frame wherever it stands, and what
    /// follows a frame belongs to the next.
    fn receive_ascii(&mut self) -> Status {
        for _ in 0..MOST_BYTES {
            let end = usize::from(self.end);
            if end == self.lent.capacity() {
                self.request.overrun = true;
                return self.found(0);
            }
            let heard = self.hear_apart(end + 1);
            if heard < 0 {
                return Status::LINK_LOST;
            }
            if heard == 0 {
                if end == 0 || !self.is_silent() {
                    return Status::OK;
                }
                return self.found(0);
            }
            let delimiter = self.delimiter;
            let last = self.lent.byte(end);
            let before = if end == 0 { 0 } else { self.lent.byte(end - 1) };
            match ascii::mark(before, last, delimiter) {
                Mark::Start => {
                    self.lent.part(0, 1).fill(last);
                    self.end = 1;
                }
                Mark::Inside if end == 0 => self.end = 0,
                Mark::Inside => {}
                Mark::End => {
                    let frame = self.lent.part(0, end + 1);
                    let length = match ascii::decode(frame, delimiter, true) {
                        Content::Right(content) => content - 1,
                        _ => 0,
                    };
                    return self.found(length.into());
                }
            }
        }
        Status::OK
    }

    fn seal_ascii(&mut self, length: usize) -> usize {
        let delimiter = self.delimiter;
        let frame = self.lent.frame();
        let unit = frame.first().copied().unwrap_or(0);
        // Sub-function 03 of 08 holds for the messages behind it.
        if let Some(&[_, 0x08, 0, 3, character, 0]) = frame.first_chunk() {
            self.delimiter = character;
        }
        let frame = self.lent.frame();
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
        let Some(front) = self.lent.frame().first_chunk_mut::<AT_ONCE>() else {
            return self.receive_on();
        };
        let heard = self.port.read(front);
        if heard != AT_ONCE as i16 {
            return self.heard_less(heard);
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
    fn heard_less(&mut self, heard: i16) -> Status {
        if heard <= 0 {
            return nothing_heard(heard);
        }
        self.end = heard as u16;
        self.receive_on()
    }

    /// Takes what is left of a frame of `total` bytes.
    #[inline(never)]
    fn receive_rest(&mut self, total: usize, unit: u8) -> Status {
        let heard = self.take(total);
        if usize::from(self.end) == total {
            return self.found_for(unit, (total - tcp::PDU) as u16);
        }
        if heard > 0 {
            return self.receive_on();
        }
        nothing_heard(heard)
    }

    /// Goes on with what begins in the buffer.
    #[cfg_attr(not(target_os = "none"), inline(never))]
    fn receive_on(&mut self) -> Status {
        loop {
            let end = usize::from(self.end);
            let mut until = AT_ONCE;
            let frame = self.lent.frame();
            match tcp::header(frame.get(..end).unwrap_or_default()) {
                Ok(header) => until = header.total,
                Err(Status::INCOMPLETE_FRAME) => {}
                Err(_) => return self.give_up(),
            }
            if end >= until {
                return self.found_in_stream(until);
            }
            let heard = if FIRMWARE {
                self.hear_apart(until)
            } else {
                self.take(until)
            };
            if heard <= 0 {
                return nothing_heard(heard);
            }
        }
    }

    /// The first frame of what arrived is of this length.
    #[inline(always)]
    fn found_in_stream(&mut self, length: usize) -> Status {
        let end = usize::from(self.end);
        if AT_ONCE > LEAST_TCP && end != length {
            self.keep_ahead(length);
        }
        self.found(length - tcp::PDU)
    }

    /// Puts aside what stands behind a frame that is shorter than what is taken
    /// at once.
    #[cold]
    fn keep_ahead(&mut self, length: usize) {
        let end = usize::from(self.end);
        let behind = self.lent.frame().get(length..end).unwrap_or_default();
        let mut aside = [0; 4];
        for (place, byte) in aside.iter_mut().zip(behind) {
            *place = *byte;
        }
        self.last_byte = u32::from_ne_bytes(aside);
        self.ahead = behind.len() as u8;
    }

    /// Begins the next frame with what was put aside.
    #[cold]
    pub(super) fn take_ahead(&mut self) {
        let aside = self.last_byte.to_ne_bytes();
        let count = core::mem::take(&mut self.ahead);
        let aside = aside.get(..count.into()).unwrap_or_default();
        for (place, byte) in self.lent.frame().iter_mut().zip(aside) {
            *place = *byte;
        }
        self.end = count.into();
    }

    #[inline(always)]
    pub(super) fn seal_tcp(&mut self, length: usize) -> usize {
        if let [high, low] = self.lent.part(4, 6) {
            [*high, *low] = tcp::length(length);
        }
        tcp::PDU + length
    }
}
