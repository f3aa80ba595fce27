//! Application data units: how a PDU and its unit travel on a line.

mod adu;
pub mod ascii;
pub mod checksum;
pub mod rtu;
pub mod tcp;

pub use adu::Adu;

use crate::error::Status;

/// How frames are told apart.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
#[repr(u8)]
pub enum Framing {
    /// Serial line, binary (serial line guide V1.02, 2.5.1).
    Rtu,
    /// Serial line, hexadecimal characters (serial line guide V1.02, 2.5.2).
    Ascii,
    /// TCP, with the MBAP header (messaging on TCP/IP guide V1.0b, 3.1.3).
    Tcp,
    /// RTU frames in a TCP stream, where silence tells nothing.
    RtuOverTcp,
}

impl Framing {
    /// The framing of a number that C hands in.
    pub const fn from_code(code: u8) -> Option<Framing> {
        match code {
            0 => Some(Framing::Rtu),
            1 => Some(Framing::Ascii),
            2 => Some(Framing::Tcp),
            3 => Some(Framing::RtuOverTcp),
            _ => None,
        }
    }

    /// True on a serial line: unit 0 is broadcast there.
    pub const fn is_serial(self) -> bool {
        matches!(self, Framing::Rtu | Framing::Ascii)
    }

    /// The most bytes that a frame has.
    pub const fn max_frame(self) -> usize {
        match self {
            Framing::Rtu | Framing::RtuOverTcp => rtu::MAX_FRAME,
            Framing::Ascii => ascii::MAX_FRAME,
            Framing::Tcp => tcp::MAX_FRAME,
        }
    }

    /// The frame that is the whole of `bytes`. An ASCII frame is decoded where
    /// it stands, which overwrites it; `end` is its last character.
    ///
    /// # Errors
    /// [`Status::INCOMPLETE_FRAME`], [`Status::MALFORMED_FRAME`], or
    /// [`Status::INVALID_CRC`], for a wrong LRC too.
    pub fn parse(self, bytes: &mut [u8], end: u8) -> Result<Adu<'_>, Status> {
        match self {
            Framing::Rtu | Framing::RtuOverTcp => rtu::parse(bytes),
            Framing::Ascii => ascii::parse(bytes, end),
            Framing::Tcp => tcp::parse(bytes),
        }
    }

    /// Writes the frame of the PDU that `pdu` writes; returns its length. The
    /// `transaction` is for TCP, `end` for ASCII.
    ///
    /// # Errors
    /// As `pdu` says; [`Status::BUFFER_TOO_SMALL`].
    pub fn emit(
        self,
        buffer: &mut [u8],
        transaction: u16,
        unit: u8,
        end: u8,
        pdu: impl FnOnce(&mut [u8]) -> Result<usize, Status>,
    ) -> Result<usize, Status> {
        match self {
            Framing::Rtu | Framing::RtuOverTcp => rtu::emit(buffer, unit, pdu),
            Framing::Ascii => ascii::emit(buffer, unit, end, pdu),
            Framing::Tcp => tcp::emit(buffer, transaction, unit, pdu),
        }
    }
}
