//! File records in the PDUs of functions 14 and 15.

use super::fields::{byte, check_within, counted, word};
use super::{FILE_DATA_BYTES, MAX_RECORD, READ_FILE_BYTES, WRITE_FILE_BYTES};
use crate::bytes::Reader;
use crate::error::Error;

/// The only reference type that the standard defines.
pub const REFERENCE_TYPE: u8 = 6;

/// The first word of a group of records: the byte count, which is set later, and the reference type.
pub const GROUP: usize = REFERENCE_TYPE as usize;

/// The records of a file that a sub-request reads or writes.
///
/// ```
/// use mbm::pdu::files::{Reads, Record};
///
/// // Reference type 6, file 4, two records from 1 on.
/// let reads = Reads::new(&[6, 0, 4, 0, 1, 0, 2])?;
/// assert!(reads.iter().eq([Record { file: 4, record: 1, length: 2 }]));
/// # Ok::<(), mbm::Error>(())
/// ```
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Record {
    /// File number, from 1 on.
    pub file: u16,
    /// Number of the first record, 0 to 9999.
    pub record: u16,
    /// Number of records. A record is one register.
    pub length: u16,
}

/// The sub-requests of 14.
///
/// ```
/// use mbm::pdu::files::Reads;
///
/// let reads = Reads::new(&[6, 0, 4, 0, 1, 0, 2, 6, 0, 3, 0, 9, 0, 1])?;
/// assert!(reads.iter().map(|record| record.file).eq([4, 3]));
/// assert_eq!(reads.bytes().len(), 14);
/// // Function code, byte count, and for each its length, reference type and data.
/// assert_eq!(reads.response_length(), 2 + 6 + 4);
/// # Ok::<(), mbm::Error>(())
/// ```
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Reads<'a>(pub(super) &'a [u8]);

/// The sub-requests of 15, and of its response.
///
/// ```
/// use mbm::pdu::files::Writes;
///
/// let writes = Writes::new(&[6, 0, 4, 0, 7, 0, 1, 0x02, 0x2B])?;
/// for (record, data) in writes.iter() {
///     assert_eq!((record.file, record.record, data), (4, 7, &[0x02, 0x2B][..]));
/// }
/// assert_eq!(writes.bytes().len(), 9);
/// # Ok::<(), mbm::Error>(())
/// ```
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Writes<'a>(pub(super) &'a [u8]);

/// The sub-responses of 14.
///
/// ```
/// use mbm::pdu::files::Records;
///
/// // Three bytes: the reference type, and one record.
/// let records = Records::new(&[3, 6, 0x02, 0x2B])?;
/// assert!(records.iter().eq([[0x02, 0x2B]]));
/// assert_eq!(records.bytes(), [3, 6, 0x02, 0x2B]);
/// # Ok::<(), mbm::Error>(())
/// ```
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Records<'a>(pub(super) &'a [u8]);

/// Reads the head of the next sub-request. Also returns whether such records can exist; this
/// is not an error yet, because a server checks all counts before it (figures 24 and 25).
fn next_record(reader: &mut Reader) -> Result<(Record, bool), Error> {
    let reference = byte(reader)?;
    let record = Record {
        file: word(reader)?,
        record: word(reader)?,
        length: word(reader)?,
    };
    if record.length == 0 {
        return Err(Error::IllegalDataValue);
    }
    let last = record.record.checked_add(record.length - 1);
    let exists = reference == REFERENCE_TYPE
        && record.file != 0
        && last.is_some_and(|last| last <= MAX_RECORD);
    Ok((record, exists))
}

/// An error unless the records of all sub-requests can exist.
fn check_exist(exist: bool) -> Result<(), Error> {
    if exist {
        Ok(())
    } else {
        Err(Error::IllegalDataAddress)
    }
}

impl<'a> Reads<'a> {
    /// The sub-requests in `bytes`.
    ///
    /// # Errors
    /// [`Error::IllegalDataValue`] for wrong counts, or for more records than one response
    /// can hold; [`Error::IllegalDataAddress`] for a reference type, file number or record
    /// number that the standard does not allow.
    pub fn new(bytes: &'a [u8]) -> Result<Self, Error> {
        check_within(bytes.len(), READ_FILE_BYTES)?;
        let mut reader = Reader::new(bytes);
        let mut space = FILE_DATA_BYTES.1;
        let mut exist = true;
        while !reader.is_empty() {
            let (record, exists) = next_record(&mut reader)?;
            let answer = sub_response_length(record.length);
            space = space.checked_sub(answer).ok_or(Error::IllegalDataValue)?;
            exist &= exists;
        }
        check_exist(exist)?;
        Ok(Reads(bytes))
    }

    /// The sub-requests as bytes on the wire.
    pub const fn bytes(&self) -> &'a [u8] {
        self.0
    }

    /// The records of each sub-request.
    pub fn iter(&self) -> impl Iterator<Item = Record> + 'a {
        let mut reader = Reader::new(self.0);
        core::iter::from_fn(move || Some(next_record(&mut reader).ok()?.0))
    }

    /// Length of the response PDU in bytes.
    pub fn response_length(&self) -> usize {
        let answers = self.iter().map(|record| sub_response_length(record.length));
        2 + answers.sum::<usize>()
    }
}

/// Length in bytes of a sub-response with `records` records.
fn sub_response_length(records: u16) -> usize {
    usize::from(records).saturating_mul(2).saturating_add(2)
}

/// Reads the next sub-request of 15: its head, its data, and whether such records can exist.
fn next_write<'a>(reader: &mut Reader<'a>) -> Result<(Record, &'a [u8], bool), Error> {
    let (record, exists) = next_record(reader)?;
    let data = reader.take(usize::from(record.length).saturating_mul(2));
    Ok((record, data.ok_or(Error::IllegalDataValue)?, exists))
}

impl<'a> Writes<'a> {
    /// The sub-requests in `bytes`.
    ///
    /// # Errors
    /// As [`Reads::new`].
    pub fn new(bytes: &'a [u8]) -> Result<Self, Error> {
        check_within(bytes.len(), WRITE_FILE_BYTES)?;
        let mut reader = Reader::new(bytes);
        let mut exist = true;
        while !reader.is_empty() {
            exist &= next_write(&mut reader)?.2;
        }
        check_exist(exist)?;
        Ok(Writes(bytes))
    }

    /// The sub-requests as bytes on the wire.
    pub const fn bytes(&self) -> &'a [u8] {
        self.0
    }

    /// The records of each sub-request, and their data with the high byte first.
    pub fn iter(&self) -> impl Iterator<Item = (Record, &'a [u8])> + 'a {
        let mut reader = Reader::new(self.0);
        core::iter::from_fn(move || {
            let (record, data, _) = next_write(&mut reader).ok()?;
            Some((record, data))
        })
    }
}

/// Reads the data of the next sub-response of 14.
fn next_data<'a>(reader: &mut Reader<'a>) -> Result<&'a [u8], Error> {
    let group = counted(reader)?;
    match group.split_first() {
        Some((&REFERENCE_TYPE, data)) if !data.is_empty() && data.len().is_multiple_of(2) => {
            Ok(data)
        }
        _ => Err(Error::IllegalDataValue),
    }
}

impl<'a> Records<'a> {
    /// The sub-responses in `bytes`.
    ///
    /// # Errors
    /// [`Error::IllegalDataValue`] for wrong counts.
    pub fn new(bytes: &'a [u8]) -> Result<Self, Error> {
        // The sub-response of one record has four bytes, although the least byte count in
        // the standard's table is seven.
        check_within(bytes.len(), (4, FILE_DATA_BYTES.1))?;
        let mut reader = Reader::new(bytes);
        while !reader.is_empty() {
            next_data(&mut reader)?;
        }
        Ok(Records(bytes))
    }

    /// The sub-responses as bytes on the wire.
    pub const fn bytes(&self) -> &'a [u8] {
        self.0
    }

    /// The data of each sub-response, with the high byte first.
    pub fn iter(&self) -> impl Iterator<Item = &'a [u8]> + 'a {
        let mut reader = Reader::new(self.0);
        core::iter::from_fn(move || next_data(&mut reader).ok())
    }
}
