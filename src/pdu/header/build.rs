//! One way to build an outline for each request.

use super::super::custom::Rule;
use super::super::diagnostics::sub_function;
use super::super::fields::check_range;
use super::super::function_spec::*;
use super::super::identification::MEI_READ_DEVICE_IDENTIFICATION;
use super::super::limits::{
    FILE_DATA_BYTES, MAX_PDU, MAX_READ_BITS, MAX_READ_REGISTERS, MAX_READ_WRITE_REGISTERS,
    MAX_RECORD, MAX_WRITE_BITS, MAX_WRITE_REGISTERS, READ_FILE_BYTES, WRITE_FILE_BYTES,
};
use super::super::{files, EXCEPTION};
use super::{RequestHeader, HEAD};
use crate::error::Status;

/// The first word of one group: its reference type behind the byte count.
pub const GROUP: usize = files::REFERENCE_TYPE as usize;

// What is behind [`RequestHeader::set`] stands apart, for the functions of C call that first,
// at one place for all.
impl RequestHeader {
    /// Becomes a request of two words, as far as its form has them.
    /// [`Status::OK`]; [`Status::ILLEGAL_DATA_VALUE`] for a quantity that the
    /// standard does not allow, [`Status::ILLEGAL_DATA_ADDRESS`] if the range
    /// passes 65535.
    pub fn set(&mut self, form: FunctionSpec, first: u16, second: u16) -> Status {
        self.set_all(form, &[first.into(), second.into(), 0, 0])
    }

    /// As [`RequestHeader::set`], with as many words in the head as the function has.
    #[cfg_attr(target_os = "none", inline(never))]
    #[cfg_attr(not(target_os = "none"), inline(always))]
    pub fn set_all(&mut self, form: FunctionSpec, words: &[usize; 4]) -> Status {
        // No map, which would be a loop.
        let (first, second) = (words[0] as u16, words[1] as u16);
        self.form = form;
        self.head[0] = form.function();
        for (place, word) in self.head[1..].as_chunks_mut().0.iter_mut().zip(words) {
            *place = (*word as u16).to_be_bytes();
        }
        self.head_length = form.number(HEAD_LENGTH);
        self.length = form.number(LENGTH);
        self.repeated = form.number(REPEATED);
        self.data_length = 0;
        self.more = 0;
        if !form.has(RANGE) {
            return Status::OK;
        }
        let (bytes, read, write) = if form.has(BITS) {
            (second.div_ceil(8), MAX_READ_BITS, MAX_WRITE_BITS)
        } else {
            (second << 1, MAX_READ_REGISTERS, MAX_WRITE_REGISTERS)
        };
        let most = if form.has(READ) {
            self.length = (bytes as u8).wrapping_add(2);
            read
        } else {
            self.data_length = bytes as u8;
            write
        };
        check_range(first, second, most)
    }

    /// 16: the register becomes `(register & and) | (or & !and)`.
    pub fn mask_write_register(&mut self, address: u16, and_mask: u16, or_mask: u16) -> Status {
        let words = [address.into(), and_mask.into(), or_mask.into(), 0];
        self.set_all(FunctionSpec::MASK_WRITE_REGISTER, &words)
    }

    /// 17: 1 to 121 registers are written, then 1 to 125 read; else as
    /// [`RequestHeader::set`].
    pub fn read_write_registers(
        &mut self,
        read_address: u16,
        read_quantity: u16,
        write_address: u16,
        write_quantity: u16,
    ) -> Status {
        let words = [read_address, read_quantity, write_address, write_quantity];
        let words = words.map(usize::from);
        let readable = self.set_all(FunctionSpec::READ_WRITE_REGISTERS, &words);
        match self.add_write(write_address, write_quantity) {
            Status::OK => readable,
            refused => refused,
        }
    }

    /// What 17 writes, behind the head that [`RequestHeader::set_all`] set.
    #[inline(always)]
    pub fn add_write(&mut self, address: u16, quantity: u16) -> Status {
        self.head_length = HEAD as u8;
        self.data_length = (quantity << 1) as u8;
        check_range(address, quantity, MAX_READ_WRITE_REGISTERS)
    }

    /// 08: a sub-function and `words` words of data; all but Return Query Data
    /// take one. [`Status::ILLEGAL_DATA_VALUE`] for another number of them.
    pub fn diagnostics(&mut self, sub_function: u16, words: u16) -> Status {
        self.set(FunctionSpec::DIAGNOSTICS, sub_function, 0);
        self.add_words(sub_function, words)
    }

    /// How many words of data 08 has, behind what [`RequestHeader::set`] set.
    #[inline(always)]
    pub fn add_words(&mut self, sub_function: u16, words: u16) -> Status {
        self.data_length = (words << 1) as u8;
        self.length = self.data_length.wrapping_add(3);
        let (more, most) = match sub_function {
            sub_function::RETURN_QUERY_DATA => (REPEATS_DATA, (MAX_PDU as u16 - 3) / 2),
            sub_function::FORCE_LISTEN_ONLY => (BROADCAST | UNANSWERED, 1),
            sub_function::RESTART_COMMUNICATIONS
            | sub_function::CLEAR_COUNTERS
            | sub_function::CLEAR_OVERRUN_COUNTER => (BROADCAST, 1),
            _ => (0, 1),
        };
        self.form.0 |= more;
        value(words >= 1 && words <= most)
    }

    /// One group of records, of 14 or 15, whose head [`RequestHeader::set_all`] set, but for
    /// its byte count.
    pub fn add_group(&mut self, file: u16, record: u16, length: u16) -> Status {
        let bytes = (length << 1) as u8;
        self.head_length = HEAD as u8;
        let (count, most) = if self.form.has(REPEATS_DATA) {
            self.data_length = bytes;
            self.length = bytes.wrapping_add(HEAD as u8);
            (bytes.wrapping_add(7), (WRITE_FILE_BYTES.1 - 7) / 2)
        } else {
            self.length = bytes.wrapping_add(4);
            (7, (FILE_DATA_BYTES.1 - 2) / 2)
        };
        self.head[1] = count;
        if length == 0 || length > most as u16 {
            Status::ILLEGAL_DATA_VALUE
        } else if file == 0 || record > MAX_RECORD + 1 - length {
            Status::ILLEGAL_DATA_ADDRESS
        } else {
            Status::OK
        }
    }

    fn group(&mut self, form: FunctionSpec, file: u16, record: u16, length: u16) -> Status {
        let words = [GROUP, file.into(), record.into(), length.into()];
        self.set_all(form, &words);
        self.add_group(file, record, length)
    }

    /// 14 of 1 to 121 records in a row. [`Status::ILLEGAL_DATA_VALUE`] for
    /// another length, [`Status::ILLEGAL_DATA_ADDRESS`] for file 0 or records
    /// beyond 9999.
    pub fn read_file_record(&mut self, file: u16, record: u16, length: u16) -> Status {
        self.group(FunctionSpec::READ_FILE_RECORD, file, record, length)
    }

    /// 15 of 1 to 122 records in a row; else as [`RequestHeader::read_file_record`].
    pub fn write_file_record(&mut self, file: u16, record: u16, length: u16) -> Status {
        self.group(FunctionSpec::WRITE_FILE_RECORD, file, record, length)
    }

    /// 14 of the groups that `bytes` bytes of data are, which their sender built.
    pub fn read_file_records(&mut self, bytes: u16) -> Status {
        self.set(FunctionSpec::READ_FILE_RECORDS, 0, 0);
        self.data_length = bytes as u8;
        let bytes = usize::from(bytes);
        value(bytes >= READ_FILE_BYTES.0 && bytes <= READ_FILE_BYTES.1 && bytes.is_multiple_of(7))
    }

    /// 15 of the groups that `bytes` bytes of data are, which their sender built.
    pub fn write_file_records(&mut self, bytes: u16) -> Status {
        self.set(FunctionSpec::WRITE_FILE_RECORDS, 0, 0);
        self.data_length = bytes as u8;
        self.length = (bytes as u8).wrapping_add(2);
        let bytes = usize::from(bytes);
        value(bytes >= WRITE_FILE_BYTES.0 && bytes <= WRITE_FILE_BYTES.1)
    }

    /// 2B/0E: read device id code 1 to 4 and the object to begin with.
    pub fn read_device_identification(&mut self, code: u8, object: u8) -> Status {
        let [first, second] = RequestHeader::identification(code, object);
        self.set(FunctionSpec::READ_DEVICE_IDENTIFICATION, first, second);
        RequestHeader::check_code(code)
    }

    /// The two words of 2B/0E.
    #[inline(always)]
    pub fn identification(code: u8, object: u8) -> [u16; 2] {
        let mei_type = MEI_READ_DEVICE_IDENTIFICATION;
        [u16::from_be_bytes([mei_type, code]), u16::from(object) << 8]
    }

    /// [`Status::OK`] for a read device id code.
    #[inline(always)]
    pub fn check_code(code: u8) -> Status {
        value(matches!(code, 1..=4))
    }

    /// 2B of any MEI type and so many `bytes` of data; the response ends by
    /// silence or as the framing says.
    pub fn encapsulated(&mut self, mei_type: u8, bytes: u16) -> Status {
        self.set(FunctionSpec::ENCAPSULATED, u16::from(mei_type) << 8, 0);
        self.follow(bytes)
    }

    /// A function of the user's with so many `bytes` of data, whose response is
    /// as long as `rule` says.
    pub fn custom(&mut self, function: u8, bytes: u16, rule: Rule) -> Status {
        self.set(FunctionSpec::CUSTOM, 0, 0);
        match rule {
            Rule::Fixed(0) | Rule::Counted(0, _) => Status::INVALID_ARGUMENT,
            Rule::Fixed(length) => self.add_rule(function, bytes, FIXED, [length, 0]),
            Rule::Counted(offset, more) => self.add_rule(function, bytes, COUNTS, [offset, more]),
            Rule::Silence => self.add_rule(function, bytes, OWN, [0, 0]),
        }
    }

    /// The function of the user's, behind the form that [`RequestHeader::set`] set: how the
    /// length of its response is known, with the numbers that this takes.
    #[cfg_attr(target_os = "none", inline(always))]
    pub fn add_rule(
        &mut self,
        function: u8,
        bytes: u16,
        kind: u32,
        [length, more]: [u8; 2],
    ) -> Status {
        self.form.0 |= kind | u32::from(function);
        self.head[0] = function;
        self.length = length;
        self.more = more;
        if function == 0 || function & EXCEPTION != 0 {
            return Status::ILLEGAL_FUNCTION;
        }
        self.follow(bytes)
    }

    /// So many bytes of data follow the head.
    pub fn follow(&mut self, bytes: u16) -> Status {
        self.data_length = bytes as u8;
        value(usize::from(bytes) + usize::from(self.head_length) <= MAX_PDU)
    }
}

fn value(allowed: bool) -> Status {
    if allowed {
        Status::OK
    } else {
        Status::ILLEGAL_DATA_VALUE
    }
}
