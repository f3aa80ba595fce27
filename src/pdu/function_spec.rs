//! One description of each function's request and response, for the master and the client.
//!
//! The client uses a [`FunctionSpec`] as it is. The compiler converts it for the master, see
//! [`MasterSpec`](super::master_request::MasterSpec).

use super::limits::{MAX_READ_BITS, MAX_READ_REGISTERS, MAX_WRITE_BITS, MAX_WRITE_REGISTERS};
use super::{bits, diagnostics, files, identification, registers};

/// How the request and the response of a function are composed: flags and small numbers.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
#[repr(transparent)]
pub struct FunctionSpec(pub(super) u32);

/// A byte count stands between head and data.
pub(super) const COUNTED: u32 = 1 << 8;
/// The data to send are words.
pub(super) const SENDS_WORDS: u32 = 1 << 9;
/// The data received are words.
pub(super) const TAKES_WORDS: u32 = 1 << 10;
/// The response repeats all of the request.
pub(super) const REPEATS_DATA: u32 = 1 << 11;
/// Every unit may be told at once.
pub(super) const BROADCAST: u32 = 1 << 12;
/// The data of the response are groups of files.
pub(super) const GROUPS: u32 = 1 << 13;
/// Nothing responds.
pub(super) const UNANSWERED: u32 = 1 << 14;
/// The second word is a quantity.
pub(super) const RANGE: u32 = 1 << 15;
/// ... and one of bits.
pub(super) const BITS: u32 = 1 << 16;

/// How the length of the response is known, two bits: it is so long,
pub const FIXED: u32 = 0;
/// so long, and its second byte counts,
pub(super) const READ: u32 = 1 << 17;
/// the byte at an offset counts,
pub const COUNTS: u32 = 2 << 17;
/// its own rules say, or nothing but its end.
pub const OWN: u32 = 3 << 17;
pub(super) const KIND: u32 = 3 << 17;

/// From this bit on, three bits each: length of the head and of the response,
/// or the offset of the byte that counts; how much the response repeats; where
/// its data begin, 0 for none.
pub(super) const HEAD_LENGTH: u32 = 19;
pub(super) const LENGTH: u32 = 22;
pub(super) const REPEATED: u32 = 25;
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
        FunctionSpec(
            function as u32
                | flags
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

    /// 01 to 04, the functions that read a table of the data model.
    pub const fn reads_table(function: u8) -> FunctionSpec {
        let FunctionSpec(spec) = if function <= 2 {
            FunctionSpec::bits(0)
        } else {
            FunctionSpec::registers(0)
        };
        FunctionSpec(spec | function as u32)
    }

    /// True of a request whose response repeats its function code and two words, and
    /// nothing else.
    #[inline]
    pub(super) const fn repeats_two_words(self) -> bool {
        let fields = 7 << HEAD_LENGTH | 7 << LENGTH | 7 << REPEATED | KIND | REPEATS_DATA;
        self.0 & fields == 5 << HEAD_LENGTH | 5 << LENGTH | 5 << REPEATED
    }

    /// What the response repeats whole.
    pub(super) const fn echoed(function: u8, flags: u32) -> FunctionSpec {
        FunctionSpec::new(function, flags | BROADCAST, 5, 5, 5, 0)
    }

    /// Nothing but a function code.
    pub(super) const fn bare(function: u8, flags: u32, length: u32, data: u32) -> FunctionSpec {
        FunctionSpec::new(function, flags, 1, length, 0, data)
    }

    pub(super) const fn has(self, flag: u32) -> bool {
        self.0 & flag != 0
    }

    /// The function code.
    pub(super) const fn function(self) -> u8 {
        self.0 as u8
    }

    /// The greatest quantity of bits or registers that the standard allows; 0 if the request
    /// has no quantity.
    #[inline(always)]
    pub(super) const fn greatest_quantity(self) -> u16 {
        match (self.has(READ), self.has(BITS)) {
            _ if !self.has(RANGE) => 0,
            (true, true) => MAX_READ_BITS,
            (true, false) => MAX_READ_REGISTERS,
            (false, true) => MAX_WRITE_BITS,
            (false, false) => MAX_WRITE_REGISTERS,
        }
    }

    pub(super) const fn number(self, at: u32) -> u8 {
        (self.0 >> at) as u8 & 7
    }

    /// No request.
    pub(super) const NONE: FunctionSpec = FunctionSpec(0);

    /// 01: address and quantity.
    pub const READ_COILS: FunctionSpec = FunctionSpec::bits(bits::READ_COILS);
    /// 02: address and quantity.
    pub const READ_DISCRETE_INPUTS: FunctionSpec = FunctionSpec::bits(bits::READ_DISCRETE_INPUTS);
    /// 03: address and quantity.
    pub const READ_HOLDING_REGISTERS: FunctionSpec =
        FunctionSpec::registers(registers::READ_HOLDING_REGISTERS);
    /// 04: address and quantity.
    pub const READ_INPUT_REGISTERS: FunctionSpec =
        FunctionSpec::registers(registers::READ_INPUT_REGISTERS);
    /// 05: address, and FF00 or 0.
    pub const WRITE_SINGLE_COIL: FunctionSpec = FunctionSpec::echoed(bits::WRITE_SINGLE_COIL, 0);
    /// 06: address and value.
    pub const WRITE_SINGLE_REGISTER: FunctionSpec =
        FunctionSpec::echoed(registers::WRITE_SINGLE_REGISTER, 0);
    /// 07.
    pub const READ_EXCEPTION_STATUS: FunctionSpec =
        FunctionSpec::bare(diagnostics::READ_EXCEPTION_STATUS, FIXED, 2, 1);
    /// 0B; two words are received.
    pub const GET_COMM_EVENT_COUNTER: FunctionSpec = FunctionSpec::bare(
        diagnostics::GET_COMM_EVENT_COUNTER,
        FIXED | TAKES_WORDS,
        5,
        1,
    );
    /// 0C; status, events and messages as words with the high byte first, then
    /// the events.
    pub const GET_COMM_EVENT_LOG: FunctionSpec =
        FunctionSpec::bare(diagnostics::GET_COMM_EVENT_LOG, COUNTS, 1, 2);
    /// 0F: address and quantity.
    pub const WRITE_MULTIPLE_COILS: FunctionSpec =
        FunctionSpec::echoed(bits::WRITE_MULTIPLE_COILS, RANGE | BITS | COUNTED);
    /// 10: address and quantity.
    pub const WRITE_MULTIPLE_REGISTERS: FunctionSpec = FunctionSpec::echoed(
        registers::WRITE_MULTIPLE_REGISTERS,
        RANGE | COUNTED | SENDS_WORDS,
    );
    /// 11. Its response may be longer than it counts.
    pub const REPORT_SERVER_ID: FunctionSpec =
        FunctionSpec::bare(diagnostics::REPORT_SERVER_ID, OWN, 0, 2);
    /// 16, of which the OR mask is to be added.
    pub const MASK_WRITE_REGISTER: FunctionSpec =
        FunctionSpec::new(registers::MASK_WRITE_REGISTER, BROADCAST, 7, 7, 7, 0);
    /// 18: address.
    pub const READ_FIFO_QUEUE: FunctionSpec =
        FunctionSpec::new(files::READ_FIFO_QUEUE, OWN | TAKES_WORDS, 3, 0, 0, 5);

    /// 17, of which what it writes is to be added.
    pub const READ_WRITE_REGISTERS: FunctionSpec = FunctionSpec(
        FunctionSpec::registers(registers::READ_WRITE_MULTIPLE_REGISTERS).0 | COUNTED | SENDS_WORDS,
    );

    /// 08: a sub-function; the data are to be added.
    pub const DIAGNOSTICS: FunctionSpec = FunctionSpec::new(
        diagnostics::DIAGNOSTICS,
        FIXED | SENDS_WORDS | TAKES_WORDS,
        3,
        0,
        3,
        3,
    );
    /// 14, of which one group is to be added.
    pub const READ_FILE_RECORD: FunctionSpec = FunctionSpec::new(
        files::READ_FILE_RECORD,
        READ | GROUPS | TAKES_WORDS,
        0,
        0,
        0,
        4,
    );
    /// 15, of which one group is to be added.
    pub const WRITE_FILE_RECORD: FunctionSpec = FunctionSpec::new(
        files::WRITE_FILE_RECORD,
        FIXED | SENDS_WORDS | REPEATS_DATA | BROADCAST,
        0,
        0,
        0,
        0,
    );
    /// 14 of groups that the caller built.
    pub const READ_FILE_RECORDS: FunctionSpec = FunctionSpec::new(
        files::READ_FILE_RECORD,
        COUNTS | GROUPS | COUNTED,
        1,
        1,
        0,
        2,
    );
    /// 15 of groups that the caller built.
    pub const WRITE_FILE_RECORDS: FunctionSpec = FunctionSpec::new(
        files::WRITE_FILE_RECORD,
        FIXED | COUNTED | REPEATS_DATA | BROADCAST,
        1,
        0,
        1,
        0,
    );
    /// 2B: the MEI type; the data are to be added.
    pub const ENCAPSULATED: FunctionSpec = FunctionSpec::new(
        identification::ENCAPSULATED_INTERFACE_TRANSPORT,
        OWN,
        2,
        0,
        2,
        2,
    );
    /// 2B/0E: code and object behind the MEI type. Its data begin behind the code.
    pub const READ_DEVICE_IDENTIFICATION: FunctionSpec = FunctionSpec::new(
        identification::ENCAPSULATED_INTERFACE_TRANSPORT,
        OWN,
        4,
        0,
        3,
        3,
    );
    /// A user's function, of which the code and the rule are to be added.
    pub const CUSTOM: FunctionSpec = FunctionSpec::new(0, 0, 1, 0, 0, 1);
}
