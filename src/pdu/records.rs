//! The records of a file as PDUs of functions 14 and 15 name and carry them.

use super::fields::{byte, counted, within, word};
use super::limits::{FILE_DATA_BYTES, MAX_RECORD, READ_FILE_BYTES, WRITE_FILE_BYTES};
use crate::bytes::Reader;
use crate::error::Status;

/// The only reference type there is.
pub const REFERENCE_TYPE: u8 = 6;

/// Which records of a file a sub-request names.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Record {
    /// File number, from 1 on.
    pub file: u16,
    /// First record, 0 to 9999.
    pub record: u16,
    /// How many records, each a register.
    pub length: u16,
}

/// The sub-requests of 14.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Reads<'a>(pub(super) &'a [u8]);

/// The sub-requests of 15, and of its response.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Writes<'a>(pub(super) &'a [u8]);

/// The sub-responses of 14.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Records<'a>(pub(super) &'a [u8]);

/// The next sub-request's head, and whether there can be such records: counts
/// are judged before that (figures 24 and 25).
fn head(reader: &mut Reader) -> Result<(Record, bool), Status> {
    let reference = byte(reader)?;
    let record = Record {
        file: word(reader)?,
        record: word(reader)?,
        length: word(reader)?,
    };
    if record.length == 0 {
        return Err(Status::ILLEGAL_DATA_VALUE);
    }
    let last = record.record.checked_add(record.length - 1);
    let exists = reference == REFERENCE_TYPE
        && record.file != 0
        && last.is_some_and(|last| last <= MAX_RECORD);
    Ok((record, exists))
}

/// The verdict on sub-requests whose counts are in order.
fn all_exist(exist: bool) -> Result<(), Status> {
    if exist {
        Ok(())
    } else {
        Err(Status::ILLEGAL_DATA_ADDRESS)
    }
}

impl<'a> Reads<'a> {
    /// The sub-requests that these bytes are.
    ///
    /// # Errors
    /// [`Status::ILLEGAL_DATA_VALUE`] for counts out of order, or records that
    /// no response can hold; [`Status::ILLEGAL_DATA_ADDRESS`] for a reference
    /// type, file or record number that there cannot be.
    pub fn new(bytes: &'a [u8]) -> Result<Self, Status> {
        within(bytes.len(), READ_FILE_BYTES)?;
        let mut reader = Reader::new(bytes);
        let mut room = FILE_DATA_BYTES.1;
        let mut exist = true;
        while !reader.is_empty() {
            let (record, exists) = head(&mut reader)?;
            let answer = answer_length(record.length);
            room = room.checked_sub(answer).ok_or(Status::ILLEGAL_DATA_VALUE)?;
            exist &= exists;
        }
        all_exist(exist)?;
        Ok(Reads(bytes))
    }

    /// The sub-requests as sent.
    pub const fn bytes(&self) -> &'a [u8] {
        self.0
    }

    /// What each sub-request names.
    pub fn iter(&self) -> impl Iterator<Item = Record> + 'a {
        let mut reader = Reader::new(self.0);
        core::iter::from_fn(move || Some(head(&mut reader).ok()?.0))
    }

    /// Length of the response PDU.
    pub fn response_length(&self) -> usize {
        let answers = self.iter().map(|record| answer_length(record.length));
        2 + answers.sum::<usize>()
    }
}

/// Bytes of a sub-response of so many records.
fn answer_length(records: u16) -> usize {
    usize::from(records).saturating_mul(2).saturating_add(2)
}

/// The next sub-request of 15: its head, its data, and whether there can be
/// such records.
fn written<'a>(reader: &mut Reader<'a>) -> Result<(Record, &'a [u8], bool), Status> {
    let (record, exists) = head(reader)?;
    let data = reader.take(usize::from(record.length).saturating_mul(2));
    Ok((record, data.ok_or(Status::ILLEGAL_DATA_VALUE)?, exists))
}

impl<'a> Writes<'a> {
    /// As [`Reads::new`].
    ///
    /// # Errors
    /// As [`Reads::new`].
    pub fn new(bytes: &'a [u8]) -> Result<Self, Status> {
        within(bytes.len(), WRITE_FILE_BYTES)?;
        let mut reader = Reader::new(bytes);
        let mut exist = true;
        while !reader.is_empty() {
            exist &= written(&mut reader)?.2;
        }
        all_exist(exist)?;
        Ok(Writes(bytes))
    }

    /// The sub-requests as sent.
    pub const fn bytes(&self) -> &'a [u8] {
        self.0
    }

    /// What each sub-request names, and the data for it, high bytes first.
    pub fn iter(&self) -> impl Iterator<Item = (Record, &'a [u8])> + 'a {
        let mut reader = Reader::new(self.0);
        core::iter::from_fn(move || {
            let (record, data, _) = written(&mut reader).ok()?;
            Some((record, data))
        })
    }
}

/// The data of the next sub-response of 14.
fn read<'a>(reader: &mut Reader<'a>) -> Result<&'a [u8], Status> {
    let group = counted(reader)?;
    match group.split_first() {
        Some((&REFERENCE_TYPE, data)) if !data.is_empty() && data.len().is_multiple_of(2) => {
            Ok(data)
        }
        _ => Err(Status::ILLEGAL_DATA_VALUE),
    }
}

impl<'a> Records<'a> {
    /// The sub-responses that these bytes are.
    ///
    /// # Errors
    /// [`Status::ILLEGAL_DATA_VALUE`] for counts out of order.
    pub fn new(bytes: &'a [u8]) -> Result<Self, Status> {
        // One record of one register takes four bytes, though the standard's
        // table begins at seven.
        within(bytes.len(), (4, FILE_DATA_BYTES.1))?;
        let mut reader = Reader::new(bytes);
        while !reader.is_empty() {
            read(&mut reader)?;
        }
        Ok(Records(bytes))
    }

    /// The sub-responses as sent.
    pub const fn bytes(&self) -> &'a [u8] {
        self.0
    }

    /// The data of each sub-response, high bytes first.
    pub fn iter(&self) -> impl Iterator<Item = &'a [u8]> + 'a {
        let mut reader = Reader::new(self.0);
        core::iter::from_fn(move || read(&mut reader).ok())
    }
}
