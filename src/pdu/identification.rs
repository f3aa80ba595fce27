//! Encapsulated interface transport, and device identification, which it contains: function
//! 2B.

use super::fields::byte;
use super::functions;
use super::message::{Request, Response};
pub use super::objects::ObjectList;
use crate::bytes::{Reader, Writer};
use crate::error::Status;

/// CANopen General Reference (clause 6.20).
pub const MEI_CANOPEN: u8 = 0x0D;
/// Read Device Identification (clause 6.21).
pub const MEI_READ_DEVICE_IDENTIFICATION: u8 = 0x0E;

/// Read device id code: the basic objects, as a stream.
pub const BASIC: u8 = 1;
/// Read device id code: the regular objects, as a stream.
pub const REGULAR: u8 = 2;
/// Read device id code: the extended objects, as a stream.
pub const EXTENDED: u8 = 3;
/// Read device id code: one object.
pub const INDIVIDUAL: u8 = 4;

/// The value of the field "more follows" in a response if more objects follow; else it is 0.
const MORE: u8 = 0xFF;

pub(super) fn parse<'a>(reader: &mut Reader<'a>) -> Result<Request<'a>, Status> {
    let mei_type = byte(reader)?;
    if mei_type != MEI_READ_DEVICE_IDENTIFICATION {
        let data = reader.rest();
        return Ok(Request::EncapsulatedInterface { mei_type, data });
    }
    let (code, object) = (byte(reader)?, byte(reader)?);
    if !(BASIC..=INDIVIDUAL).contains(&code) {
        return Err(Status::ILLEGAL_DATA_VALUE);
    }
    Ok(Request::ReadDeviceIdentification { code, object })
}

pub(super) fn emit_identification(writer: &mut Writer, code: u8, object: u8) {
    emit(writer, MEI_READ_DEVICE_IDENTIFICATION, &[code, object]);
}

/// Writes a request or response of any MEI type.
pub(super) fn emit(writer: &mut Writer, mei_type: u8, data: &[u8]) {
    writer.u8(functions::ENCAPSULATED_INTERFACE_TRANSPORT);
    writer.u8(mei_type);
    writer.put(data);
}

/// What a response to Read Device Identification has after its code.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct IdentificationReply<'a> {
    /// The conformity level, not checked.
    pub conformity: u8,
    /// Another request is needed for the rest.
    pub more_follows: bool,
    /// The object to request next, not checked if none follows.
    pub next_object: u8,
    /// The objects of this response.
    pub objects: ObjectList<'a>,
}

impl<'a> IdentificationReply<'a> {
    /// Parses the bytes after the code, which is `code`. This is the part that a client
    /// stores.
    ///
    /// # Errors
    /// [`Status::MALFORMED_REPLY`] if they are not well-formed, for example if an object is
    /// cut off.
    pub fn parse(code: u8, bytes: &'a [u8]) -> Result<Self, Status> {
        read_reply(code, &mut Reader::new(bytes)).map_err(|_| Status::MALFORMED_REPLY)
    }
}

pub(super) fn parse_response<'a>(reader: &mut Reader<'a>) -> Result<Response<'a>, Status> {
    let mei_type = byte(reader)?;
    if mei_type != MEI_READ_DEVICE_IDENTIFICATION {
        let data = reader.rest();
        return Ok(Response::EncapsulatedInterface { mei_type, data });
    }
    let code = byte(reader)?;
    let reply = read_reply(code, reader)?;
    Ok(Response::DeviceIdentification {
        code,
        conformity: reply.conformity,
        more_follows: reply.more_follows,
        next_object: reply.next_object,
        objects: reply.objects,
    })
}

#[inline(always)]
fn read_reply<'a>(code: u8, reader: &mut Reader<'a>) -> Result<IdentificationReply<'a>, Status> {
    let conformity = byte(reader)?;
    let (more, next_object, count) = (byte(reader)?, byte(reader)?, byte(reader)?);
    // The conformity level is not checked, nor the next object if none follows: some devices
    // send wrong values there, and nothing depends on them.
    let is_right = match (code, more) {
        (BASIC..=EXTENDED, 0 | MORE) => true,
        (INDIVIDUAL, 0) => count == 1,
        _ => false,
    };
    if !is_right {
        return Err(Status::ILLEGAL_DATA_VALUE);
    }
    Ok(IdentificationReply {
        conformity,
        more_follows: more == MORE,
        next_object,
        objects: ObjectList::new(count, reader.rest())?,
    })
}

pub(super) fn emit_identification_response(
    writer: &mut Writer,
    head: [u8; 2],
    more_follows: bool,
    next_object: u8,
    objects: ObjectList,
) {
    let [code, conformity] = head;
    let more = if more_follows { MORE } else { 0 };
    let head = [code, conformity, more, next_object, objects.count];
    emit(writer, MEI_READ_DEVICE_IDENTIFICATION, &head);
    writer.put(objects.bytes);
}
