//! A request that has its own place for data, so that a call can wait for it with slices of any
//! lifetime.

use super::request::{store_bytes, ClientRequest, RequestState};
use crate::bytes::{copy, Writer};
use crate::data::bits::{byte_of, take_coils};
use crate::data::view::{send_words, take_words};
use crate::error::{Error, Status};
use crate::pdu::files::{Reads, Writes, REFERENCE_TYPE};
use crate::pdu::functions::FunctionSpec;
use crate::pdu::quantity;

/// Bytes of data that any request sends, or any response has.
pub const CALL_BYTES: usize = 252;

/// The request of a call that waits for its end, with a place for `D` bytes of data: those that it
/// sends, then those of the response.
///
/// A program does not make one: [`BlockingClient`](super::BlockingClient) does. It is named where
/// the type of such a client is written out.
#[derive(Clone, Debug)]
pub struct Call<const D: usize = CALL_BYTES> {
    state: RequestState,
    data: [u8; D],
}

impl<const D: usize> Call<D> {
    /// The request that `build` makes. `takes` is the number of bytes that the caller takes of the
    /// data of the response.
    pub(super) fn new(
        unit: u8,
        takes: usize,
        build: impl FnOnce(&mut RequestState) -> Status,
    ) -> Result<Self, Error> {
        let state = RequestState::made(unit, quantity(takes.min(D)), build)?;
        if usize::from(state.data_length()) > D {
            return Err(Error::BufferTooSmall);
        }
        Ok(Call {
            state,
            data: [0; D],
        })
    }

    /// A request with two words after the function code; a function with fewer ignores them.
    pub(super) fn short(
        unit: u8,
        spec: FunctionSpec,
        (first, second): (u16, u16),
        takes: usize,
    ) -> Result<Self, Error> {
        Call::new(unit, takes, |state| state.set(spec, first, second))
    }

    /// Sets the data to send: registers.
    pub(super) fn with_registers(mut self, registers: &[u16]) -> Self {
        send_words(&mut self.data, registers);
        self
    }

    /// Sets the data to send: coils.
    pub(super) fn with_coils(mut self, coils: &[bool]) -> Self {
        for (place, coils) in self.data.iter_mut().zip(coils.chunks(8)) {
            *place = byte_of(coils);
        }
        self
    }

    /// Sets the data to send: bytes.
    pub(super) fn with_bytes(mut self, bytes: &[u8]) -> Self {
        copy(&mut self.data, bytes);
        self
    }

    /// Sets the data to send: the last of these bytes, as many as the request needs. The others are
    /// in its head.
    pub(super) fn with_last_of(self, bytes: &[u8]) -> Self {
        let head = bytes.len().saturating_sub(self.state.data_length().into());
        self.with_bytes(bytes.get(head..).unwrap_or_default())
    }

    /// The data of the response.
    pub(super) fn bytes(&self) -> &[u8] {
        let length = usize::from(self.state.length);
        self.data.get(..length).unwrap_or_default()
    }

    /// Takes registers from the response. Returns those that it has.
    pub(super) fn take_registers<'b>(&self, registers: &'b mut [u16]) -> &'b [u16] {
        take_words(registers, self.bytes());
        let count = self.bytes().len() / 2;
        registers.get(..count).unwrap_or_default()
    }

    /// Fills registers from the response. A device from which a lenient client takes fewer has not
    /// answered.
    pub(super) fn fill_registers(&self, registers: &mut [u16]) -> Result<(), Error> {
        let expected = registers.len();
        match self.take_registers(registers).len() == expected {
            true => Ok(()),
            false => Err(Error::MalformedReply),
        }
    }

    /// As [`Call::fill_registers`], for coils.
    pub(super) fn fill_coils(&self, coils: &mut [bool]) -> Result<(), Error> {
        if self.bytes().len() < coils.len().div_ceil(8) {
            return Err(Error::MalformedReply);
        }
        take_coils(coils, self.bytes());
        Ok(())
    }

    /// Takes bytes from the response, which has no more than the caller takes.
    pub(super) fn take_bytes<'b>(&self, bytes: &'b mut [u8]) -> &'b [u8] {
        let data = self.bytes();
        copy(bytes, data);
        bytes.get(..data.len()).unwrap_or_default()
    }

    /// The result of the request, which has ended.
    pub(super) fn result(self) -> Result<Self, Error> {
        self.state.status.result().map(|()| self)
    }
}

impl<const D: usize> ClientRequest for Call<D> {
    fn state(&self) -> &RequestState {
        &self.state
    }

    fn state_mut(&mut self) -> &mut RequestState {
        &mut self.state
    }

    fn byte(&self, index: usize) -> u8 {
        self.data.get(index).copied().unwrap_or(0)
    }

    fn store(&mut self, data: &[u8], mask: u8) {
        store_bytes(&mut self.data, data, mask);
    }
}

/// Consecutive records of a file to read: see
/// [`BlockingClient::read_file_records`](super::BlockingClient::read_file_records).
///
/// ```
/// # include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/doc/pump.rs"));
/// # fn main() -> Result<(), mbm::Error> {
/// # let mut client = mbm::client::BlockingClient::tcp(tcp());
/// use mbm::client::ReadRecords;
///
/// let mut records = [0; 3];
/// client.read_file_records(17, &mut [ReadRecords { file: 4, record: 7, records: &mut records }])?;
/// # Ok(())
/// # }
/// ```
#[derive(PartialEq, Eq, Debug)]
pub struct ReadRecords<'a> {
    /// File number, from 1 on.
    pub file: u16,
    /// Number of the first record, 0 to 9999.
    pub record: u16,
    /// The place for the records, as many as it has. A record is one register.
    pub records: &'a mut [u16],
}

/// Consecutive records of a file to write: see
/// [`BlockingClient::write_file_records`](super::BlockingClient::write_file_records).
///
/// ```
/// # include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/doc/pump.rs"));
/// # fn main() -> Result<(), mbm::Error> {
/// # let mut client = mbm::client::BlockingClient::tcp(tcp());
/// use mbm::client::WriteRecords;
///
/// let group = WriteRecords { file: 4, record: 7, records: &[555, 100] };
/// client.write_file_records(17, &[group])?;
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct WriteRecords<'a> {
    /// File number, from 1 on.
    pub file: u16,
    /// Number of the first record, 0 to 9999.
    pub record: u16,
    /// The records. A record is one register.
    pub records: &'a [u16],
}

/// The groups of a request of several ranges of records, as on the wire.
#[derive(Debug)]
pub(super) struct Groups {
    bytes: [u8; CALL_BYTES],
    length: usize,
}

impl Groups {
    /// The groups that `put` writes, if a request can have as many.
    fn of(put: impl FnOnce(&mut Writer)) -> Result<Groups, Error> {
        let mut bytes = [0; CALL_BYTES];
        let mut writer = Writer::new(&mut bytes);
        put(&mut writer);
        match writer.finish() {
            Ok(length) => Ok(Groups { bytes, length }),
            Err(_) => Err(Error::InvalidQuantity),
        }
    }

    /// The groups that read these records, if the standard allows them.
    pub(super) fn read(groups: &[ReadRecords]) -> Result<Groups, Error> {
        let all = Groups::of(|writer| {
            for group in groups {
                put_range(writer, group.file, group.record, group.records.len());
            }
        })?;
        Reads::new(all.as_bytes()).map_err(|error| Error::refused(error.status()))?;
        Ok(all)
    }

    /// The groups that write these records, if the standard allows them.
    pub(super) fn write(groups: &[WriteRecords]) -> Result<Groups, Error> {
        let all = Groups::of(|writer| {
            for group in groups {
                put_range(writer, group.file, group.record, group.records.len());
                for record in group.records {
                    writer.u16(*record);
                }
            }
        })?;
        Writes::new(all.as_bytes()).map_err(|error| Error::refused(error.status()))?;
        Ok(all)
    }

    /// How many bytes the groups have.
    pub(super) fn length(&self) -> u16 {
        self.length as u16
    }

    /// The bytes of the groups.
    pub(super) fn as_bytes(&self) -> &[u8] {
        self.bytes.get(..self.length).unwrap_or_default()
    }
}

/// Writes the beginning of a group, which says which records it is about.
fn put_range(writer: &mut Writer, file: u16, record: u16, records: usize) {
    writer.u8(REFERENCE_TYPE);
    for word in [file, record, quantity(records)] {
        writer.u16(word);
    }
}

/// Takes the records that were read into their places.
pub(super) fn take_records(mut data: &[u8], groups: &mut [ReadRecords]) -> Result<(), Error> {
    for group in groups {
        // The length and the reference type of the group come first.
        let words = data.get(2..).unwrap_or_default();
        let (words, rest) = words
            .split_at_checked(2 * group.records.len())
            .ok_or(Error::MalformedReply)?;
        take_words(group.records, words);
        data = rest;
    }
    Ok(())
}

/// The response to function 0B.
///
/// ```
/// # include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/doc/pump.rs"));
/// # fn main() -> Result<(), mbm::Error> {
/// # let mut client = mbm::client::BlockingClient::tcp(tcp());
/// use mbm::client::CommEventCounter;
///
/// let CommEventCounter { status, events } = client.get_comm_event_counter(17)?;
/// assert_eq!(status, 0); // The device is not busy with an earlier request.
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct CommEventCounter {
    /// FFFF (hex) while the device still carries out an earlier request, otherwise 0.
    pub status: u16,
    /// How many requests the device has carried out.
    pub events: u16,
}

/// The response to function 0C.
///
/// ```
/// # include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/doc/pump.rs"));
/// # fn main() -> Result<(), mbm::Error> {
/// # let mut client = mbm::client::BlockingClient::tcp(tcp());
/// use mbm::client::CommEventLog;
///
/// let mut place = [0; CommEventLog::BYTES];
/// let log = client.get_comm_event_log(17, &mut place)?;
/// let latest: Option<&u8> = log.log.first();
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct CommEventLog<'a> {
    /// FFFF (hex) while the device still carries out an earlier request, otherwise 0.
    pub status: u16,
    /// How many requests the device has carried out.
    pub events: u16,
    /// How many messages were on the line.
    pub messages: u16,
    /// Up to 64 events, the latest first (V1.1b3, 6.10).
    pub log: &'a [u8],
}

impl<'a> CommEventLog<'a> {
    /// The most bytes of such a response.
    pub const BYTES: usize = 6 + 64;

    /// Parses the data of a response.
    pub(super) fn parse(data: &'a [u8]) -> Result<Self, Error> {
        let Some((&[a, b, c, d, e, f], log)) = data.split_first_chunk() else {
            return Err(Error::MalformedReply);
        };
        let word = |high, low| u16::from_be_bytes([high, low]);
        Ok(CommEventLog {
            status: word(a, b),
            events: word(c, d),
            messages: word(e, f),
            log,
        })
    }
}
