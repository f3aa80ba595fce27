//! Frames described in words.

use super::framing::mbm_framing;
use super::packet::side;
use super::pointers::{In, Out};
use core::ffi::c_char;
use mbm::error::{Error, Status};
use mbm::text::{self, TextWriter};

/// The writer of a line of text into a buffer of C. It is an error if `size` is 0: the
/// zero byte that ends the line must fit.
pub(super) fn line<'a>(text: Out<c_char>, size: u16) -> Result<TextWriter<'a>, Error> {
    // A character is a byte.
    let text = text.cast().buffer(size)?;
    match text.first_mut() {
        Some(first) => *first = 0,
        None => return Err(Error::BufferTooSmall),
    }
    Ok(TextWriter::new(text))
}

/// The status code of a text: whether the whole text fitted.
pub(super) fn outcome(written: Result<TextWriter, Error>) -> u8 {
    match written.and_then(TextWriter::finish) {
        Ok(_) => Status::OK.code(),
        Err(refused) => refused.code(),
    }
}

/// Describes a frame in one line of words, for example
/// "unit 17  request    03 read holding registers  107..109", or
/// "bad CRC, 8 bytes" if the frame is damaged.
///
/// Any thread or interrupt may call it. On a Cortex-M it takes 976 bytes of stack.
///
/// @param kind         MBM_PACKET_REQUEST, or MBM_PACKET_RESPONSE for responses and exceptions
/// @param frame        the frame, from its first byte to its last
/// @param frameLength  the number of bytes of `frame`
/// @param text         receives the line. A zero byte always ends it
/// @param size         bytes of `text`; 200 suffice for most frames, 2295 for all
/// @return a status; MBM_BUFFER_TOO_SMALL if `text` received only the start of the line;
///         MBM_INVALID_ARGUMENT for MBM_FRAMING_NONE
#[no_mangle]
pub extern "C" fn mbm_frame_text(
    framing: In<mbm_framing>,
    kind: u8,
    frame: In<u8>,
    frameLength: u16,
    text: Out<c_char>,
    size: u16,
) -> u8 {
    let write = || {
        let mut line = line(text, size)?;
        let description = framing.get()?;
        let (framing, end) = (description.of_frames()?, description.end());
        let frame = frame.slice(frameLength.into())?;
        text::frame(&mut line, framing, side(kind)?, frame, end);
        Ok(line)
    };
    outcome(write())
}
