//! The responder: a frame in, a frame out, and no state between.

use super::framing::{ascii_room, rtu_room, tcp_room};
use super::heading::{SERIAL, STREAM};
use super::{Heading, Reply, Units};
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
    let (mut heading, room) = (Heading::NONE, buffer.len());
    let frame = buffer.get_mut(..length).unwrap_or_default();
    let adu = framing.parse(frame, delimiter);
    let (transaction, pdu) = adu.map_or((0, 0), |adu| {
        heading.to = adu.unit;
        (adu.transaction, adu.pdu.len())
    });
    heading.own = if framing.is_serial() { SERIAL } else { STREAM };
    heading.length = pdu as u16;
    let room = match framing {
        Framing::Rtu | Framing::RtuOverTcp => rtu_room(room),
        Framing::Ascii => ascii_room(room),
        Framing::Tcp => tcp_room(room),
    };
    heading.head = match framing {
        Framing::Tcp => tcp::PDU,
        _ => rtu::PDU,
    } as u8;
    heading.room = room as u16;
    let start = usize::from(heading.head);
    let Some(place) = buffer.get_mut(start..start + room) else {
        return Ok(0);
    };
    // Room for the request is room for an exception.
    if pdu > place.len().min(MAX_PDU) || place.len() < 2 {
        return Ok(0);
    }
    let reply = units.serve(&heading, place);
    if reply == Reply::PENDING {
        return Err(Status::PENDING);
    }
    let mut written = reply.settle(place);
    if written == 0 {
        return Ok(0);
    }
    // Services rely on the room that a server's smallest buffer has.
    if written > place.len() {
        written = Reply::SERVER_DEVICE_FAILURE.settle(place);
    }
    let unit = heading.to;
    framing.emit(buffer, transaction, unit, delimiter, |_| Ok(written))
}

/// The end character of ASCII frames, until it is changed.
pub const DELIMITER: u8 = ascii::END;
