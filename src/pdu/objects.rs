//! The objects in the PDU of a device identification (clause 6.21).

use super::fields::{byte, counted};
use crate::bytes::Reader;
use crate::error::Status;

/// The objects of a response, each an id and a value.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct ObjectList<'a> {
    pub(super) count: u8,
    pub(super) bytes: &'a [u8],
}

/// Reads the id and the value of the next object.
fn object<'a>(reader: &mut Reader<'a>) -> Result<(u8, &'a [u8]), Status> {
    let id = byte(reader)?;
    Ok((id, counted(reader)?))
}

impl<'a> ObjectList<'a> {
    /// The `count` objects in `bytes`.
    ///
    /// # Errors
    /// [`Status::ILLEGAL_DATA_VALUE`] unless `bytes` are exactly `count` objects.
    pub fn new(count: u8, bytes: &'a [u8]) -> Result<Self, Status> {
        let mut reader = Reader::new(bytes);
        for _ in 0..count {
            object(&mut reader)?;
        }
        if reader.is_empty() {
            Ok(ObjectList { count, bytes })
        } else {
            Err(Status::ILLEGAL_DATA_VALUE)
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
