//! Frames (application data units): how each framing carries a unit id and a PDU.

pub mod ascii;
pub mod rtu;
pub mod tcp;

pub use rtu::Adu;

use crate::error::Error;

/// The framing: how frames are encoded and separated.
///
/// ```
/// use mbm::frame::{ascii, Framing};
///
/// let mut buffer = [0; Framing::Ascii.max_frame()];
/// let emitted = Framing::Ascii.emit(&mut buffer, 0, 17, ascii::END, |pdu| {
///     pdu[..2].copy_from_slice(&[0x41, 7]);
///     Ok(2)
/// });
/// assert_eq!(emitted, Ok(11));
/// assert_eq!(buffer[..11], *b":114107A7\r\n");
///
/// let adu = Framing::Ascii.parse(&mut buffer[..11], ascii::END)?;
/// assert_eq!((adu.unit, adu.pdu), (17, &[0x41, 7][..]));
/// assert!(Framing::Ascii.is_serial());
/// # Ok::<(), mbm::Error>(())
/// ```
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
#[repr(u8)]
pub enum Framing {
    /// Serial line, binary (serial line guide V1.02, 2.5.1).
    Rtu,
    /// Serial line, hexadecimal characters (serial line guide V1.02, 2.5.2).
    Ascii,
    /// TCP, with the MBAP header (messaging on TCP/IP guide V1.0b, 3.1.3).
    Tcp,
    /// RTU frames in a TCP stream. Silence does not separate frames there.
    RtuOverTcp,
}

impl Framing {
    /// The framing for a number from the C API.
    // For the C API; it may change in any version.
    #[doc(hidden)]
    pub const fn from_code(code: u8) -> Option<Framing> {
        match code {
            0 => Some(Framing::Rtu),
            1 => Some(Framing::Ascii),
            2 => Some(Framing::Tcp),
            3 => Some(Framing::RtuOverTcp),
            _ => None,
        }
    }

    /// True on a serial line. Unit 0 is the broadcast address there.
    pub const fn is_serial(self) -> bool {
        matches!(self, Framing::Rtu | Framing::Ascii)
    }

    /// Length of the longest frame, in bytes.
    pub const fn max_frame(self) -> usize {
        match self {
            Framing::Rtu | Framing::RtuOverTcp => rtu::MAX_FRAME,
            Framing::Ascii => ascii::MAX_FRAME,
            Framing::Tcp => tcp::MAX_FRAME,
        }
    }

    /// Parses the frame that fills `bytes`. An ASCII frame is decoded in place, which overwrites
    /// it; `end` is its end character. Other framings ignore `end`.
    ///
    /// # Errors
    /// [`Error::IncompleteFrame`]; [`Error::MalformedFrame`]; [`Error::InvalidCrc`] if the
    /// CRC or the LRC is wrong.
    pub fn parse(self, bytes: &mut [u8], end: u8) -> Result<Adu<'_>, Error> {
        match self {
            Framing::Rtu | Framing::RtuOverTcp => rtu::parse(bytes),
            Framing::Ascii => ascii::parse(bytes, end),
            Framing::Tcp => tcp::parse(bytes),
        }
    }

    /// As [`Framing::parse`], but does not check the CRC of an RTU frame. The two bytes of the CRC
    /// must be there. Other framings are parsed as ever.
    ///
    /// # Errors
    /// As [`Framing::parse`].
    ///
    /// ```
    /// use mbm::frame::{ascii, Framing};
    ///
    /// // The CRC of this frame would be 5D F0.
    /// let mut frame = [17, 0x41, 7, 0, 0];
    /// assert_eq!(Framing::Rtu.parse(&mut frame, ascii::END), Err(mbm::Error::InvalidCrc));
    /// assert_eq!(Framing::Rtu.parse_without_crc(&mut frame, ascii::END)?.pdu, [0x41, 7]);
    /// # Ok::<(), mbm::Error>(())
    /// ```
    pub fn parse_without_crc(self, bytes: &mut [u8], end: u8) -> Result<Adu<'_>, Error> {
        match self {
            Framing::Rtu | Framing::RtuOverTcp => rtu::parse_without_crc(bytes),
            _ => self.parse(bytes, end),
        }
    }

    /// Writes a frame to `buffer` and returns its length. The callback `pdu` writes the PDU to
    /// the front of the slice that it gets, and returns the length of the PDU. Only TCP uses
    /// `transaction`, only ASCII uses `end`.
    ///
    /// # Errors
    /// The error of `pdu`; [`Error::BufferTooSmall`].
    pub fn emit(
        self,
        buffer: &mut [u8],
        transaction: u16,
        unit: u8,
        end: u8,
        pdu: impl FnOnce(&mut [u8]) -> Result<usize, Error>,
    ) -> Result<usize, Error> {
        match self {
            Framing::Rtu | Framing::RtuOverTcp => rtu::emit(buffer, unit, pdu),
            Framing::Ascii => ascii::emit(buffer, unit, end, pdu),
            Framing::Tcp => tcp::emit(buffer, transaction, unit, pdu),
        }
    }
}
