//! Encapsulated interface transport, and device identification, which it contains: function
//! 2B.

use super::fields::{byte, counted, expect};
use super::MORE;
use crate::bytes::Reader;
use crate::error::Error;

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

/// What a request to Read Device Identification reads: its read device id code.
///
/// ```
/// assert_eq!(mbm::pdu::identification::DeviceIdCode::Individual as u8, 4);
/// ```
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
#[repr(u8)]
pub enum DeviceIdCode {
    /// The basic objects: vendor, product and revision.
    Basic = BASIC,
    /// The basic and the regular objects.
    Regular = REGULAR,
    /// All objects.
    Extended = EXTENDED,
    /// One object.
    Individual = INDIVIDUAL,
}

/// The fields of a response to Read Device Identification after its code.
///
/// ```
/// use mbm::pdu::identification::{IdentificationReply, BASIC};
///
/// // Conformity level, no more follows, no next object, one object: the vendor.
/// let reply = IdentificationReply::parse(BASIC, b"\x01\0\0\x01\0\x03mbm")?;
/// assert!(!reply.more_follows);
/// assert!(reply.objects.iter().eq([(0, &b"mbm"[..])]));
/// # Ok::<(), mbm::Error>(())
/// ```
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
    /// [`Error::MalformedReply`] if they are not well-formed, for example if an object is
    /// cut off.
    pub fn parse(code: u8, bytes: &'a [u8]) -> Result<Self, Error> {
        read_reply(code, &mut Reader::new(bytes)).map_err(|_| Error::MalformedReply)
    }
}

/// Checks the code, more follows and the number of objects of a response. It checks neither the
/// conformity level nor, if no object follows, the next object: some devices send wrong values
/// there, and nothing depends on them.
pub(super) fn check_head(code: u8, more: bool, count: u8) -> Result<(), Error> {
    expect(match (code, more) {
        (BASIC..=EXTENDED, _) => true,
        (INDIVIDUAL, false) => count == 1,
        _ => false,
    })
}

/// Parses the bytes that follow the code of a response to Read Device Identification.
fn read_reply<'a>(code: u8, reader: &mut Reader<'a>) -> Result<IdentificationReply<'a>, Error> {
    let conformity = byte(reader)?;
    let (more, next_object, count) = (byte(reader)?, byte(reader)?, byte(reader)?);
    let more_follows = more == MORE;
    expect(more_follows || more == 0)?;
    check_head(code, more_follows, count)?;
    Ok(IdentificationReply {
        conformity,
        more_follows,
        next_object,
        objects: ObjectList::new(count, reader.rest())?,
    })
}

/// The objects of a response, each an id and a value.
///
/// ```
/// use mbm::pdu::identification::ObjectList;
///
/// let objects = ObjectList::new(2, b"\0\x03mbm\x02\x011")?;
/// assert_eq!((objects.count(), objects.bytes().len()), (2, 8));
/// assert!(objects.iter().eq([(0, &b"mbm"[..]), (2, b"1")]));
/// # Ok::<(), mbm::Error>(())
/// ```
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct ObjectList<'a> {
    pub(super) count: u8,
    pub(super) bytes: &'a [u8],
}

/// Reads the id and the value of the next object.
fn object<'a>(reader: &mut Reader<'a>) -> Result<(u8, &'a [u8]), Error> {
    let id = byte(reader)?;
    Ok((id, counted(reader)?))
}

impl<'a> ObjectList<'a> {
    /// The `count` objects in `bytes`.
    ///
    /// # Errors
    /// [`Error::IllegalDataValue`] unless `bytes` are exactly `count` objects.
    pub fn new(count: u8, bytes: &'a [u8]) -> Result<Self, Error> {
        let mut reader = Reader::new(bytes);
        for _ in 0..count {
            object(&mut reader)?;
        }
        if reader.is_empty() {
            Ok(ObjectList { count, bytes })
        } else {
            Err(Error::IllegalDataValue)
        }
    }

    /// Number of objects.
    pub const fn count(&self) -> u8 {
        self.count
    }

    /// The objects as bytes on the wire: id, length and value of each.
    pub const fn bytes(&self) -> &'a [u8] {
        self.bytes
    }

    /// Id and value of each object.
    pub fn iter(&self) -> impl Iterator<Item = (u8, &'a [u8])> + 'a {
        let mut reader = Reader::new(self.bytes);
        core::iter::from_fn(move || object(&mut reader).ok())
    }
}
