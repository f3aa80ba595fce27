//! Makes the request of each function.

use super::RequestState;
use crate::error::Status;
use crate::pdu::custom::Rule;
use crate::pdu::diagnostics::sub_function;
use crate::pdu::files::GROUP;
use crate::pdu::functions::{
    FunctionSpec, BITS, BROADCAST, COUNTS, FIXED, HEAD_LENGTH, LENGTH, OWN, RANGE, READ,
    REPEATS_DATA, UNANSWERED,
};
use crate::pdu::identification::MEI_READ_DEVICE_IDENTIFICATION;
use crate::pdu::{
    check_range, EXCEPTION, FILE_DATA_BYTES, MAX_PDU, MAX_READ_BITS, MAX_READ_REGISTERS,
    MAX_READ_WRITE_REGISTERS, MAX_RECORD, MAX_WRITE_BITS, MAX_WRITE_REGISTERS, READ_FILE_BYTES,
    WRITE_FILE_BYTES,
};

/// Bytes of the four words and the function code.
const FOUR_WORDS: u8 = 9;

// `set` refuses only ranges of addresses, so functions without one ignore its status.
//
// `add_…` and `follow` are functions of their own because all functions of the C API call
// `set` in one common place first, which is smaller.
impl RequestState {
    /// Makes a request of the function `spec`. `first` and `second` are the words after the
    /// function code; a function with fewer words ignores them. Returns
    /// [`Status::ILLEGAL_DATA_VALUE`] for a quantity that the standard does not allow,
    /// [`Status::ILLEGAL_DATA_ADDRESS`] if the range goes beyond address 65535, otherwise
    /// [`Status::OK`].
    pub fn set(&mut self, spec: FunctionSpec, first: u16, second: u16) -> Status {
        self.set_all(spec, &[first.into(), second.into(), 0, 0])
    }

    /// As [`RequestState::set`], with up to four words after the function code.
    // For the C API; it may change in any version.
    #[doc(hidden)]
    pub fn set_all(&mut self, spec: FunctionSpec, words: &[usize; 4]) -> Status {
        // `map` would compile to a loop.
        let (first, second) = (words[0] as u16, words[1] as u16);
        self.spec = spec;
        self.head[0] = spec.function();
        for (place, word) in self.head[1..].as_chunks_mut().0.iter_mut().zip(words) {
            *place = (*word as u16).to_be_bytes();
        }
        self.head_length = spec.number(HEAD_LENGTH);
        self.rule = spec.number(LENGTH);
        self.data_length = 0;
        self.more = 0;
        if !spec.has(RANGE) {
            return Status::OK;
        }
        let (bytes, read, write) = if spec.has(BITS) {
            (second.div_ceil(8), MAX_READ_BITS, MAX_WRITE_BITS)
        } else {
            (second << 1, MAX_READ_REGISTERS, MAX_WRITE_REGISTERS)
        };
        let most = if spec.has(READ) {
            self.rule = (bytes as u8).wrapping_add(2);
            read
        } else {
            self.count(bytes as u8);
            write
        };
        check_range(first, second, most)
    }

    /// Ends the head with the byte count of the data.
    #[cfg_attr(target_os = "none", inline(never))]
    fn count(&mut self, bytes: u8) {
        self.data_length = bytes;
        if let Some(count) = self.head.get_mut(usize::from(self.head_length)) {
            *count = bytes;
        }
        self.head_length += 1;
    }

    /// 16 (hex): the register becomes `(register & and_mask) | (or_mask & !and_mask)`.
    pub fn mask_write_register(&mut self, address: u16, and_mask: u16, or_mask: u16) -> Status {
        let words = [address.into(), and_mask.into(), or_mask.into(), 0];
        self.set_all(FunctionSpec::MASK_WRITE_REGISTER, &words)
    }

    /// 17 (hex): the unit writes 1 to 121 registers and then reads 1 to 125. Returns as
    /// [`RequestState::set`].
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

    /// Adds the range that 17 (hex) writes, after [`RequestState::set_all`].
    // For the C API; it may change in any version.
    #[doc(hidden)]
    #[inline(always)]
    pub fn add_write(&mut self, address: u16, quantity: u16) -> Status {
        self.head_length = FOUR_WORDS;
        self.count((quantity << 1) as u8);
        check_range(address, quantity, MAX_READ_WRITE_REGISTERS)
    }

    /// 08: a sub-function and `words` words of data. Returns [`Status::ILLEGAL_DATA_VALUE`]
    /// for 0 words, for more than one unless the sub-function is Return Query Data, and for
    /// more than a PDU holds; otherwise [`Status::OK`].
    pub fn diagnostics(&mut self, sub_function: u16, words: u16) -> Status {
        let _ = self.set(FunctionSpec::DIAGNOSTICS, sub_function, 0);
        self.add_words(sub_function, words)
    }

    /// Adds the number of words of data to 08, after [`RequestState::set`].
    // For the C API; it may change in any version.
    #[doc(hidden)]
    pub fn add_words(&mut self, sub_function: u16, words: u16) -> Status {
        self.data_length = (words << 1) as u8;
        self.rule = self.data_length.wrapping_add(3);
        let (more, most) = match sub_function {
            sub_function::RETURN_QUERY_DATA => (REPEATS_DATA, (MAX_PDU as u16 - 3) / 2),
            sub_function::FORCE_LISTEN_ONLY => (BROADCAST | UNANSWERED, 1),
            sub_function::RESTART_COMMUNICATIONS
            | sub_function::CLEAR_COUNTERS
            | sub_function::CLEAR_OVERRUN_COUNTER => (BROADCAST, 1),
            _ => (0, 1),
        };
        self.spec.0 |= more;
        value(words >= 1 && words <= most)
    }

    /// Sets the byte count of 14 or 15 (hex) with one group of records, after
    /// [`RequestState::set_all`].
    // For the C API; it may change in any version.
    #[doc(hidden)]
    pub fn add_group(&mut self, file: u16, record: u16, length: u16) -> Status {
        let bytes = (length << 1) as u8;
        self.head_length = FOUR_WORDS;
        let (count, most) = if self.spec.has(REPEATS_DATA) {
            self.data_length = bytes;
            self.rule = bytes.wrapping_add(FOUR_WORDS);
            (bytes.wrapping_add(7), (WRITE_FILE_BYTES.1 - 7) / 2)
        } else {
            self.rule = bytes.wrapping_add(4);
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

    fn group(&mut self, spec: FunctionSpec, file: u16, record: u16, length: u16) -> Status {
        let words = [GROUP, file.into(), record.into(), length.into()];
        let _ = self.set_all(spec, &words);
        self.add_group(file, record, length)
    }

    /// 14 (hex): reads `length` consecutive records, 1 to 121. Returns
    /// [`Status::ILLEGAL_DATA_VALUE`] for another length, [`Status::ILLEGAL_DATA_ADDRESS`]
    /// for file 0 and for a record above 9999, otherwise [`Status::OK`].
    pub fn read_file_record(&mut self, file: u16, record: u16, length: u16) -> Status {
        self.group(FunctionSpec::READ_FILE_RECORD, file, record, length)
    }

    /// 15 (hex): writes `length` consecutive records, 1 to 122. Returns as
    /// [`RequestState::read_file_record`].
    pub fn write_file_record(&mut self, file: u16, record: u16, length: u16) -> Status {
        self.group(FunctionSpec::WRITE_FILE_RECORD, file, record, length)
    }

    // In line, here and below: a gateway takes 28 bytes less on a Cortex-M0+ and 84 on an AVR.
    /// 14 (hex) with several groups: the caller supplies the groups as `bytes` bytes of data.
    #[inline(always)]
    pub fn read_file_records(&mut self, bytes: u16) -> Status {
        let _ = self.set(FunctionSpec::READ_FILE_RECORDS, 0, 0);
        self.count(bytes as u8);
        let bytes = usize::from(bytes);
        value(bytes >= READ_FILE_BYTES.0 && bytes <= READ_FILE_BYTES.1 && bytes.is_multiple_of(7))
    }

    /// 15 (hex) with several groups: the caller supplies the groups as `bytes` bytes of data.
    #[inline(always)]
    pub fn write_file_records(&mut self, bytes: u16) -> Status {
        let _ = self.set(FunctionSpec::WRITE_FILE_RECORDS, 0, 0);
        self.count(bytes as u8);
        self.rule = (bytes as u8).wrapping_add(2);
        let bytes = usize::from(bytes);
        value(bytes >= WRITE_FILE_BYTES.0 && bytes <= WRITE_FILE_BYTES.1)
    }

    /// 2B/0E (hex): `code` is the read device id code, 1 to 4, `object` the id of the first
    /// object to read.
    pub fn read_device_identification(&mut self, code: u8, object: u8) -> Status {
        let [first, second] = RequestState::identification(code, object);
        let _ = self.set(FunctionSpec::READ_DEVICE_IDENTIFICATION, first, second);
        RequestState::check_code(code)
    }

    /// The two words of 2B/0E (hex).
    // For the C API; it may change in any version.
    #[doc(hidden)]
    pub fn identification(code: u8, object: u8) -> [u16; 2] {
        let mei_type = MEI_READ_DEVICE_IDENTIFICATION;
        [u16::from_be_bytes([mei_type, code]), u16::from(object) << 8]
    }

    /// Returns [`Status::OK`] if `code` is a read device id code.
    // For the C API; it may change in any version.
    #[doc(hidden)]
    pub fn check_code(code: u8) -> Status {
        value(matches!(code, 1..=4))
    }

    /// 2B (hex) of any MEI type, with `bytes` bytes of data. The end of the frame ends the
    /// response.
    pub fn encapsulated(&mut self, mei_type: u8, bytes: u16) -> Status {
        let _ = self.set(FunctionSpec::ENCAPSULATED, u16::from(mei_type) << 8, 0);
        self.follow(bytes)
    }

    /// A user-defined function with `bytes` bytes of data. `rule` gives the length of its
    /// response.
    pub fn custom(&mut self, function: u8, bytes: u16, rule: Rule) -> Status {
        let _ = self.set(FunctionSpec::CUSTOM, 0, 0);
        match rule {
            Rule::Fixed(0) | Rule::Counted(0, _) => Status::INVALID_ARGUMENT,
            Rule::Fixed(length) => self.add_rule(function, bytes, FIXED, [length, 0]),
            Rule::Counted(offset, more) => self.add_rule(function, bytes, COUNTS, [offset, more]),
            Rule::Silence => self.add_rule(function, bytes, OWN, [0, 0]),
        }
    }

    /// Adds the function code of a user-defined function, the `kind` of its length rule and
    /// the numbers of that rule, after [`RequestState::set`].
    // For the C API; it may change in any version.
    #[doc(hidden)]
    #[cfg_attr(target_os = "none", inline(always))]
    pub fn add_rule(
        &mut self,
        function: u8,
        bytes: u16,
        kind: u32,
        [length, more]: [u8; 2],
    ) -> Status {
        self.spec.0 |= kind | u32::from(function);
        self.head[0] = function;
        self.rule = length;
        self.more = more;
        if function == 0 || function & EXCEPTION != 0 {
            return Status::ILLEGAL_FUNCTION;
        }
        self.follow(bytes)
    }

    /// Sets the number of bytes of data that follow the head.
    // For the C API; it may change in any version.
    #[doc(hidden)]
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
