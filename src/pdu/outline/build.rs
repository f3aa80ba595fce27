//! One way to build an outline for each request.

use super::super::custom::Rule;
use super::super::diagnostics::sub_function;
use super::super::identification::MEI_READ_DEVICE_IDENTIFICATION;
use super::super::limits::{
    FILE_DATA_BYTES, MAX_PDU, MAX_READ_BITS, MAX_READ_REGISTERS, MAX_READ_WRITE_REGISTERS,
    MAX_RECORD, MAX_WRITE_BITS, MAX_WRITE_REGISTERS, READ_FILE_BYTES, WRITE_FILE_BYTES,
};
use super::super::query::check_range;
use super::super::{files, registers, EXCEPTION};
use super::form::*;
use super::{Outline, HEAD};
use crate::error::Status;

// Each is a part of the one function of C that calls it, and again of the one that
// forwards: so firmware that forwards nothing pays nothing ("client: RTU, every
// function" in docs/size.md).
impl Outline {
    /// Becomes a request of two words, as far as its form has them.
    /// [`Status::OK`]; [`Status::ILLEGAL_DATA_VALUE`] for a quantity that the
    /// standard does not allow, [`Status::ILLEGAL_DATA_ADDRESS`] if the range
    /// passes 65535.
    #[cfg_attr(target_os = "none", inline(never))]
    pub fn set(&mut self, form: Form, first: u16, second: u16) -> Status {
        let ([a, b], [c, d]) = (first.to_be_bytes(), second.to_be_bytes());
        self.form = form;
        self.head = [form.0 as u8, a, b, c, d, 0, 0, 0, 0];
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
        let most = if form.has(COUNTED) {
            self.data_length = bytes as u8;
            write
        } else {
            self.length = (bytes as u8).wrapping_add(2);
            read
        };
        check_range(first, second, most)
    }

    fn put(&mut self, at: usize, word: u16) {
        if let Some(place) = self.head.get_mut(at..at + 2) {
            place.copy_from_slice(&word.to_be_bytes());
        }
    }

    /// 16: the register becomes `(register & and) | (or & !and)`.
    #[cfg_attr(target_os = "none", inline(always))]
    pub fn mask_write_register(&mut self, address: u16, and_mask: u16, or_mask: u16) -> Status {
        self.set(Form::MASK_WRITE_REGISTER, address, and_mask);
        self.put(5, or_mask);
        Status::OK
    }

    /// 17: 1 to 121 registers are written, then 1 to 125 read; else as
    /// [`Outline::set`].
    #[cfg_attr(target_os = "none", inline(always))]
    pub fn read_write_registers(
        &mut self,
        read_address: u16,
        read_quantity: u16,
        write_address: u16,
        write_quantity: u16,
    ) -> Status {
        const FORM: Form = Form::registers(registers::READ_WRITE_MULTIPLE_REGISTERS);
        let readable = self.set(FORM, read_address, read_quantity);
        self.form.0 |= COUNTED | SENDS_WORDS;
        self.put(5, write_address);
        self.put(7, write_quantity);
        self.head_length = HEAD as u8;
        self.data_length = (write_quantity << 1) as u8;
        match check_range(write_address, write_quantity, MAX_READ_WRITE_REGISTERS) {
            Status::OK => readable,
            refused => refused,
        }
    }

    /// 08: a sub-function and `words` words of data; all but Return Query Data
    /// take one. [`Status::ILLEGAL_DATA_VALUE`] for another number of them.
    #[cfg_attr(target_os = "none", inline(always))]
    pub fn diagnostics(&mut self, sub_function: u16, words: u16) -> Status {
        self.set(Form::DIAGNOSTICS, sub_function, 0);
        self.data_length = (words << 1) as u8;
        self.length = self.data_length.wrapping_add(3);
        let most = match sub_function {
            sub_function::RETURN_QUERY_DATA => {
                self.form.0 |= REPEATS_DATA;
                (MAX_PDU as u16 - 3) / 2
            }
            _ => 1,
        };
        self.form.0 |= match sub_function {
            sub_function::FORCE_LISTEN_ONLY => BROADCAST | UNANSWERED,
            sub_function::RESTART_COMMUNICATIONS
            | sub_function::CLEAR_COUNTERS
            | sub_function::CLEAR_OVERRUN_COUNTER => BROADCAST,
            _ => 0,
        };
        value(words >= 1 && words <= most)
    }

    /// 14 or 15 of one group of records.
    fn group(&mut self, form: Form, file: u16, record: u16, length: u16) -> Status {
        let bytes = (length << 1) as u8;
        self.set(form, 0, 0);
        self.head[2] = files::REFERENCE_TYPE;
        self.put(3, file);
        self.put(5, record);
        self.put(7, length);
        self.head_length = HEAD as u8;
        let (count, most) = if form.has(REPEATS_DATA) {
            self.data_length = bytes;
            self.repeated = HEAD as u8;
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

    /// 14 of 1 to 121 records in a row. [`Status::ILLEGAL_DATA_VALUE`] for
    /// another length, [`Status::ILLEGAL_DATA_ADDRESS`] for file 0 or records
    /// beyond 9999.
    pub fn read_file_record(&mut self, file: u16, record: u16, length: u16) -> Status {
        self.group(Form::READ_FILE_RECORD, file, record, length)
    }

    /// 15 of 1 to 122 records in a row; else as [`Outline::read_file_record`].
    pub fn write_file_record(&mut self, file: u16, record: u16, length: u16) -> Status {
        self.group(Form::WRITE_FILE_RECORD, file, record, length)
    }

    /// 14 of the groups that `bytes` bytes of data are, which their sender built.
    pub fn read_file_records(&mut self, bytes: u16) -> Status {
        self.set(Form::READ_FILE_RECORDS, 0, 0);
        self.data_length = bytes as u8;
        let bytes = usize::from(bytes);
        value(bytes >= READ_FILE_BYTES.0 && bytes <= READ_FILE_BYTES.1 && bytes.is_multiple_of(7))
    }

    /// 15 of the groups that `bytes` bytes of data are, which their sender built.
    pub fn write_file_records(&mut self, bytes: u16) -> Status {
        self.set(Form::WRITE_FILE_RECORDS, 0, 0);
        self.data_length = bytes as u8;
        self.length = (bytes as u8).wrapping_add(2);
        let bytes = usize::from(bytes);
        value(bytes >= WRITE_FILE_BYTES.0 && bytes <= WRITE_FILE_BYTES.1)
    }

    /// 2B/0E: read device id code 1 to 4 and the object to begin with.
    #[cfg_attr(target_os = "none", inline(always))]
    pub fn read_device_identification(&mut self, code: u8, object: u8) -> Status {
        self.encapsulated(MEI_READ_DEVICE_IDENTIFICATION, 0);
        // Its data begin behind the code.
        self.form.0 += 1 << DATA;
        self.head[2] = code;
        self.head[3] = object;
        self.head_length = 4;
        self.repeated = 3;
        value(matches!(code, 1..=4))
    }

    /// 2B of any MEI type and so many `bytes` of data; the response ends by
    /// silence or as the framing says.
    pub fn encapsulated(&mut self, mei_type: u8, bytes: u16) -> Status {
        self.set(Form::ENCAPSULATED, u16::from(mei_type) << 8, 0);
        self.follow(bytes)
    }

    /// A function of the user's with so many `bytes` of data, whose response is
    /// as long as `rule` says.
    #[cfg_attr(target_os = "none", inline(always))]
    pub fn custom(&mut self, function: u8, bytes: u16, rule: Rule) -> Status {
        self.set(Form::new(function, OWN, 1, 0, 0, 1), 0, 0);
        let (kind, length, more) = match rule {
            Rule::Fixed(length) => (FIXED, length, 0),
            Rule::Counted(offset, more) => (COUNTS, offset, more),
            Rule::Silence => (OWN, 1, 0),
        };
        self.form.0 -= OWN - kind;
        self.length = length;
        self.more = more;
        if length == 0 {
            return Status::INVALID_ARGUMENT;
        }
        if function == 0 || function & EXCEPTION != 0 {
            return Status::ILLEGAL_FUNCTION;
        }
        self.follow(bytes)
    }

    /// So many bytes of data follow the head.
    pub(super) fn follow(&mut self, bytes: u16) -> Status {
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
