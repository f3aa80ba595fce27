//! The responder: turns a request frame into a response frame. It keeps no state.

use super::framing::{ascii_space, rtu_space, tcp_space};
use super::indication::{SERIAL, STREAM};
use super::{Indication, Reply, Units};
use crate::error::{Error, Status};
use crate::frame::{ascii, rtu, tcp, Framing};
use crate::pdu::limits::MAX_PDU;

/// Lets `units` serve the request frame in the first `length` bytes of `buffer`, and writes the
/// response frame over it, with a normal or an exception response. Returns the length of the
/// response frame. It is 0 if no response may be sent: the request frame is damaged or
/// incomplete, is addressed to another unit or broadcast, or the unit is in listen only mode.
/// `delimiter` is the end character of ASCII frames.
///
/// # Errors
/// [`Status::PENDING`] if a service is not finished. The request frame is then unchanged, except
/// for ASCII: its decoding has overwritten the frame. So put an ASCII frame into the buffer again
/// before the next call.
pub fn respond(
    framing: Framing,
    delimiter: u8,
    buffer: &mut [u8],
    length: usize,
    units: &mut (impl Units + ?Sized),
) -> Result<usize, Error> {
    let (mut info, space) = (Indication::NONE, buffer.len());
    let frame = buffer.get_mut(..length).unwrap_or_default();
    let adu = framing.parse(frame, delimiter);
    let (transaction, pdu) = adu.map_or((0, 0), |adu| {
        info.to = adu.unit;
        (adu.transaction, adu.pdu.len())
    });
    info.own = if framing.is_serial() { SERIAL } else { STREAM };
    info.length = pdu as u16;
    let space = match framing {
        Framing::Rtu | Framing::RtuOverTcp => rtu_space(space),
        Framing::Ascii => ascii_space(space),
        Framing::Tcp => tcp_space(space),
    };
    info.head = match framing {
        Framing::Tcp => tcp::PDU,
        _ => rtu::PDU,
    } as u8;
    info.space = space as u16;
    let start = usize::from(info.head);
    let Some(place) = buffer.get_mut(start..start + space) else {
        return Ok(0);
    };
    // The space must hold the request, and at least the two bytes of an exception.
    if pdu > place.len().min(MAX_PDU) || place.len() < 2 {
        return Ok(0);
    }
    let reply = units.serve(&info, place);
    if reply == Reply::PENDING {
        return Status::PENDING.result().map(|()| 0);
    }
    let mut written = reply.write_exception(place);
    if written == 0 {
        return Ok(0);
    }
    // A service may write a longer response, because it relies on the smallest buffer of a server.
    if written > place.len() {
        written = Reply::SERVER_DEVICE_FAILURE.write_exception(place);
    }
    let unit = info.to;
    framing.emit(buffer, transaction, unit, delimiter, |_| Ok(written))
}

/// The default end character of ASCII frames.
pub const DELIMITER: u8 = ascii::END;
