//! Whom a frame is for.

use super::table::Small;
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
#[repr(transparent)]
pub struct Concern(Small);

impl Concern {
    /// Another unit's, or damaged.
    pub const FOREIGN: Concern = Concern(0);
    /// Its own.
    pub const OWN: Concern = Concern(1);
    /// Everybody's, which nobody answers.
    pub const BROADCAST: Concern = Concern(2);

    /// The number of this concern, as C sees it.
    #[inline(always)]
    #[allow(clippy::unnecessary_cast)] // It is needed on an AVR.
    pub const fn code(self) -> u8 {
        self.0 as u8
    }

    /// What a frame that is this to the units that it is for is to the others.
    #[inline(always)]
    #[must_use]
    pub const fn to_others(self) -> Concern {
        Concern(self.0 & Concern::BROADCAST.0)
    }
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
            Concern::BROADCAST if !only_writes(function) => Concern::FOREIGN,
            concern => concern,
        }
    }

    /// As [`Heading::concern`], of any function.
    #[inline(always)]
    pub const fn concern_of_all(&self) -> Concern {
        if self.length == 0 {
            Concern::FOREIGN
        } else if self.is_broadcast() {
            Concern::BROADCAST
        } else {
            Concern::OWN
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
