//! The data of some functions consist of groups: file records (functions 14 and 15, hex), and
//! objects of a device identification. This module reads and writes one group at a time.

use super::PduKind;
use crate::bytes::{Reader, Writer};
use crate::error::Error;
use crate::pdu::files::{Reads, Record, Records, Writes, REFERENCE_TYPE};
use crate::pdu::functions::{READ_FILE_RECORD, WRITE_FILE_RECORD};

/// No record number: the responses of 14 contain only data.
const NO_RECORD: Record = Record {
    file: 0,
    record: 0,
    length: 0,
};

/// Reads the first record in the data of function 14 or 15. Returns the record, its data, and
/// the length of the group in bytes. The data are empty in a request of 14. In a response of
/// 14 only the length of the record is known.
///
/// ```
/// use mbm::packet::{groups, PduKind};
///
/// let data = [6, 0, 4, 0, 1, 0, 2, 6, 0, 3, 0, 9, 0, 1];
/// let (first, _, length) = groups::record(PduKind::Request, 0x14, &data).unwrap();
/// assert_eq!((first.file, first.record, first.length), (4, 1, 2));
/// let (second, ..) = groups::record(PduKind::Request, 0x14, &data[length..]).unwrap();
/// assert_eq!(second.file, 3);
/// ```
pub fn record(side: PduKind, function: u8, groups: &[u8]) -> Option<(Record, &[u8], usize)> {
    match (function, side) {
        (READ_FILE_RECORD, PduKind::Request) => {
            let record = Reads::new(groups).ok()?.iter().next()?;
            Some((record, &[], 7))
        }
        (READ_FILE_RECORD, PduKind::Response) => {
            let data = Records::new(groups).ok()?.iter().next()?;
            let length = (data.len() / 2) as u16;
            Some((
                Record {
                    length,
                    ..NO_RECORD
                },
                data,
                2 + data.len(),
            ))
        }
        (WRITE_FILE_RECORD, _) => {
            let (record, data) = Writes::new(groups).ok()?.iter().next()?;
            Some((record, data, 7 + data.len()))
        }
        _ => None,
    }
}

/// Writes one record in the format that [`record`] reads. Returns the length of the group in
/// bytes.
///
/// # Errors
/// [`Error::IllegalFunction`] for functions other than 14 and 15;
/// [`Error::BufferTooSmall`]; the error of a request or response that contains only this
/// record.
///
/// ```
/// use mbm::packet::{groups, PduKind};
/// use mbm::pdu::files::Record;
///
/// let record = Record { file: 4, record: 1, length: 2 };
/// let mut data = [0; 7];
/// groups::put_record(PduKind::Request, 0x14, record, &[], &mut data)?;
/// assert_eq!(data, [6, 0, 4, 0, 1, 0, 2]);
/// # Ok::<(), mbm::Error>(())
/// ```
pub fn put_record(
    side: PduKind,
    function: u8,
    head: Record,
    data: &[u8],
    place: &mut [u8],
) -> Result<usize, Error> {
    let mut writer = Writer::new(place);
    let is_read = function == READ_FILE_RECORD;
    if !is_read && function != WRITE_FILE_RECORD {
        return Err(Error::IllegalFunction);
    }
    if is_read && side == PduKind::Response {
        // A count that does not fit a byte is refused below, when the group is read.
        writer.u8(data.len().saturating_add(1).min(0xFF) as u8);
        writer.u8(REFERENCE_TYPE);
    } else {
        writer.u8(REFERENCE_TYPE);
        writer.u16(head.file);
        writer.u16(head.record);
        writer.u16(head.length);
    }
    writer.put(data);
    let length = writer.finish()?;
    let group = place.get(..length).unwrap_or_default();
    match (is_read, side) {
        (true, PduKind::Request) => Reads::new(group).map(|_| ()),
        (true, PduKind::Response) => Records::new(group).map(|_| ()),
        (false, _) => Writes::new(group).map(|_| ()),
    }?;
    Ok(length)
}

/// Reads the first object in a device identification. Returns its id, its value, and the
/// length of the group in bytes.
///
/// ```
/// assert_eq!(mbm::packet::groups::object(b"\0\x03mbm"), Some((0, &b"mbm"[..], 5)));
/// ```
pub fn object(groups: &[u8]) -> Option<(u8, &[u8], usize)> {
    let mut reader = Reader::new(groups);
    let (id, length) = (reader.u8()?, usize::from(reader.u8()?));
    Some((id, reader.take(length)?, 2 + length))
}

/// Writes one object in the format that [`object`] reads. Returns the length of the group in
/// bytes.
///
/// # Errors
/// [`Error::IllegalDataValue`] if the value is longer than 255 bytes;
/// [`Error::BufferTooSmall`].
///
/// ```
/// let mut data = [0; 5];
/// mbm::packet::groups::put_object(0, b"mbm", &mut data)?;
/// assert_eq!(data, *b"\0\x03mbm");
/// # Ok::<(), mbm::Error>(())
/// ```
pub fn put_object(id: u8, value: &[u8], place: &mut [u8]) -> Result<usize, Error> {
    if value.len() > 0xFF {
        return Err(Error::IllegalDataValue);
    }
    let mut writer = Writer::new(place);
    writer.u8(id);
    writer.counted(value);
    writer.finish()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn records_are_written_as_they_are_read() {
        let place = Record {
            file: 4,
            record: 7,
            length: 2,
        };
        let data = [0x06, 0xAF, 0x04, 0xBE];
        for (side, function, head, data) in [
            (PduKind::Request, 0x14, place, &data[..0]),
            (
                PduKind::Response,
                0x14,
                Record {
                    length: 2,
                    ..NO_RECORD
                },
                &data,
            ),
            (PduKind::Request, 0x15, place, &data),
            (PduKind::Response, 0x15, place, &data),
        ] {
            let mut bytes = [0; 11];
            let length = put_record(side, function, head, data, &mut bytes).unwrap();
            let found = record(side, function, &bytes[..length]);
            assert_eq!(found, Some((head, data, length)));
            let short = put_record(side, function, head, data, &mut bytes[..length - 1]);
            assert_eq!(short, Err(Error::BufferTooSmall));
        }
    }

    #[test]
    fn an_invalid_record_is_not_written() {
        let mut bytes = [0; 600];
        let head = |file, length| Record {
            file,
            record: 0,
            length,
        };
        for (side, function, head, count, status) in [
            (
                PduKind::Request,
                0x14,
                head(0, 1),
                0,
                Error::IllegalDataAddress,
            ),
            (
                PduKind::Request,
                0x14,
                head(1, 0),
                0,
                Error::IllegalDataValue,
            ),
            (
                PduKind::Request,
                0x15,
                head(1, 2),
                2,
                Error::IllegalDataValue,
            ),
            (
                PduKind::Request,
                0x15,
                head(1, 250),
                500,
                Error::IllegalDataValue,
            ),
            (
                PduKind::Response,
                0x14,
                NO_RECORD,
                3,
                Error::IllegalDataValue,
            ),
            (
                PduKind::Response,
                0x14,
                NO_RECORD,
                510,
                Error::IllegalDataValue,
            ),
            (
                PduKind::Request,
                0x18,
                head(1, 1),
                0,
                Error::IllegalFunction,
            ),
        ] {
            let found = put_record(side, function, head, &[0; 510][..count], &mut bytes);
            assert_eq!(found, Err(status));
        }
    }

    #[test]
    fn an_object_is_written_as_it_is_read() {
        let mut bytes = [0; 5];
        assert_eq!(put_object(1, b"mbm", &mut bytes), Ok(5));
        assert_eq!(object(&bytes), Some((1, &b"mbm"[..], 5)));
        assert_eq!(object(&bytes[..4]), None);
        let short = put_object(1, b"mbms", &mut bytes);
        assert_eq!(short, Err(Error::BufferTooSmall));
    }
}
