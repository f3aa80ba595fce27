//! The responder: a frame in, a frame out, and no state between.

use super::framing::{ascii_space, rtu_space, tcp_space};
use super::info::{SERIAL, STREAM};
use super::{Reply, RequestInfo, Units};
use crate::error::Status;
use crate::frame::{ascii, rtu, tcp, Framing};
use crate::pdu::limits::MAX_PDU;

/// Takes the request frame in the front `length` bytes of `buffer`, has `units`
/// serve it, and writes the response frame over it, normal or exception. Returns
/// its length; 0, where there is to be none: for a frame that is damaged or not
/// whole, for another unit, broadcast, or in listen only mode. An ASCII frame
/// ends with `delimiter`.
///
/// # Errors
/// [`Status::PENDING`] if a service is not done; the frame is as it was, but of
/// ASCII its content alone is left, so it is to be put there anew.
pub fn respond(
    framing: Framing,
    delimiter: u8,
    buffer: &mut [u8],
    length: usize,
    units: &mut (impl Units + ?Sized),
) -> Result<usize, Status> {
    let (mut info, space) = (RequestInfo::NONE, buffer.len());
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
    // Room for the request is room for an exception.
    if pdu > place.len().min(MAX_PDU) || place.len() < 2 {
        return Ok(0);
    }
    let reply = units.serve(&info, place);
    if reply == Reply::PENDING {
        return Err(Status::PENDING);
    }
    let mut written = reply.write_exception(place);
    if written == 0 {
        return Ok(0);
    }
    // Services rely on the room that a server's smallest buffer has.
    if written > place.len() {
        written = Reply::SERVER_DEVICE_FAILURE.write_exception(place);
    }
    let unit = info.to;
    framing.emit(buffer, transaction, unit, delimiter, |_| Ok(written))
}

/// The end character of ASCII frames, until it is changed.
pub const DELIMITER: u8 = ascii::END;
