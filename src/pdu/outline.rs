//! A request in outline: the head of its PDU, how the caller's data follow it,
//! and how its response is known. The data stay where they are.
//!
//! What distinguishes one function from another is a number, so that firmware
//! which calls every function carries next to nothing for each.

use super::custom::Rule;
use super::diagnostics::{self, sub_function};
use super::identification::{self, MEI_READ_DEVICE_IDENTIFICATION};
use super::length::Length;
use super::limits::{
    FILE_DATA_BYTES, MAX_FIFO, MAX_PDU, MAX_READ_BITS, MAX_READ_REGISTERS,
    MAX_READ_WRITE_REGISTERS, MAX_RECORD, MAX_WRITE_BITS, MAX_WRITE_REGISTERS, READ_FILE_BYTES,
    WRITE_FILE_BYTES,
};
use super::query::check_range;
use super::{bits, files, length, registers, EXCEPTION};
use crate::error::Status;
use core::num::NonZeroU8;

/// The longest head: that of 17, and of 14 and 15 with one group.
const HEAD: usize = 9;

/// What a function's request and response look like, as flags and small numbers.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
#[repr(transparent)]
pub struct Form(u32);

/// A byte count stands between head and data.
const COUNTED: u32 = 1 << 8;
/// The data to send are words.
const SENDS_WORDS: u32 = 1 << 9;
/// The data received are words.
const TAKES_WORDS: u32 = 1 << 10;
/// The response repeats the data behind the head.
const REPEATS_DATA: u32 = 1 << 11;
/// Every unit may be told at once.
const BROADCAST: u32 = 1 << 12;
/// The data of the response are one group of a file.
const GROUP: u32 = 1 << 13;
/// Nothing responds.
const UNANSWERED: u32 = 1 << 14;
/// The second word is a quantity.
const RANGE: u32 = 1 << 15;
/// ... and one of bits.
const BITS: u32 = 1 << 16;

/// How the length of the response is known, two bits: it is so long,
const FIXED: u32 = 0;
/// so long, and its second byte counts,
const READ: u32 = 1 << 17;
/// the byte at an offset counts,
const COUNTS: u32 = 2 << 17;
/// its own rules say, or nothing but its end.
const OWN: u32 = 3 << 17;
const KIND: u32 = 3 << 17;

/// From this bit on, three bits each: length of the head and of the response,
/// or the offset of the byte that counts; how much the response repeats; where
/// its data begin, 0 for none.
const HEAD_LENGTH: u32 = 19;
const LENGTH: u32 = 22;
const REPEATED: u32 = 25;
const DATA: u32 = 28;

impl Form {
    const fn new(
        function: u8,
        flags: u32,
        head: u32,
        length: u32,
        repeated: u32,
        data: u32,
    ) -> Form {
        Form(
            function as u32
                | flags
                | head << HEAD_LENGTH
                | length << LENGTH
                | repeated << REPEATED
                | data << DATA,
        )
    }

    /// 01, 02.
    const fn bits(function: u8) -> Form {
        Form::new(function, RANGE | BITS | READ, 5, 0, 0, 2)
    }

    /// 03, 04.
    const fn registers(function: u8) -> Form {
        Form::new(function, RANGE | READ | TAKES_WORDS, 5, 0, 0, 2)
    }

    /// What the response repeats whole.
    const fn echoed(function: u8, flags: u32) -> Form {
        Form::new(function, flags | BROADCAST, 5, 5, 5, 0)
    }

    /// Nothing but a function code.
    const fn bare(function: u8, flags: u32, length: u32, data: u32) -> Form {
        Form::new(function, flags, 1, length, 0, data)
    }

    const fn has(self, flag: u32) -> bool {
        self.0 & flag != 0
    }

    const fn number(self, at: u32) -> u8 {
        (self.0 >> at) as u8 & 7
    }

    /// 01: address and quantity.
    pub const READ_COILS: Form = Form::bits(bits::READ_COILS);
    /// 02: address and quantity.
    pub const READ_DISCRETE_INPUTS: Form = Form::bits(bits::READ_DISCRETE_INPUTS);
    /// 03: address and quantity.
    pub const READ_HOLDING_REGISTERS: Form = Form::registers(registers::READ_HOLDING_REGISTERS);
    /// 04: address and quantity.
    pub const READ_INPUT_REGISTERS: Form = Form::registers(registers::READ_INPUT_REGISTERS);
    /// 05: address, and FF00 or 0.
    pub const WRITE_SINGLE_COIL: Form = Form::echoed(bits::WRITE_SINGLE_COIL, 0);
    /// 06: address and value.
    pub const WRITE_SINGLE_REGISTER: Form = Form::echoed(registers::WRITE_SINGLE_REGISTER, 0);
    /// 07.
    pub const READ_EXCEPTION_STATUS: Form =
        Form::bare(diagnostics::READ_EXCEPTION_STATUS, FIXED, 2, 1);
    /// 0B; two words are received.
    pub const GET_COMM_EVENT_COUNTER: Form = Form::bare(
        diagnostics::GET_COMM_EVENT_COUNTER,
        FIXED | TAKES_WORDS,
        5,
        1,
    );
    /// 0C; status, events and messages as words with the high byte first, then
    /// the events.
    pub const GET_COMM_EVENT_LOG: Form = Form::bare(diagnostics::GET_COMM_EVENT_LOG, COUNTS, 1, 2);
    /// 0F: address and quantity.
    pub const WRITE_MULTIPLE_COILS: Form =
        Form::echoed(bits::WRITE_MULTIPLE_COILS, RANGE | BITS | COUNTED);
    /// 10: address and quantity.
    pub const WRITE_MULTIPLE_REGISTERS: Form = Form::echoed(
        registers::WRITE_MULTIPLE_REGISTERS,
        RANGE | COUNTED | SENDS_WORDS,
    );
    /// 11.
    pub const REPORT_SERVER_ID: Form = Form::bare(diagnostics::REPORT_SERVER_ID, COUNTS, 1, 2);
    /// 16, of which the OR mask is to be added.
    const MASK_WRITE_REGISTER: Form =
        Form::new(registers::MASK_WRITE_REGISTER, BROADCAST, 7, 7, 7, 0);
    /// 18: address.
    pub const READ_FIFO_QUEUE: Form =
        Form::new(files::READ_FIFO_QUEUE, OWN | TAKES_WORDS, 3, 0, 0, 5);

    const DIAGNOSTICS: Form = Form::new(
        diagnostics::DIAGNOSTICS,
        FIXED | SENDS_WORDS | TAKES_WORDS,
        3,
        0,
        3,
        3,
    );
    const READ_FILE_RECORD: Form = Form::new(
        files::READ_FILE_RECORD,
        READ | GROUP | TAKES_WORDS,
        0,
        0,
        0,
        4,
    );
    const WRITE_FILE_RECORD: Form = Form::new(
        files::WRITE_FILE_RECORD,
        FIXED | SENDS_WORDS | REPEATS_DATA | BROADCAST,
        0,
        0,
        0,
        0,
    );
    const READ_FILE_RECORDS: Form =
        Form::new(files::READ_FILE_RECORD, COUNTS | COUNTED, 1, 1, 0, 2);
    const WRITE_FILE_RECORDS: Form = Form::new(
        files::WRITE_FILE_RECORD,
        FIXED | COUNTED | REPEATS_DATA | BROADCAST,
        1,
        0,
        1,
        0,
    );
    const ENCAPSULATED: Form = Form::new(
        identification::ENCAPSULATED_INTERFACE_TRANSPORT,
        OWN,
        2,
        0,
        2,
        2,
    );
}

/// A request in outline.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct Outline {
    form: Form,
    head: [u8; HEAD],
    head_length: u8,
    /// Bytes of the caller's data.
    data_length: u8,
    /// Length of the response PDU, or the offset of the byte that counts.
    length: u8,
    /// Bytes behind those that are counted.
    more: u8,
    /// How much of the request the response repeats.
    repeated: u8,
}

impl Outline {
    /// No request.
    pub const NONE: Outline = Outline {
        form: Form(0),
        head: [0; HEAD],
        head_length: 0,
        data_length: 0,
        length: 0,
        more: 0,
        repeated: 0,
    };

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
    pub fn mask_write_register(&mut self, address: u16, and_mask: u16, or_mask: u16) -> Status {
        self.set(Form::MASK_WRITE_REGISTER, address, and_mask);
        self.put(5, or_mask);
        Status::OK
    }

    /// 17: 1 to 121 registers are written, then 1 to 125 read; else as
    /// [`Outline::set`].
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
    pub fn read_device_identification(&mut self, code: u8, object: u8) -> Status {
        self.encapsulated(MEI_READ_DEVICE_IDENTIFICATION, 0);
        // Its data begin behind the code.
        self.form.0 += 1 << DATA;
        self.head[2] = code;
        self.head[3] = object;
        self.head_length = 4;
        self.repeated = 3;
        value((1..=4).contains(&code))
    }

    /// 2B of any MEI type and so many `bytes` of data; the response ends by
    /// silence or as the framing says.
    pub fn encapsulated(&mut self, mei_type: u8, bytes: u16) -> Status {
        self.set(Form::ENCAPSULATED, u16::from(mei_type) << 8, 0);
        self.follow(bytes)
    }

    /// A function of the user's with so many `bytes` of data, whose response is
    /// as long as `rule` says.
    pub fn custom(&mut self, function: u8, bytes: u16, rule: Rule) -> Status {
        let (kind, length, more) = match rule {
            Rule::Fixed(length) => (FIXED, length, 0),
            Rule::Counted(offset, more) => (COUNTS, offset, more),
            Rule::Silence => (OWN, 0, 0),
        };
        self.set(Form::new(function, kind, 1, 0, 0, 1), 0, 0);
        self.length = length;
        self.more = more;
        if kind != OWN && length == 0 {
            return Status::INVALID_ARGUMENT;
        }
        if function == 0 || function & EXCEPTION != 0 {
            return Status::ILLEGAL_FUNCTION;
        }
        self.follow(bytes)
    }

    /// So many bytes of data follow the head.
    fn follow(&mut self, bytes: u16) -> Status {
        self.data_length = bytes as u8;
        value(usize::from(bytes) + usize::from(self.head_length) <= MAX_PDU)
    }

    /// The head as sent.
    fn head(&self) -> &[u8] {
        self.head
            .get(..usize::from(self.head_length))
            .unwrap_or_default()
    }

    /// The function code.
    pub const fn function(&self) -> u8 {
        self.head[0]
    }

    /// Bytes of the caller's data that are sent.
    pub const fn data_length(&self) -> u8 {
        self.data_length
    }

    /// True if the data to send are words.
    pub const fn sends_words(&self) -> bool {
        self.form.has(SENDS_WORDS)
    }

    /// True if the data received are words.
    pub const fn takes_words(&self) -> bool {
        self.form.has(TAKES_WORDS)
    }

    /// True if the request may be sent to all units at once: 05, 06, 0F, 10, 15,
    /// 16, and of 08 the sub-functions 01, 04, 0A and 14.
    pub const fn may_be_broadcast(&self) -> bool {
        self.form.has(BROADCAST)
    }

    /// False for what turns a device mute (08 with sub-function 04).
    pub const fn is_answered(&self) -> bool {
        !self.form.has(UNANSWERED)
    }

    /// Where in the response its data begin; 0 if there are none.
    pub const fn data_at(&self) -> u8 {
        self.form.number(DATA)
    }

    /// How many bytes of data the response has, if that is known already; 0 else.
    pub const fn known_data(&self) -> u8 {
        if self.data_at() > 0 && matches!(self.form.0 & KIND, FIXED | READ) {
            self.length.saturating_sub(self.data_at())
        } else {
            0
        }
    }

    /// Length of the request PDU.
    pub const fn request_length(&self) -> u8 {
        let length = self.head_length + self.data_length;
        if self.form.has(COUNTED) {
            length + 1
        } else {
            length
        }
    }

    /// The bits of the last byte of data that are used.
    pub fn mask(&self) -> u8 {
        match self.head[4] & 7 {
            used if used > 0 && self.form.has(BITS) => (1 << used) - 1,
            _ => 0xFF,
        }
    }

    /// Writes the request PDU into `pdu`, which has
    /// [`Outline::request_length`] bytes; `byte` gives those of the data.
    #[inline]
    pub fn emit(&self, pdu: &mut [u8], byte: impl Fn(usize) -> u8) {
        let mut places = pdu.iter_mut();
        for byte in self.head() {
            if let Some(place) = places.next() {
                *place = *byte;
            }
        }
        if self.form.has(COUNTED) {
            if let Some(place) = places.next() {
                *place = self.data_length;
            }
        }
        for (index, place) in places.enumerate() {
            *place = byte(index);
        }
        // Of a request that writes bits, the last byte is one of data.
        if self.form.has(COUNTED) {
            if let Some(last) = pdu.last_mut() {
                *last &= self.mask();
            }
        }
    }

    /// True if `pdu`, complete or not, agrees with the head of this request.
    pub fn agrees(&self, pdu: &[u8]) -> bool {
        let mut theirs = pdu.iter();
        self.head()
            .iter()
            .all(|ours| theirs.next().is_none_or(|theirs| theirs == ours))
    }

    /// The length of the response that begins with the bytes of `pdu`, or the
    /// least length while they do not tell; `None` if no response to it begins
    /// so. `whole` is how long it is, once it is known to have ended.
    #[cfg_attr(target_os = "none", inline(never))]
    pub fn expected(&self, pdu: &[u8], whole: Option<usize>) -> Option<NonZeroU8> {
        let length = match pdu {
            [] => 2,
            [function, ..] if *function == self.function() | EXCEPTION => 2,
            [function, ..] if *function != self.function() => return None,
            _ => match self.form.0 & KIND {
                FIXED => usize::from(self.length),
                READ => match pdu {
                    [_, count, ..] if *count != self.length - 2 => return None,
                    _ => usize::from(self.length),
                },
                COUNTS => {
                    let offset = usize::from(self.length);
                    match pdu.get(offset) {
                        Some(count) => offset + 1 + usize::from(*count) + usize::from(self.more),
                        None => offset + 1,
                    }
                }
                _ => self.own_length(pdu, whole),
            },
        };
        if length > MAX_PDU {
            None
        } else {
            NonZeroU8::new(length as u8)
        }
    }

    /// The length where the response's own rules tell: of 18 and 2B/0E, or of
    /// what only its end ends.
    fn own_length(&self, pdu: &[u8], whole: Option<usize>) -> usize {
        let rule = match self.head {
            [files::READ_FIFO_QUEUE, ..] => length::response(pdu, &[]),
            [identification::ENCAPSULATED_INTERFACE_TRANSPORT, MEI_READ_DEVICE_IDENTIFICATION, ..] => {
                length::objects(pdu)
            }
            _ => Length::Silence,
        };
        match rule {
            Length::Exactly(length) | Length::AtLeast(length) => length,
            // While more may come, it is never complete.
            _ => whole.unwrap_or(pdu.len()).max(2),
        }
    }

    /// What a complete response of the [`Outline::expected`] length says:
    /// success, an exception of the remote device, or
    /// [`Status::MALFORMED_REPLY`]; `byte` gives the data that were sent.
    #[cfg_attr(target_os = "none", inline(never))]
    pub fn judge(&self, pdu: &[u8], byte: impl Fn(usize) -> u8) -> Status {
        if let [function, code, ..] = pdu {
            if function & EXCEPTION != 0 {
                return Status::exception(*code);
            }
        }
        let repeated = usize::from(self.repeated);
        let data = pdu.get(repeated..).unwrap_or_default();
        let echoed = pdu.get(..repeated).is_some_and(|echo| self.agrees(echo));
        let right = match *pdu {
            _ if !echoed => false,
            _ if self.form.has(REPEATS_DATA) => {
                let mut data = data.iter();
                let counted = !self.form.has(COUNTED) || data.next() == Some(&self.data_length);
                counted
                    && data
                        .enumerate()
                        .all(|(index, theirs)| *theirs == byte(index))
            }
            [_, count, group, reference, ..] if self.form.has(GROUP) => {
                group == count.wrapping_sub(1) && reference == files::REFERENCE_TYPE
            }
            [files::READ_FIFO_QUEUE, _, bytes, high, words, ..] => {
                high == 0 && u16::from(words) <= MAX_FIFO && bytes == 2 * words + 2
            }
            _ => pdu.len() >= usize::from(self.data_at()),
        };
        if right {
            Status::OK
        } else {
            Status::MALFORMED_REPLY
        }
    }
}

fn value(allowed: bool) -> Status {
    if allowed {
        Status::OK
    } else {
        Status::ILLEGAL_DATA_VALUE
    }
}
