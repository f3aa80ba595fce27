//! Finds the unit to which a received frame is addressed.

use super::reply::Refusal;
use super::table::MachineByte;
use crate::frame::rtu;
use crate::pdu::functions::{self, Direction};
use crate::pdu::EXCEPTION;

/// The address and the position of a received frame.
///
/// ```
/// use mbm::server::{Indication, Reply, Tables, Unit, Units};
///
/// /// Counts the frames that address the unit.
/// struct Counted<U> {
///     unit: U,
///     frames: u32,
/// }
///
/// impl<U: Units> Units for Counted<U> {
///     fn serve(&mut self, info: &Indication, pdu: &mut [u8]) -> Reply {
///         self.frames += u32::from(info.to == 17);
///         self.unit.serve(info, pdu)
///     }
///
///     fn has(&self, unit: u8) -> bool {
///         self.unit.has(unit)
///     }
/// }
/// let counted = Counted { unit: Unit::new(17, Tables::NONE), frames: 0 };
/// assert!(counted.has(17) && !counted.has(18));
/// ```
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
#[repr(C)]
pub struct Indication {
    /// The unit id in the frame.
    pub to: u8,
    /// A second id that addresses the server itself: 255 in a stream; 0, the broadcast address,
    /// on a serial line.
    pub own: u8,
    /// The frame was longer than the buffer, so its first bytes are missing.
    pub overrun: bool,
    /// Index of the PDU in the buffer.
    pub head: u8,
    /// The frame was served before, and the service returned that it is not finished. After the
    /// response it means that bytes may have arrived that the server has not read.
    pub again: bool,
    /// What the services of the unit lack that were called. A service of C looks at it.
    pub refusal: Refusal,
    /// Length of the PDU; 0 if the frame is damaged.
    pub length: u16,
    /// Greatest length of the response PDU.
    pub space: u16,
}

/// How a frame addresses a unit.
///
/// ```
/// use mbm::server::{Addressing, Indication};
///
/// /// Whether unit 17 responds to a frame with this function code.
/// fn responds(info: &Indication, function: u8) -> bool {
///     info.to == 17 && info.addressing(function) == Addressing::OWN
/// }
/// ```
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
#[repr(transparent)]
pub struct Addressing(MachineByte);

impl Addressing {
    /// The frame is for another unit, or damaged.
    pub const FOREIGN: Addressing = Addressing(0);
    /// The frame is for this unit.
    pub const OWN: Addressing = Addressing(1);
    /// The frame is a broadcast: each unit carries it out, no unit responds.
    pub const BROADCAST: Addressing = Addressing(2);

    /// The number of this addressing in the C API.
    // For the C API; it may change in any version.
    #[doc(hidden)]
    #[inline(always)]
    #[allow(clippy::unnecessary_cast)] // It is needed on an AVR.
    pub const fn code(self) -> u8 {
        self.0 as u8
    }

    /// How the frame addresses the units whose id it does not have: a broadcast is for them
    /// too, any other frame is not.
    #[inline(always)]
    #[must_use]
    pub(crate) const fn to_others(self) -> Addressing {
        Addressing(self.0 & Addressing::BROADCAST.0)
    }
}

/// The id of a unit that responds to every id.
pub const ANY: u8 = 0;

impl Indication {
    /// No frame has been received yet.
    pub const NONE: Indication = Indication {
        to: 0,
        own: STREAM,
        overrun: false,
        head: 1,
        again: false,
        refusal: Refusal::NONE,
        length: 0,
        space: 0,
    };

    /// How the frame, with this function code, addresses the unit that its id names.
    ///
    /// ```
    /// use mbm::server::{Addressing, Indication};
    ///
    /// // A broadcast may write, but not read.
    /// let broadcast = Indication { to: 0, own: 0, length: 5, ..Indication::NONE };
    /// assert_eq!(broadcast.addressing(6), Addressing::BROADCAST);
    /// assert_eq!(broadcast.addressing(3), Addressing::FOREIGN);
    /// ```
    #[inline]
    pub const fn addressing(&self, function: u8) -> Addressing {
        match self.addressing_of_all(function) {
            Addressing::BROADCAST if !only_writes(function) => Addressing::FOREIGN,
            addressing => addressing,
        }
    }

    /// As [`Indication::addressing`], but services drop a broadcast of a function that reads.
    // For the C API; it may change in any version.
    #[doc(hidden)]
    #[inline(always)]
    pub const fn addressing_of_all(&self, function: u8) -> Addressing {
        if self.length == 0 || self.is_from_server(function) {
            Addressing::FOREIGN
        } else if self.is_broadcast() {
            Addressing::BROADCAST
        } else {
            Addressing::OWN
        }
    }

    /// True for a response. Its sender is another server, or this one if its receiver gets the
    /// bytes that the driver sends. It is never answered. The function codes from 80 (hex) on
    /// are those of exception responses (application protocol V1.1b3, 4.1). In Modbus TCP each
    /// client has a connection of its own, so there it is a request that is not valid.
    #[inline(always)]
    const fn is_from_server(&self, function: u8) -> bool {
        function & EXCEPTION != 0 && self.head as usize == rtu::PDU
    }

    /// True if the frame is a broadcast.
    // For the C API; it may change in any version.
    #[doc(hidden)]
    #[inline]
    pub const fn is_broadcast(&self) -> bool {
        self.is_serial() && self.to == 0
    }

    /// True on a serial line.
    #[inline]
    pub(crate) const fn is_serial(&self) -> bool {
        self.own == SERIAL
    }

    /// True if a frame that is no broadcast addresses a unit with this id.
    // For the C API; it may change in any version.
    #[doc(hidden)]
    #[inline]
    pub const fn is_for(&self, id: u16) -> bool {
        self.to as u16 == id || id == ANY as u16 || self.is_for_any()
    }

    /// True if a frame that is no broadcast addresses the server itself. In a stream the ids 0
    /// and 255 do (messaging on TCP/IP guide V1.0b, 4.4.1.2).
    #[inline]
    pub(crate) const fn is_for_any(&self) -> bool {
        self.to == 0 || self.to == self.own
    }
}

/// [`Indication::own`] on a serial line.
pub const SERIAL: u8 = 0;
/// [`Indication::own`] in a stream.
pub const STREAM: u8 = 255;

/// True for functions that only write and for user-defined functions. Other functions are
/// not carried out if they are broadcast (serial line guide V1.02, 2.1).
// For the C API; it may change in any version.
#[doc(hidden)]
#[inline]
pub const fn only_writes(function: u8) -> bool {
    function > 0x40 || matches!(functions::direction(function), Direction::Writes)
}
