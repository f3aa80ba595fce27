//! The framings, as C programs name them.

use super::functions::mbm_function;
use super::pointers::In;
use mbm::error::Error;
use mbm::frame::{ascii, tcp, Framing};

/// RTU: serial line, binary, with a CRC-16 (serial line guide V1.02, 2.5.1).
pub const MBM_FRAMING_RTU: u8 = 0;
/// ASCII: serial line, hexadecimal characters, with an LRC (serial line guide V1.02, 2.5.2).
pub const MBM_FRAMING_ASCII: u8 = 1;
/// TCP: the PDU follows the MBAP header (messaging on TCP/IP guide V1.0b, 3.1.3).
pub const MBM_FRAMING_TCP: u8 = 2;
/// RTU frames in a TCP stream.
pub const MBM_FRAMING_RTU_OVER_TCP: u8 = 3;
/// No frame: the PDU alone, for the mbm_frame functions.
pub const MBM_FRAMING_NONE: u8 = 4;

/// The maximum length of a TCP frame, in bytes.
pub const MBM_MAX_TCP_FRAME: u16 = 260;
/// The maximum length of an ASCII frame, in characters.
pub const MBM_MAX_ASCII_FRAME: u16 = 513;

const _: () = {
    assert!(MBM_FRAMING_RTU == Framing::Rtu as u8);
    assert!(MBM_FRAMING_ASCII == Framing::Ascii as u8);
    assert!(MBM_FRAMING_TCP == Framing::Tcp as u8);
    assert!(MBM_FRAMING_RTU_OVER_TCP == Framing::RtuOverTcp as u8);
    assert!(MBM_MAX_TCP_FRAME as usize == tcp::MAX_FRAME);
    assert!(MBM_MAX_ASCII_FRAME as usize == ascii::MAX_FRAME);
};

/// Describes frames: their framing, and the functions of your own in them. As MBM_INIT, it
/// means RTU with the functions of the standard only.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct mbm_framing {
    /// The declarations of your own functions; may be NULL if `functionCount` is 0.
    pub functions: *const mbm_function,
    /// The number of declarations in `functions`.
    pub functionCount: u8,
    /// MBM_FRAMING_RTU, _ASCII, _TCP, _RTU_OVER_TCP or _NONE.
    pub kind: u8,
    /// ASCII only: the last character of a frame; 0 means line feed (V1.1b3, 6.8.1,
    /// sub-function 03).
    pub delimiter: u8,
}

impl mbm_framing {
    /// Converts the framing to the core's type. `None` is MBM_FRAMING_NONE.
    pub(super) fn core(&self) -> Result<Option<Framing>, Error> {
        match Framing::from_code(self.kind) {
            None if self.kind != MBM_FRAMING_NONE => Err(Error::InvalidArgument),
            framing => Ok(framing),
        }
    }

    /// As [`Self::core`], but MBM_FRAMING_NONE is an error.
    pub(super) fn of_frames(&self) -> Result<Framing, Error> {
        self.core()?.ok_or(Error::InvalidArgument)
    }

    /// The declarations.
    pub(super) fn functions<'a>(&self) -> Result<&'a [mbm_function], Error> {
        // SAFETY: C filled in the description as its comment says.
        unsafe { In::new(self.functions) }.slice(self.functionCount.into())
    }

    /// The last character of an ASCII frame.
    pub(super) fn end(&self) -> u8 {
        match self.delimiter {
            0 => ascii::END,
            delimiter => delimiter,
        }
    }
}

/// True for a character that may end ASCII frames.
pub(super) fn is_delimiter(character: u8) -> bool {
    let part_of_a_frame = character.is_ascii_hexdigit() || matches!(character, b':' | b'\r');
    (1..=127).contains(&character) && !part_of_a_frame
}
