//! File records and FIFO queues: functions 14, 15 and 18.

use super::Reply;
use crate::error::Status;
use crate::pdu::files::{Reads, Record, Writes, REFERENCE_TYPE};
use crate::pdu::functions::{READ_FIFO_QUEUE, READ_FILE_RECORD, WRITE_FILE_RECORD};
use crate::pdu::{MAX_FIFO, READ_FILE_BYTES};

/// The records of files. Each record is one register.
///
/// ```
/// use mbm::pdu::files::Record;
/// use mbm::server::files::Files;
///
/// /// File 1, of ten records.
/// struct Log {
///     records: [[u8; 2]; 10],
/// }
///
/// impl Files for Log {
///     fn contains(&self, record: Record) -> bool {
///         record.file == 1 && record.record + record.length <= 10
///     }
///
///     fn load(&self, record: Record, data: &mut [u8]) {
///         let from = &self.records[usize::from(record.record)..];
///         for (to, from) in data.chunks_mut(2).zip(from) {
///             to.copy_from_slice(from);
///         }
///     }
///
///     fn store(&mut self, record: Record, data: &[u8]) {
///         let to = &mut self.records[usize::from(record.record)..];
///         for (to, from) in to.iter_mut().zip(data.chunks(2)) {
///             to.copy_from_slice(from);
///         }
///     }
///
///     fn before_read(&mut self, _: Record) -> u8 {
///         0 // Anybody may read.
///     }
///
///     fn before_write(&mut self, record: Record, _: &[u8]) -> u8 {
///         if record.record == 0 { 2 } else { 0 } // Record 0 is read only: exception 02.
///     }
///
///     fn after_write(&mut self, _: Record, _: &[u8]) {
///         // Saves the file.
///     }
/// }
/// ```
pub trait Files {
    /// True if all of these records exist.
    fn contains(&self, record: Record) -> bool;

    /// Reads existing records into `data`, high byte first.
    fn load(&self, record: Record, data: &mut [u8]);

    /// Writes `data`, high byte first, to existing records.
    fn store(&mut self, record: Record, data: &[u8]);

    /// Called before records are read. It may change them. An exception code refuses the
    /// whole request; 0 allows it.
    fn before_read(&mut self, record: Record) -> u8 {
        let _ = record;
        0
    }

    /// Called before records are written. An exception code refuses the whole request; 0
    /// allows it.
    fn before_write(&mut self, record: Record, data: &[u8]) -> u8 {
        let _ = (record, data);
        0
    }

    /// Called after records were written.
    fn after_write(&mut self, record: Record, data: &[u8]) {
        let _ = (record, data);
    }
}

/// FIFO queues of registers.
///
/// ```
/// use mbm::server::files::Fifos;
///
/// /// One queue, at address 1000.
/// struct Alarms(Vec<u16>);
///
/// impl Fifos for Alarms {
///     fn count(&self, address: u16) -> Option<u16> {
///         (address == 1000).then_some(self.0.len() as u16)
///     }
///
///     fn load(&self, _: u16, data: &mut [u8]) {
///         for (to, from) in data.chunks_mut(2).zip(&self.0) {
///             to.copy_from_slice(&from.to_be_bytes());
///         }
///     }
/// }
/// ```
pub trait Fifos {
    /// How many registers the queue at this address holds; `None` if there is no queue.
    fn count(&self, address: u16) -> Option<u16>;

    /// Copies registers from the front of the queue into `data`, high byte first.
    fn load(&self, address: u16, data: &mut [u8]);
}

fn refusal(status: Status) -> Reply {
    Reply::exception(status.code())
}

/// Serves functions 14 and 15. The request PDU is the first `length` bytes of `pdu`; the
/// response overwrites it.
///
/// ```
/// use mbm::pdu::files::Record;
/// use mbm::server::files::{serve, Files};
/// use mbm::server::{Reply, Service};
///
/// /// A service of files.
/// struct FileService<F>(F);
///
/// impl<F: Files> Service for FileService<F> {
///     fn serve(&mut self, pdu: &mut [u8], length: usize) -> Reply {
///         serve(&mut self.0, pdu, length)
///     }
/// }
/// ```
pub fn serve(files: &mut impl Files, pdu: &mut [u8], length: usize) -> Reply {
    let (function, count) = match pdu.get(..length) {
        Some([function @ (READ_FILE_RECORD | WRITE_FILE_RECORD), count, ..]) => (*function, *count),
        Some([READ_FILE_RECORD | WRITE_FILE_RECORD]) => return Reply::ILLEGAL_DATA_VALUE,
        _ => return Reply::NOT_HANDLED,
    };
    if usize::from(count) + 2 != length {
        return Reply::ILLEGAL_DATA_VALUE;
    }
    if function == READ_FILE_RECORD {
        read(files, pdu, length)
    } else {
        write(files, pdu.get(2..length).unwrap_or_default(), length)
    }
}

fn read(files: &mut impl Files, pdu: &mut [u8], length: usize) -> Reply {
    // The response may overwrite parts of the request that are still needed: work on a copy.
    let mut aside = [0; READ_FILE_BYTES.1];
    let request = pdu.get(2..length).unwrap_or_default();
    let Some(kept) = aside.get_mut(..request.len()) else {
        return Reply::ILLEGAL_DATA_VALUE;
    };
    for (place, byte) in kept.iter_mut().zip(request) {
        *place = *byte;
    }
    let reads = match Reads::new(kept) {
        Ok(reads) => reads,
        Err(refused) => return refusal(refused.status()),
    };
    if !reads.iter().all(|record| files.contains(record)) {
        return Reply::ABSENT;
    }
    let total = reads.response_length();
    let Some([_, count, rest @ ..]) = pdu.get_mut(..total) else {
        return Reply::SERVER_DEVICE_FAILURE;
    };
    *count = rest.len() as u8;
    let mut rest = rest;
    for record in reads.iter() {
        let bytes = 2 * usize::from(record.length);
        let Some((group, following)) = rest.split_at_mut_checked(2 + bytes) else {
            break;
        };
        if let [length, reference, data @ ..] = group {
            *length = bytes as u8 + 1;
            *reference = REFERENCE_TYPE;
            let refused = files.before_read(record);
            if refused != 0 {
                return Reply::exception(refused);
            }
            files.load(record, data);
        }
        rest = following;
    }
    Reply::length(total)
}

fn write(files: &mut impl Files, request: &[u8], length: usize) -> Reply {
    let writes = match Writes::new(request) {
        Ok(writes) => writes,
        Err(refused) => return refusal(refused.status()),
    };
    if !writes.iter().all(|(record, _)| files.contains(record)) {
        return Reply::ABSENT;
    }
    for (record, data) in writes.iter() {
        let refused = files.before_write(record, data);
        if refused != 0 {
            return Reply::exception(refused);
        }
    }
    for (record, data) in writes.iter() {
        files.store(record, data);
    }
    for (record, data) in writes.iter() {
        files.after_write(record, data);
    }
    Reply::length(length)
}

/// Serves function 18, with arguments as of [`serve`].
///
/// ```
/// use mbm::server::files::{serve_fifos, Fifos};
/// use mbm::server::{Reply, Service};
///
/// /// A service of queues.
/// struct FifoService<F>(F);
///
/// impl<F: Fifos> Service for FifoService<F> {
///     fn serve(&mut self, pdu: &mut [u8], length: usize) -> Reply {
///         serve_fifos(&self.0, pdu, length)
///     }
/// }
/// ```
pub fn serve_fifos(fifos: &impl Fifos, pdu: &mut [u8], length: usize) -> Reply {
    if pdu.first() != Some(&READ_FIFO_QUEUE) {
        return Reply::NOT_HANDLED;
    }
    let address = match pdu.get(1..length) {
        Some(&[high, low]) => u16::from_be_bytes([high, low]),
        _ => return Reply::ILLEGAL_DATA_VALUE,
    };
    let Some(count) = fifos.count(address) else {
        return Reply::ABSENT;
    };
    if count > MAX_FIFO {
        return Reply::ILLEGAL_DATA_VALUE;
    }
    let bytes = 2 * usize::from(count);
    let Some([_, a, b, c, d, data @ ..]) = pdu.get_mut(..5 + bytes) else {
        return Reply::SERVER_DEVICE_FAILURE;
    };
    [*a, *b] = (bytes as u16 + 2).to_be_bytes();
    [*c, *d] = count.to_be_bytes();
    fifos.load(address, data);
    Reply::length(5 + bytes)
}
