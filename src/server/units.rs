//! Units: for whom a request is, and who serves it.

use super::diagnostics::Diagnostics;
use super::Reply;
use crate::pdu::{bits, files, registers};

/// A frame that was found.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
#[repr(C)]
pub struct Heading {
    /// The unit that it is for.
    pub to: u8,
    /// The id that means the server itself: 255 in a stream; on a serial line 0, which
    /// is broadcast there.
    pub own: u8,
    /// Bytes are missing at its front: the buffer could not hold them.
    pub overrun: bool,
    /// Where its PDU stands.
    pub head: u8,
    /// It was handed out before, and a service was not done.
    pub again: bool,
    /// The length of its PDU; 0 if the frame arrived damaged.
    pub length: u16,
    /// What the response PDU may take.
    pub room: u16,
}

/// What a frame is to a unit.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
#[cfg_attr(target_arch = "avr", repr(u8))]
#[cfg_attr(not(target_arch = "avr"), repr(usize))]
pub enum Concern {
    /// Another unit's, or damaged.
    Foreign,
    /// Its own.
    Own,
    /// Everybody's, which nobody answers.
    Broadcast,
}

/// The id of a unit that answers to any.
pub const ANY: u8 = 0;

impl Heading {
    /// No frame yet.
    pub const NONE: Heading = Heading {
        to: 0,
        own: STREAM,
        overrun: false,
        head: 1,
        again: false,
        length: 0,
        room: 0,
    };

    /// What the frame is, to a unit that it is for if it is for one.
    #[inline]
    pub const fn concern(&self, function: u8) -> Concern {
        match self.concern_of_all() {
            Concern::Broadcast if !only_writes(function) => Concern::Foreign,
            concern => concern,
        }
    }

    /// As [`Heading::concern`], of any function.
    #[inline(always)]
    pub const fn concern_of_all(&self) -> Concern {
        if self.length == 0 {
            Concern::Foreign
        } else if self.is_broadcast() {
            Concern::Broadcast
        } else {
            Concern::Own
        }
    }

    /// True if everybody is meant.
    #[inline]
    pub const fn is_broadcast(&self) -> bool {
        self.is_serial() && self.to == 0
    }

    /// True on a serial line.
    #[inline]
    pub const fn is_serial(&self) -> bool {
        self.own == SERIAL
    }

    /// True if a unit of this id is meant, by what is no broadcast.
    #[inline]
    pub const fn is_for(&self, id: u8) -> bool {
        self.to == id || id == ANY || self.is_for_any()
    }

    /// True if the server itself is meant, by what is no broadcast. In a stream, the ids 0
    /// and 255 mean it (messaging on TCP/IP guide V1.0b, 4.4.1.2).
    #[inline]
    pub const fn is_for_any(&self) -> bool {
        self.to == 0 || self.to == self.own
    }
}

/// [`Heading::own`] on a serial line.
pub const SERIAL: u8 = 0;
/// [`Heading::own`] in a stream.
pub const STREAM: u8 = 255;

/// True for functions that only write, and those that users define: others are
/// not carried out when they are broadcast (serial line guide V1.02, 2.1).
#[inline]
pub const fn only_writes(function: u8) -> bool {
    matches!(
        function,
        bits::WRITE_SINGLE_COIL
            | bits::WRITE_MULTIPLE_COILS
            | registers::WRITE_SINGLE_REGISTER
            | registers::WRITE_MULTIPLE_REGISTERS
            | registers::MASK_WRITE_REGISTER
            | files::WRITE_FILE_RECORD
            | 0x41..
    )
}

/// A family of functions.
pub trait Service {
    /// Serves a request, if it is one of this family: its PDU is the front
    /// `length` bytes of `pdu`. A response overwrites it.
    fn serve(&mut self, pdu: &mut [u8], length: usize) -> Reply;
}

/// What serves the frames of a line.
pub trait Units {
    /// Serves a frame, whosoever it is. Its PDU is at the front of `pdu`.
    fn serve(&mut self, heading: &Heading, pdu: &mut [u8]) -> Reply;
}

/// One unit: its id and what it serves.
pub struct Unit<'a> {
    /// 1 to 247; 0, in a stream, is any.
    pub id: u8,
    /// What it serves; the first that does serves a function.
    pub services: &'a mut [&'a mut dyn Service],
    /// What it knows of the line: serves 08, 0B and 0C.
    pub diagnostics: Option<&'a mut Diagnostics>,
}

impl Unit<'_> {
    fn walk(&mut self, pdu: &mut [u8], length: usize) -> Reply {
        for service in self.services.iter_mut() {
            match service.serve(pdu, length) {
                Reply::NOT_MINE => {}
                reply => return reply,
            }
        }
        let diagnostics = self.diagnostics.as_mut();
        match diagnostics.map(|line| line.serve(pdu, length).0) {
            None | Some(Reply::NOT_MINE) => Reply::ILLEGAL_FUNCTION,
            Some(reply) => reply,
        }
    }

    /// Serves a frame, of which notice is taken.
    fn serve(&mut self, heading: &Heading, concern: Concern, pdu: &mut [u8]) -> Reply {
        let length = usize::from(heading.length);
        let function = pdu.first().copied().unwrap_or(0);
        let mut served = concern != Concern::Foreign;
        if let Some(line) = &mut self.diagnostics {
            served = line.hear(heading, concern, pdu.get(..length).unwrap_or_default());
        }
        if !served {
            return Reply::SILENT;
        }
        let reply = self.walk(pdu, length);
        if let (Some(line), true) = (&mut self.diagnostics, reply != Reply::PENDING) {
            line.done(concern, function, reply);
        }
        reply
    }
}

impl Units for [Unit<'_>] {
    fn serve(&mut self, heading: &Heading, pdu: &mut [u8]) -> Reply {
        let mut all = heading.concern(pdu.first().copied().unwrap_or(0));
        let mut answer = Reply::SILENT;
        for unit in self {
            let mut concern = all;
            if all == Concern::Own && !heading.is_for(unit.id) {
                concern = Concern::Foreign;
            }
            let reply = unit.serve(heading, concern, pdu);
            if concern == Concern::Own {
                answer = reply;
                all = Concern::Foreign;
            }
        }
        answer
    }
}
