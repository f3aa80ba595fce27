//! Functions 07, 11 and 2B/0E: exception status, server id, device identification.

use super::Reply;
use crate::pdu::functions::{
    ENCAPSULATED_INTERFACE_TRANSPORT, READ_EXCEPTION_STATUS, REPORT_SERVER_ID,
};
use crate::pdu::identification::{
    BASIC, EXTENDED, INDIVIDUAL, MEI_READ_DEVICE_IDENTIFICATION, REGULAR,
};
use crate::pdu::MAX_PDU;

/// Serves function 07 with eight outputs. The request PDU is the first `length` bytes of
/// `pdu`; the response overwrites it.
///
/// ```
/// use mbm::server::identity::serve_exception_status;
/// use mbm::server::Reply;
///
/// let mut pdu = [7, 0];
/// assert_eq!(serve_exception_status(0b101, &mut pdu, 1), Reply::length(2));
/// assert_eq!(pdu, [7, 0b101]);
/// ```
pub fn serve_exception_status(outputs: u8, pdu: &mut [u8], length: usize) -> Reply {
    match pdu {
        [READ_EXCEPTION_STATUS, ..] if length != 1 => Reply::ILLEGAL_DATA_VALUE,
        [READ_EXCEPTION_STATUS, data, ..] => {
            *data = outputs;
            Reply::length(2)
        }
        _ => Reply::NOT_HANDLED,
    }
}

/// Serves function 11, with `pdu` and `length` as for [`serve_exception_status`]. The response
/// has the server's id, the run indicator and the additional data.
///
/// ```
/// use mbm::server::identity::serve_server_id;
/// use mbm::server::Reply;
///
/// let mut pdu = [0x11, 0, 0, 0, 0];
/// assert_eq!(serve_server_id(&[17], true, b"m", &mut pdu, 1), Reply::length(5));
/// assert_eq!(pdu, [0x11, 3, 17, 0xFF, b'm']);
/// ```
pub fn serve_server_id(
    id: &[u8],
    running: bool,
    additional: &[u8],
    pdu: &mut [u8],
    length: usize,
) -> Reply {
    if pdu.first() != Some(&REPORT_SERVER_ID) {
        return Reply::NOT_HANDLED;
    }
    if length != 1 {
        return Reply::ILLEGAL_DATA_VALUE;
    }
    let bytes = id.len() + 1 + additional.len();
    let space = pdu.get_mut(..2 + bytes).filter(|pdu| pdu.len() <= MAX_PDU);
    let Some([_, count, data @ ..]) = space else {
        return Reply::SERVER_DEVICE_FAILURE;
    };
    *count = bytes as u8;
    let running = [if running { 0xFF } else { 0 }];
    let all = id.iter().chain(&running).chain(additional);
    for (place, byte) in data.iter_mut().zip(all) {
        *place = *byte;
    }
    Reply::length(2 + bytes)
}

/// The objects of a device identification (clause 6.21).
///
/// ```
/// use mbm::server::identity::Objects;
///
/// struct Pump;
///
/// impl Objects for Pump {
///     fn object(&self, id: u8) -> Option<&[u8]> {
///         [&b"mbm"[..], b"pump", b"1.0"].get(usize::from(id)).copied()
///     }
/// }
/// ```
pub trait Objects {
    /// The value of the object with this id; `None` if there is no such object.
    fn object(&self, id: u8) -> Option<&[u8]>;
}

/// The last object id of each category.
const LAST: [u8; 3] = [0x02, 0x7F, 0xFF];

/// Bytes of a response PDU before its objects.
const OBJECTS: usize = 7;

/// Serves function 2B/0E, with `pdu` and `length` as for [`serve_exception_status`].
///
/// ```
/// use mbm::server::identity::{serve_identification, Objects};
/// use mbm::server::{Reply, Service};
///
/// /// A service of objects.
/// struct Identification<O>(O);
///
/// impl<O: Objects> Service for Identification<O> {
///     fn serve(&mut self, pdu: &mut [u8], length: usize) -> Reply {
///         serve_identification(&self.0, pdu, length)
///     }
/// }
/// ```
pub fn serve_identification(objects: &impl Objects, pdu: &mut [u8], length: usize) -> Reply {
    let (code, id) = match pdu.get(..length) {
        Some([ENCAPSULATED_INTERFACE_TRANSPORT, MEI_READ_DEVICE_IDENTIFICATION, rest @ ..]) => {
            match rest {
                &[code @ BASIC..=INDIVIDUAL, id] => (code, id),
                _ => return Reply::ILLEGAL_DATA_VALUE,
            }
        }
        _ => return Reply::NOT_HANDLED,
    };
    let has = |mut ids: core::ops::RangeInclusive<u8>| ids.any(|id| objects.object(id).is_some());
    let level = if has(0x80..=0xFF) {
        EXTENDED
    } else if has(0x03..=0x7F) {
        REGULAR
    } else {
        BASIC
    };
    let (first, last) = if code == INDIVIDUAL {
        if objects.object(id).is_none() {
            return Reply::ILLEGAL_DATA_ADDRESS;
        }
        (id, id)
    } else {
        // If the device lacks the category, the response has the highest category that the
        // device has. If the object is not in the category, the response starts with object 0
        // (clause 6.21).
        let index = usize::from(code.min(level)) - 1;
        let last = LAST.get(index).copied().unwrap_or(0xFF);
        let known = id <= last && objects.object(id).is_some();
        (if known { id } else { 0 }, last)
    };
    let (mut end, mut count, mut next) = (OBJECTS, 0u8, None);
    for id in first..=last {
        let Some(value) = objects.object(id) else {
            continue;
        };
        let fits = end + 2 + value.len() <= MAX_PDU;
        let space = pdu.get_mut(end..end + 2 + value.len()).filter(|_| fits);
        let Some([head, size, place @ ..]) = space else {
            next = Some(id);
            break;
        };
        *head = id;
        *size = value.len() as u8;
        for (to, from) in place.iter_mut().zip(value) {
            *to = *from;
        }
        end += 2 + value.len();
        count += 1;
    }
    // The object is too long for a response.
    if count == 0 && next.is_some() {
        return Reply::SERVER_DEVICE_FAILURE;
    }
    if let Some([_, _, _, conformity, more, following, objects]) = pdu.first_chunk_mut() {
        *conformity = level | 0x80;
        *more = if next.is_some() { 0xFF } else { 0 };
        *following = next.unwrap_or(0);
        *objects = count;
    }
    Reply::length(end)
}
