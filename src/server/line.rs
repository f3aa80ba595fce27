//! A server on one line or connection, moved on by `poll`.
//!
//! It finds a request, hands its PDU out, takes the reply and sends it. So no reference to it
//! need live while a request is carried out. A framing is two functions kept in the object, so
//! that firmware carries those it begins with.

use super::info::STREAM;
use super::{Reply, RequestInfo, Units};
use crate::bytes::move_to_front;
use crate::error::Status;
use crate::frame::checksum::Crc16;
use crate::frame::{ascii, rtu, tcp, Framing};
use crate::pdu::custom::Rule;
use crate::pdu::limits::MAX_PDU;
use crate::port::Port;
use crate::time::{self, elapsed};
use crate::FIRMWARE;

/// How soon to look again at what only the port or a service can bring on.
const NOT_BY_ITSELF: u32 = time::millis(1);

/// Requests that one poll takes at most of which none is answered: a peer that floods
/// with those of others holds nobody up.
pub const MOST_REQUESTS: u8 = 16;

/// What the caller lends to a server.
pub trait ServerStorage {
    /// The storage of one frame: a request first, then its response.
    fn frame(&mut self) -> &mut [u8];

    /// How many bytes that storage has.
    fn capacity(&mut self) -> usize {
        self.frame().len()
    }

    /// The bytes of that storage from `start` to `end`, both of which lie in it, the first
    /// not behind the second.
    fn part(&mut self, start: usize, end: usize) -> &mut [u8] {
        self.frame().get_mut(start..end).unwrap_or_default()
    }

    /// The byte at a place of that storage.
    fn byte(&mut self, place: usize) -> u8 {
        self.part(place, place + 1).first().copied().unwrap_or(0)
    }

    /// Moves the bytes of that storage from `start` to `end` to its front; the places are
    /// as for [`ServerStorage::part`].
    fn keep(&mut self, start: usize, end: usize) {
        move_to_front(self.part(0, end), start);
    }

    /// How long the requests of a user's function are, for framings without
    /// silence.
    fn rule(&self, function: u8) -> Option<Rule> {
        let _ = function;
        None
    }
}

impl ServerStorage for &mut [u8] {
    fn frame(&mut self) -> &mut [u8] {
        self
    }
}

impl<const N: usize> ServerStorage for [u8; N] {
    fn frame(&mut self) -> &mut [u8] {
        self
    }
}

/// Where a server stands.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
#[repr(u8)]
enum Phase {
    /// Waiting for a request.
    Listen,
    /// A request is there, to be answered.
    Request,
    /// Handing the response to the port, and waiting for the port to drain; the
    /// driver is on.
    Send,
}

/// Looks for a request in what arrives: [`Status::PENDING`] once there is one,
/// with its PDU behind the head and its length noted.
pub(super) type Receive<P, B> = fn(&mut Server<P, B>) -> Status;

/// Makes a frame of the response PDU of so many bytes; returns its length.
pub(super) type EncodeAdu<P, B> = fn(&mut Server<P, B>, usize) -> usize;

/// A server on one line or connection.
// In this order, small fields first: see `Transaction`.
#[repr(C)]
pub struct Server<P, B> {
    phase: Phase,
    /// What arrives is no frame that tells its length; of an echo, that it is waited for.
    pub(super) resyncing: bool,
    /// Ends an ASCII frame.
    pub(super) delimiter: u8,
    /// Over TCP: how many bytes of `last_byte` are the front of the next frame.
    pub(super) read_ahead: u8,
    /// The CRC of what arrived.
    pub(super) crc: Crc16,
    /// Where in the buffer ends what arrived, or what is to be sent.
    pub(super) end: u16,
    /// What of the response was sent; of that, what may still come back.
    pub(super) sent: u16,
    /// The request that was found last.
    pub request: RequestInfo,
    /// When the last byte arrived; see [`Server::keeps_time`].
    pub(super) last_byte: u32,
    /// What the caller lends.
    pub storage: B,
    pub(super) now: u32,
    /// The silence that ends a frame.
    silence: u32,
    pub(super) receive: Option<Receive<P, B>>,
    pub(super) encode_adu: Option<EncodeAdu<P, B>>,
    /// The byte stream.
    pub port: P,
}

impl<P: Port, B: ServerStorage> Server<P, B> {
    /// A server that has no framing yet.
    pub const fn new(port: P, storage: B) -> Self {
        Server {
            phase: Phase::Listen,
            resyncing: false,
            delimiter: ascii::END,
            read_ahead: 0,
            crc: Crc16::START,
            end: 0,
            sent: 0,
            request: RequestInfo::NONE,
            last_byte: 0,
            now: 0,
            silence: time::DEFAULT_SILENCE,
            receive: None,
            encode_adu: None,
            storage,
            port,
        }
    }

    /// A server of this framing.
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

    /// Begins to listen: drops what was under way.
    #[inline(always)]
    pub(super) fn begin(
        &mut self,
        head: u8,
        space: usize,
        receive: Receive<P, B>,
        encode_adu: EncodeAdu<P, B>,
    ) {
        self.request.head = head;
        self.request.own = STREAM;
        self.request.space = space as u16;
        self.receive = Some(receive);
        self.encode_adu = Some(encode_adu);
        if !FIRMWARE {
            self.read_ahead = 0;
        }
        self.listen();
    }

    /// True while a response is leaving, with the driver on.
    #[inline(always)]
    pub fn is_sending(&self) -> bool {
        self.phase == Phase::Send
    }

    /// Sets the silence that ends a frame, in microseconds: t3.5 for RTU, the
    /// inter-character timeout for ASCII.
    pub fn set_silence(&mut self, microseconds: u32) {
        self.silence = time::clamped(microseconds);
    }

    /// Waits for the next request.
    #[cfg_attr(target_os = "none", inline(never))]
    #[cfg_attr(not(target_os = "none"), inline(always))]
    pub(super) fn listen(&mut self) {
        self.phase = Phase::Listen;
        self.end = 0;
        self.request.overrun = false;
        self.resyncing = false;
        self.crc = Crc16::START;
        if !FIRMWARE && self.read_ahead != 0 {
            self.use_read_ahead();
        }
    }

    /// True once it was begun.
    #[inline(always)]
    pub fn has_framing(&self) -> bool {
        self.receive.is_some() && self.encode_adu.is_some()
    }

    /// False if [`Server::poll`] may be told any time: over TCP nothing hangs on it.
    #[inline(always)]
    pub fn keeps_time(&self) -> bool {
        usize::from(self.request.head) != tcp::PDU
    }

    /// Moves the server on to the time `now`, without waiting:
    /// [`Status::PENDING`] if there is a request to be answered,
    /// [`Status::LINK_LOST`], [`Status::MALFORMED_FRAME`] if the stream is none
    /// of Modbus TCP, else [`Status::OK`].
    #[cfg_attr(not(target_os = "none"), inline(always))]
    pub fn poll(&mut self, now: u32) -> Status {
        match self.look(now) {
            Status::OK => self.go_on(),
            status => status,
        }
    }

    /// The first half of [`Server::poll`], which looks for a request.
    #[inline(always)]
    pub fn look(&mut self, now: u32) -> Status {
        self.now = now;
        match self.phase {
            Phase::Listen if !FIRMWARE && !self.keeps_time() && self.end == 0 => {
                self.receive_at_once()
            }
            Phase::Listen => match self.receive {
                Some(receive) => receive(self),
                None => Status::NOT_INITIALISED,
            },
            Phase::Request => Status::PENDING,
            Phase::Send => Status::OK,
        }
    }

    /// The second half of [`Server::poll`], which sends what there is.
    #[inline(always)]
    pub fn go_on(&mut self) -> Status {
        if self.phase == Phase::Send {
            self.send()
        } else {
            Status::OK
        }
    }

    /// Nothing more is to be expected of this stream.
    pub(super) fn fail_stream(&mut self) -> Status {
        self.receive = Some(|_| Status::MALFORMED_FRAME);
        Status::MALFORMED_FRAME
    }

    /// Receives behind what has arrived, up to the place `until` of the buffer or to its
    /// end, into the CRC too: how many bytes, negative if the link is lost. A full buffer
    /// takes one byte and gives up its oldest for it, once there is one: one that is full
    /// and silent may hold a frame.
    #[cfg_attr(target_os = "none", inline(always))]
    pub(super) fn read_bytes(&mut self, until: usize) -> i16 {
        let capacity = self.storage.capacity();
        let mut end = usize::from(self.end);
        let (mut start, mut until) = (end, until.min(capacity));
        if end == capacity {
            (start, until) = (0, 1);
        }
        let received = self.port.read(self.storage.part(start, until));
        if received > 0 {
            self.last_byte = self.now;
            if start != end {
                start = self.slide();
            }
            end = start + received as usize;
            self.end = end as u16;
            // A microcontroller takes the CRC of bytes that need none, too: that is
            // less code, and one framing is all it has.
            if FIRMWARE || usize::from(self.request.head) == rtu::PDU {
                self.crc = self.crc.with(self.storage.part(start, end));
            }
        }
        received
    }

    /// As [`Server::read_bytes`], for all framings but the most common, which has it in line.
    #[inline(never)]
    pub(super) fn read_bytes_apart(&mut self, until: usize) -> i16 {
        self.read_bytes(until)
    }

    /// As [`Server::read_bytes`], without CRC and time.
    #[inline(always)]
    pub(super) fn take(&mut self, until: usize) -> i16 {
        let frame = self.storage.frame();
        let until = until.min(frame.len());
        let Some(space) = frame.get_mut(usize::from(self.end)..until) else {
            return 0;
        };
        if space.is_empty() {
            return 0;
        }
        let received = self.port.read(space);
        if received > 0 {
            self.end += received as u16;
        }
        received
    }

    /// True once the line has been silent for as long as ends a frame.
    pub(super) fn is_silent(&self) -> bool {
        time::has_elapsed(self.silence, self.now, self.last_byte)
    }

    /// How long, in microseconds from `now`, poll will find nothing to do unless
    /// a byte arrives. While a service is not done, or a stream does not take the
    /// response, 1000: to go on sooner, poll when that has changed.
    pub fn poll_delay(&self, now: u32) -> u32 {
        match self.phase {
            Phase::Listen if self.end == 0 || !self.keeps_time() => u32::MAX,
            Phase::Listen => self.silence.saturating_sub(elapsed(now, self.last_byte)),
            // On a line no byte and no driver may be late.
            Phase::Send if self.request.is_serial() => 0,
            _ => NOT_BY_ITSELF,
        }
    }

    /// Says that a request was found whose PDU has so many bytes; 0 for a frame
    /// that arrived damaged.
    pub(super) fn found(&mut self, length: usize) -> Status {
        let unit = self.storage.byte(usize::from(self.request.head) - 1);
        self.found_for(unit, if length > MAX_PDU { 0 } else { length as u16 })
    }

    /// As [`Server::found`], for this unit, with a length that a PDU has.
    #[inline(always)]
    pub(super) fn found_for(&mut self, unit: u8, length: u16) -> Status {
        self.request.to = unit;
        self.request.length = length;
        self.request.again = false;
        self.phase = Phase::Request;
        Status::PENDING
    }

    /// The request's PDU and the room behind it, which the response may take.
    pub fn pdu(&mut self) -> &mut [u8] {
        let head = usize::from(self.request.head);
        let space = usize::from(self.request.space);
        self.storage
            .frame()
            .get_mut(head..head + space)
            .unwrap_or_default()
    }

    /// As [`Server::poll`], with requests served by `units` and answered.
    pub fn serve(&mut self, now: u32, units: &mut (impl Units + ?Sized)) -> Status {
        for _ in 0..MOST_REQUESTS {
            let status = self.poll(now);
            if status != Status::PENDING {
                return status;
            }
            let info = self.request;
            let reply = units.serve(&info, self.pdu());
            if let Some(status) = self.finish(reply) {
                return status;
            }
        }
        Status::OK
    }

    /// Takes the reply to the request: a response stands where its PDU stood.
    /// False, with the request kept, for [`Reply::PENDING`].
    pub fn answer(&mut self, reply: Reply) -> bool {
        self.answer_served(reply.or_illegal())
    }

    /// As [`Server::answer`], to a request that was served.
    #[cfg_attr(target_os = "none", inline(always))]
    pub fn answer_served(&mut self, reply: Reply) -> bool {
        if reply == Reply::PENDING {
            self.request.again = true;
            return false;
        }
        let head = usize::from(self.request.head);
        let length = reply.write_served_exception(self.storage.part(head, head + 2));
        match self.encode_adu {
            Some(encode_adu) if length != 0 => {
                self.end = encode_adu(self, length) as u16;
                self.sent = 0;
                self.phase = Phase::Send;
                self.port.pre_transmission();
            }
            _ => self.listen(),
        }
        true
    }

    /// As [`Server::answer`], and what to return, unless [`Server::poll`] is to go
    /// on: it sends, or looks for the next request.
    #[inline(always)]
    pub fn finish(&mut self, reply: Reply) -> Option<Status> {
        if !FIRMWARE {
            return self.answer_at_once(reply);
        }
        if self.answer(reply) {
            None
        } else {
            Some(Status::OK)
        }
    }

    /// As [`Server::finish`], and sends what it can, for a host, which saves a turn
    /// of [`Server::poll`].
    #[inline(always)]
    pub(crate) fn answer_at_once(&mut self, reply: Reply) -> Option<Status> {
        let mut length = reply.response_length();
        if length == 0 {
            length = match reply.exception_code() {
                0 if reply != Reply::NOT_HANDLED => return self.answer_nothing(reply),
                _ => self.write_exception(reply),
            };
        }
        self.port.pre_transmission();
        let end = match self.encode_adu {
            _ if !self.keeps_time() => self.encode_tcp(length),
            Some(encode_adu) => {
                let end = encode_adu(self, length);
                self.sent = end as u16;
                end
            }
            None => 0,
        };
        let sent = self.port.write(self.storage.part(0, end));
        if usize::from(sent as u16) != end || !self.port.flush() {
            return Some(self.sent_some(end, sent));
        }
        self.end_transmission();
        Some(Status::OK)
    }

    /// The port took so many of the bytes of a response at once, or is lost.
    #[cold]
    fn sent_some(&mut self, end: usize, sent: i16) -> Status {
        self.end = end as u16;
        self.sent = sent.max(0) as u16;
        if sent < 0 {
            self.end_transmission();
            return Status::LINK_LOST;
        }
        self.phase = Phase::Send;
        Status::OK
    }

    #[cold]
    fn answer_nothing(&mut self, reply: Reply) -> Option<Status> {
        if self.answer(reply) {
            None
        } else {
            Some(Status::OK)
        }
    }

    #[inline(never)]
    fn write_exception(&mut self, reply: Reply) -> usize {
        reply.write_exception(self.pdu())
    }

    #[cfg_attr(not(target_os = "none"), inline(never))]
    fn send(&mut self) -> Status {
        let mut status = Status::OK;
        let rest = self.storage.part(self.sent.into(), self.end.into());
        if !rest.is_empty() {
            let sent = self.port.write(rest);
            if sent < 0 {
                status = Status::LINK_LOST;
            } else {
                self.sent += sent as u16;
                if self.sent < self.end {
                    return status;
                }
            }
        }
        if status == Status::LINK_LOST || self.port.flush() {
            self.end_transmission();
        }
        status
    }

    #[cfg_attr(not(target_os = "none"), inline(always))]
    fn end_transmission(&mut self) {
        self.port.post_transmission();
        self.listen();
    }
}
