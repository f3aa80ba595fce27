//! One description of each function's request and response, for the master and the client.
//!
//! The client uses a [`FunctionSpec`] as it is. The master uses its short form, see
//! [`FunctionSpec::short`].

use super::custom::Rule;
use super::functions::{self, Direction};

/// How the request and the response of a function are composed: flags and small numbers.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
#[repr(transparent)]
pub struct FunctionSpec(pub(super) u32);

/// A byte count stands between the head and the data.
pub(super) const COUNTED: u32 = 1 << 8;
/// The data to send are words.
pub(super) const SENDS_WORDS: u32 = 1 << 9;
/// The data received are words.
pub(super) const TAKES_WORDS: u32 = 1 << 10;
/// The response repeats the whole request.
pub(super) const REPEATS_DATA: u32 = 1 << 11;
/// The request may be broadcast.
pub(super) const BROADCAST: u32 = 1 << 12;
/// The data of the response are groups of file records.
pub(super) const GROUPS: u32 = 1 << 13;
/// Units do not respond.
pub(super) const UNANSWERED: u32 = 1 << 14;
/// The second word is a quantity.
pub(super) const RANGE: u32 = 1 << 15;
/// The quantity counts bits, not registers.
pub(super) const BITS: u32 = 1 << 16;

/// Two bits say how the length of the response is known. `FIXED`: the request determines it.
pub const FIXED: u32 = 0;
/// The request determines it, and the second byte of the response counts the data.
pub(super) const READ: u32 = 1 << 17;
/// The byte at an index counts the bytes after it.
pub const COUNTS: u32 = 2 << 17;
/// The function has a rule of its own, or only the end of the frame ends the response.
pub const OWN: u32 = 3 << 17;
/// The mask of these two bits.
pub(super) const KIND: u32 = 3 << 17;

/// The lowest of three bits: the length of the head.
pub(super) const HEAD_LENGTH: u32 = 19;
/// The lowest of three bits: the length of the response, or the index of the byte that counts.
pub(super) const LENGTH: u32 = 22;
/// The lowest of three bits: the number of bytes of the request that the response repeats.
pub(super) const REPEATED: u32 = 25;
/// The lowest of three bits: the index of the data in the response; 0 if it has none.
pub(super) const DATA: u32 = 28;

impl FunctionSpec {
    pub(super) const fn new(
        function: u8,
        flags: u32,
        head: u32,
        length: u32,
        repeated: u32,
        data: u32,
    ) -> FunctionSpec {
        let broadcast = match functions::direction(function) {
            Direction::Writes => BROADCAST,
            _ => 0,
        };
        FunctionSpec(
            function as u32
                | flags
                | broadcast
                | head << HEAD_LENGTH
                | length << LENGTH
                | repeated << REPEATED
                | data << DATA,
        )
    }

    /// 01, 02.
    pub(super) const fn bits(function: u8) -> FunctionSpec {
        FunctionSpec::new(function, RANGE | BITS | READ, 5, 0, 0, 2)
    }

    /// 03, 04.
    pub(super) const fn registers(function: u8) -> FunctionSpec {
        FunctionSpec::new(function, RANGE | READ | TAKES_WORDS, 5, 0, 0, 2)
    }

    /// 01 to 04: the functions that read a table.
    pub const fn reads_table(function: u8) -> FunctionSpec {
        let FunctionSpec(spec) = if function <= 2 {
            FunctionSpec::bits(0)
        } else {
            FunctionSpec::registers(0)
        };
        FunctionSpec(spec | function as u32)
    }

    /// A request of five bytes that the response repeats.
    pub(super) const fn echoed(function: u8, flags: u32) -> FunctionSpec {
        FunctionSpec::new(function, flags, 5, 5, 5, 0)
    }

    /// A request that is a function code alone. The table says how long its response is.
    pub(super) const fn bare(function: u8, flags: u32, data: u32) -> FunctionSpec {
        let (kind, length) = match functions::response(function) {
            Some(Rule::Fixed(length)) => (FIXED, length),
            Some(Rule::Counted(offset, _)) => (COUNTS, offset),
            _ => (OWN, 0),
        };
        FunctionSpec::new(function, flags | kind, 1, length as u32, 0, data)
    }

    pub(super) const fn has(self, flag: u32) -> bool {
        self.0 & flag != 0
    }

    /// The function code.
    pub(super) const fn function(self) -> u8 {
        self.0 as u8
    }

    pub(super) const fn number(self, at: u32) -> u8 {
        (self.0 >> at) as u8 & 7
    }

    /// No request.
    pub(super) const NONE: FunctionSpec = FunctionSpec(0);

    /// 01: address and quantity.
    pub const READ_COILS: FunctionSpec = FunctionSpec::bits(functions::READ_COILS);
    /// 02: address and quantity.
    pub const READ_DISCRETE_INPUTS: FunctionSpec =
        FunctionSpec::bits(functions::READ_DISCRETE_INPUTS);
    /// 03: address and quantity.
    pub const READ_HOLDING_REGISTERS: FunctionSpec =
        FunctionSpec::registers(functions::READ_HOLDING_REGISTERS);
    /// 04: address and quantity.
    pub const READ_INPUT_REGISTERS: FunctionSpec =
        FunctionSpec::registers(functions::READ_INPUT_REGISTERS);
    /// 05: address, and FF00 or 0.
    pub const WRITE_SINGLE_COIL: FunctionSpec =
        FunctionSpec::echoed(functions::WRITE_SINGLE_COIL, 0);
    /// 06: address and value.
    pub const WRITE_SINGLE_REGISTER: FunctionSpec =
        FunctionSpec::echoed(functions::WRITE_SINGLE_REGISTER, 0);
    /// 07.
    pub const READ_EXCEPTION_STATUS: FunctionSpec =
        FunctionSpec::bare(functions::READ_EXCEPTION_STATUS, 0, 1);
    /// 0B: two words are received.
    pub const GET_COMM_EVENT_COUNTER: FunctionSpec =
        FunctionSpec::bare(functions::GET_COMM_EVENT_COUNTER, TAKES_WORDS, 1);
    /// 0C: status, event count and message count are received as words with the high byte
    /// first, then the events.
    pub const GET_COMM_EVENT_LOG: FunctionSpec =
        FunctionSpec::bare(functions::GET_COMM_EVENT_LOG, 0, 2);
    /// 0F: address and quantity.
    pub const WRITE_MULTIPLE_COILS: FunctionSpec =
        FunctionSpec::echoed(functions::WRITE_MULTIPLE_COILS, RANGE | BITS | COUNTED);
    /// 10: address and quantity.
    pub const WRITE_MULTIPLE_REGISTERS: FunctionSpec = FunctionSpec::echoed(
        functions::WRITE_MULTIPLE_REGISTERS,
        RANGE | COUNTED | SENDS_WORDS,
    );
    /// 11. Its response may be longer than its byte count says.
    pub const REPORT_SERVER_ID: FunctionSpec =
        FunctionSpec::new(functions::REPORT_SERVER_ID, OWN, 1, 0, 0, 2);
    /// 16: address and AND mask; the OR mask is added later.
    pub const MASK_WRITE_REGISTER: FunctionSpec =
        FunctionSpec::new(functions::MASK_WRITE_REGISTER, 0, 7, 7, 7, 0);
    /// 18: address.
    pub const READ_FIFO_QUEUE: FunctionSpec =
        FunctionSpec::new(functions::READ_FIFO_QUEUE, OWN | TAKES_WORDS, 3, 0, 0, 5);

    /// 17: address and quantity to read; the range to write is added later.
    pub const READ_WRITE_REGISTERS: FunctionSpec = FunctionSpec(
        FunctionSpec::registers(functions::READ_WRITE_MULTIPLE_REGISTERS).0 | COUNTED | SENDS_WORDS,
    );

    /// 08: a sub-function; the data are added later.
    pub const DIAGNOSTICS: FunctionSpec = FunctionSpec::new(
        functions::DIAGNOSTICS,
        FIXED | SENDS_WORDS | TAKES_WORDS,
        3,
        0,
        3,
        3,
    );
    /// 14: one group is added later.
    pub const READ_FILE_RECORD: FunctionSpec = FunctionSpec::new(
        functions::READ_FILE_RECORD,
        READ | GROUPS | TAKES_WORDS,
        0,
        0,
        0,
        4,
    );
    /// 15: one group is added later.
    pub const WRITE_FILE_RECORD: FunctionSpec = FunctionSpec::new(
        functions::WRITE_FILE_RECORD,
        FIXED | SENDS_WORDS | REPEATS_DATA,
        0,
        0,
        0,
        0,
    );
    /// 14: the caller supplies the groups.
    pub const READ_FILE_RECORDS: FunctionSpec = FunctionSpec::new(
        functions::READ_FILE_RECORD,
        COUNTS | GROUPS | COUNTED,
        1,
        1,
        0,
        2,
    );
    /// 15: the caller supplies the groups.
    pub const WRITE_FILE_RECORDS: FunctionSpec = FunctionSpec::new(
        functions::WRITE_FILE_RECORD,
        FIXED | COUNTED | REPEATS_DATA,
        1,
        0,
        1,
        0,
    );
    /// 2B: the MEI type; the data are added later.
    pub const ENCAPSULATED: FunctionSpec =
        FunctionSpec::new(functions::ENCAPSULATED_INTERFACE_TRANSPORT, OWN, 2, 0, 2, 2);
    /// 2B/0E: MEI type, read device id code and object id. Its data begin after the code.
    pub const READ_DEVICE_IDENTIFICATION: FunctionSpec =
        FunctionSpec::new(functions::ENCAPSULATED_INTERFACE_TRANSPORT, OWN, 4, 0, 3, 3);
    /// A user-defined function; its code and its length rule are added later.
    pub const CUSTOM: FunctionSpec = FunctionSpec::new(0, 0, 1, 0, 0, 1);
}
