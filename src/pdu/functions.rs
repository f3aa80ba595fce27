//! The table of the functions of the standard (application protocol V1.1b3, clause 6): the code, the
//! name, the fields and the lengths of request and response, and whether a function reads or writes.
//! The parts of this crate, the C API, the header, the pages, the fuzzers and the tests take these
//! facts from here.
//!
//! Lengths that depend on more than one byte are `None` here: [`super::length`] has them.

use super::custom::is_user_defined;
use super::custom::Rule::{self, Counted, Fixed};
use crate::error::Status;

/// What a function does to the data of a device.
///
/// ```
/// use mbm::pdu::functions::{direction, Direction};
///
/// assert_eq!(direction(3), Direction::Reads);
/// assert_eq!(direction(6), Direction::Writes);
/// ```
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Direction {
    /// It changes nothing.
    Reads,
    /// It changes data and returns none, so it may be broadcast.
    Writes,
    /// It does both, or its sub-function or MEI type decides.
    Either,
}

macro_rules! functions {
    ($($(#[$clause:meta])* $constant:ident = $code:literal, $name:literal,
        $request_fields:literal, $response_fields:literal,
        $request:expr, $response:expr, $direction:ident, $spec:ident;)*) => {
        $($(#[$clause])* pub const $constant: u8 = $code;)*

        /// The codes of all functions.
        pub const CODES: &[u8] = &[$($constant),*];

        /// The fields of the requests and of the responses of each function, in the order of the wire, by
        /// the names that the packet of C has for them.
        pub const FIELDS: &[(u8, &str, &str)] = &[$(($constant, $request_fields, $response_fields)),*];

        /// True for the function codes that the standard defines.
        ///
        /// ```
        /// assert!(mbm::pdu::is_public(3));
        /// assert!(!mbm::pdu::is_public(65));
        /// ```
        pub const fn is_public(function: u8) -> bool {
            matches!(function, $($constant)|*)
        }

        /// The name of a function.
        ///
        /// ```
        /// assert_eq!(mbm::pdu::functions::name(3), "read holding registers");
        /// assert_eq!(mbm::pdu::functions::name(65), "user-defined function");
        /// ```
        pub const fn name(function: u8) -> &'static str {
            match function {
                $($constant => $name,)*
                code if is_user_defined(code) => "user-defined function",
                _ => "unknown function",
            }
        }

        /// The length of the request; `None` for an unknown function, and for one with a rule of its
        /// own.
        ///
        /// ```
        /// use mbm::pdu::custom::Rule;
        ///
        /// assert_eq!(mbm::pdu::functions::request(3), Some(Rule::Fixed(5)));
        /// ```
        pub const fn request(function: u8) -> Option<Rule> {
            match function {
                $($constant => $request,)*
                _ => None,
            }
        }

        /// The length of the response, as [`request`].
        ///
        /// ```
        /// use mbm::pdu::custom::Rule;
        ///
        /// assert_eq!(mbm::pdu::functions::response(3), Some(Rule::Counted(1, 0)));
        /// ```
        pub const fn response(function: u8) -> Option<Rule> {
            match function {
                $($constant => $response,)*
                _ => None,
            }
        }

        impl FunctionSpec {
            /// How the request of a function is composed, if it has at most two words and one
            /// kind of data; otherwise the empty one.
            pub const fn of(function: u8) -> FunctionSpec {
                match function {
                    $($constant => FunctionSpec::$spec,)*
                    _ => FunctionSpec::NONE,
                }
            }
        }

        /// The direction of a function's data. [`Direction::Either`] for an unknown function.
        ///
        /// ```
        /// use mbm::pdu::functions::{direction, Direction};
        ///
        /// assert_eq!(direction(3), Direction::Reads);
        /// // It writes, then reads.
        /// assert_eq!(direction(0x17), Direction::Either);
        /// ```
        pub const fn direction(function: u8) -> Direction {
            match function {
                $($constant => Direction::$direction,)*
                _ => Direction::Either,
            }
        }
    };
}

#[rustfmt::skip]
functions! {
    /// Read Coils (clause 6.1).
    READ_COILS = 0x01, "read coils",
        "address, quantity", "data",
        Some(Fixed(5)), Some(Counted(1, 0)), Reads,
        READ_COILS;
    /// Read Discrete Inputs (clause 6.2).
    READ_DISCRETE_INPUTS = 0x02, "read discrete inputs",
        "address, quantity", "data",
        Some(Fixed(5)), Some(Counted(1, 0)), Reads,
        READ_DISCRETE_INPUTS;
    /// Read Holding Registers (clause 6.3).
    READ_HOLDING_REGISTERS = 0x03, "read holding registers",
        "address, quantity", "data",
        Some(Fixed(5)), Some(Counted(1, 0)), Reads,
        READ_HOLDING_REGISTERS;
    /// Read Input Registers (clause 6.4).
    READ_INPUT_REGISTERS = 0x04, "read input registers",
        "address, quantity", "data",
        Some(Fixed(5)), Some(Counted(1, 0)), Reads,
        READ_INPUT_REGISTERS;
    /// Write Single Coil (clause 6.5).
    WRITE_SINGLE_COIL = 0x05, "write single coil",
        "address, value", "address, value",
        Some(Fixed(5)), Some(Fixed(5)), Writes,
        WRITE_SINGLE_COIL;
    /// Write Single Register (clause 6.6).
    WRITE_SINGLE_REGISTER = 0x06, "write single register",
        "address, value", "address, value",
        Some(Fixed(5)), Some(Fixed(5)), Writes,
        WRITE_SINGLE_REGISTER;
    /// Read Exception Status (clause 6.7).
    READ_EXCEPTION_STATUS = 0x07, "read exception status",
        "", "exceptionStatus",
        Some(Fixed(1)), Some(Fixed(2)), Reads,
        READ_EXCEPTION_STATUS;
    /// Diagnostics (clause 6.8).
    DIAGNOSTICS = 0x08, "diagnostics",
        "subFunction, data", "subFunction, data",
        None, None, Either,
        NONE;
    /// Get Comm Event Counter (clause 6.9).
    GET_COMM_EVENT_COUNTER = 0x0B, "get comm event counter",
        "", "commStatus, eventCount",
        Some(Fixed(1)), Some(Fixed(5)), Reads,
        GET_COMM_EVENT_COUNTER;
    /// Get Comm Event Log (clause 6.10).
    GET_COMM_EVENT_LOG = 0x0C, "get comm event log",
        "", "commStatus, eventCount, messageCount, data",
        Some(Fixed(1)), Some(Counted(1, 0)), Reads,
        GET_COMM_EVENT_LOG;
    /// Write Multiple Coils (clause 6.11).
    WRITE_MULTIPLE_COILS = 0x0F, "write multiple coils",
        "address, quantity, data", "address, quantity",
        Some(Counted(5, 0)), Some(Fixed(5)), Writes,
        WRITE_MULTIPLE_COILS;
    /// Write Multiple Registers (clause 6.12).
    WRITE_MULTIPLE_REGISTERS = 0x10, "write multiple registers",
        "address, quantity, data", "address, quantity",
        Some(Counted(5, 0)), Some(Fixed(5)), Writes,
        WRITE_MULTIPLE_REGISTERS;
    /// Report Server ID (clause 6.13). The response may be longer than its byte count says.
    REPORT_SERVER_ID = 0x11, "report server id",
        "", "byteCount, data",
        Some(Fixed(1)), Some(Counted(1, 0)), Reads,
        REPORT_SERVER_ID;
    /// Read File Record (clause 6.14).
    READ_FILE_RECORD = 0x14, "read file record",
        "data", "data",
        Some(Counted(1, 0)), Some(Counted(1, 0)), Reads,
        NONE;
    /// Write File Record (clause 6.15).
    WRITE_FILE_RECORD = 0x15, "write file record",
        "data", "data",
        Some(Counted(1, 0)), Some(Counted(1, 0)), Writes,
        NONE;
    /// Mask Write Register (clause 6.16).
    MASK_WRITE_REGISTER = 0x16, "mask write register",
        "address, andMask, orMask", "address, andMask, orMask",
        Some(Fixed(7)), Some(Fixed(7)), Writes,
        NONE;
    /// Read/Write Multiple Registers (clause 6.17).
    READ_WRITE_MULTIPLE_REGISTERS = 0x17, "read/write multiple registers",
        "address, quantity, writeAddress, writeQuantity, data", "data",
        Some(Counted(9, 0)), Some(Counted(1, 0)), Either,
        NONE;
    /// Read FIFO Queue (clause 6.18).
    READ_FIFO_QUEUE = 0x18, "read FIFO queue",
        "address", "data",
        Some(Fixed(3)), None, Reads,
        READ_FIFO_QUEUE;
    /// Encapsulated Interface Transport (clause 6.19).
    ENCAPSULATED_INTERFACE_TRANSPORT = 0x2B, "encapsulated interface transport",
        "meiType, data", "meiType, data",
        None, None, Either,
        NONE;
}

/// The first address and the quantity in the request that begins with `head`: for 17 (hex)
/// those to read; for a function that writes one register or coil the quantity is 1. `None` if
/// the function has none, or if `head` ends before.
///
/// ```
/// use mbm::pdu::functions::range;
///
/// // Reads two registers from 107 on.
/// assert_eq!(range(&[3, 0, 107, 0, 2]), (Some(107), Some(2)));
/// // Writes one.
/// assert_eq!(range(&[6, 0, 107, 0, 2]), (Some(107), Some(1)));
/// ```
pub fn range(head: &[u8]) -> (Option<u16>, Option<u16>) {
    let Some((function, body)) = head.split_first() else {
        return (None, None);
    };
    let spec = FunctionSpec::of_head(*function);
    let words = body.as_chunks().0;
    let word = |index: usize| words.get(index).map(|word| u16::from_be_bytes(*word));
    match word(0) {
        Some(address) if spec.number(HEAD_LENGTH) >= 3 => {
            let one = if spec.repeated() > 0 { Some(1) } else { None };
            let quantity = if spec.has(RANGE) { word(1) } else { one };
            (Some(address), quantity)
        }
        _ => (None, None),
    }
}

/// The value that switches a single coil on in a request of 05; 0 switches it off (clause 6.5).
pub const COIL_ON: u16 = 0xFF00;

/// The value in a request of 05 that switches a coil on or off.
// For the C API; it may change in any version.
#[doc(hidden)]
pub const fn coil_value(on: bool) -> u16 {
    if on {
        COIL_ON
    } else {
        0
    }
}

/// How the request and the response of a function are composed: flags and small numbers.
///
/// ```
/// use mbm::client::RequestState;
/// use mbm::pdu::functions::FunctionSpec;
/// use mbm::Status;
///
/// let mut state = RequestState::NONE;
/// assert_eq!(state.set(FunctionSpec::READ_HOLDING_REGISTERS, 107, 2), Status::OK);
/// assert_eq!(state.set(FunctionSpec::of(3), 107, 126), Status::ILLEGAL_DATA_VALUE);
/// ```
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
#[repr(transparent)]
pub struct FunctionSpec(pub(crate) u32);

/// The data to send are words.
pub(crate) const SENDS_WORDS: u32 = 1 << 9;
/// The data received are words.
pub(crate) const TAKES_WORDS: u32 = 1 << 10;
/// The response repeats the whole request.
pub(crate) const REPEATS_DATA: u32 = 1 << 11;
/// The request may be broadcast.
pub(crate) const BROADCAST: u32 = 1 << 12;
/// The data of the response are groups of file records.
pub(crate) const GROUPS: u32 = 1 << 13;
/// Units do not respond.
pub(crate) const UNANSWERED: u32 = 1 << 14;
/// The second word is a quantity.
pub(crate) const RANGE: u32 = 1 << 15;
/// The quantity counts bits, not registers.
pub(crate) const BITS: u32 = 1 << 16;

/// Two bits say how the length of the response is known. `FIXED`: the request determines it.
pub const FIXED: u32 = 0;
/// The request determines it, and the second byte of the response counts the data.
pub(crate) const READ: u32 = 1 << 17;
/// The byte at an index counts the bytes after it.
pub const COUNTS: u32 = 2 << 17;
/// The function has a rule of its own, or only the end of the frame ends the response.
pub const OWN: u32 = 3 << 17;
/// The mask of these two bits.
pub(crate) const KIND: u32 = 3 << 17;

/// The lowest of three bits: the length of the head.
pub(crate) const HEAD_LENGTH: u32 = 19;
/// The lowest of three bits: the length of the response, or the index of the byte that counts.
/// For [`OWN`] it says which function's rule holds, named by the least length of its response;
/// 0 means the end of the frame. (The function code does not say it: a user may give it another
/// rule.)
pub(crate) const LENGTH: u32 = 22;
/// The rule of 11 (hex).
pub(crate) const SERVER_ID: u8 = 2;
/// The rule of 18 (hex).
pub(crate) const QUEUE: u8 = 3;
/// The rule of 2B/0E (hex).
pub(crate) const OBJECTS: u8 = 7;
/// The lowest of three bits: the number of bytes of the request that the response repeats.
const REPEATED: u32 = 25;
/// The lowest of three bits: the index of the data in the response; 0 if it has none.
pub(crate) const DATA: u32 = 28;

impl FunctionSpec {
    /// As [`FunctionSpec::of`], also for 16 and 17 (hex), which have more words.
    pub(crate) const fn of_head(function: u8) -> FunctionSpec {
        match function {
            MASK_WRITE_REGISTER => FunctionSpec::MASK_WRITE_REGISTER,
            READ_WRITE_MULTIPLE_REGISTERS => FunctionSpec::READ_WRITE_REGISTERS,
            function => FunctionSpec::of(function),
        }
    }

    const fn new(
        function: u8,
        flags: u32,
        head: u32,
        length: u32,
        repeated: u32,
        data: u32,
    ) -> FunctionSpec {
        let broadcast = match direction(function) {
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
    const fn bits(function: u8) -> FunctionSpec {
        FunctionSpec::new(function, RANGE | BITS | READ, 5, 0, 0, 2)
    }

    /// 03, 04.
    const fn registers(function: u8) -> FunctionSpec {
        FunctionSpec::new(function, RANGE | READ | TAKES_WORDS, 5, 0, 0, 2)
    }

    /// 01 to 04: the functions that read a table.
    // For the C API; it may change in any version.
    #[doc(hidden)]
    pub const fn reads_table(function: u8) -> FunctionSpec {
        let FunctionSpec(spec) = if function <= 2 {
            FunctionSpec::bits(0)
        } else {
            FunctionSpec::registers(0)
        };
        FunctionSpec(spec | function as u32)
    }

    /// A request of five bytes that the response repeats.
    const fn echoed(function: u8, flags: u32) -> FunctionSpec {
        FunctionSpec::new(function, flags, 5, 5, 5, 0)
    }

    /// A request that is a function code alone. The table says how long its response is.
    const fn bare(function: u8, flags: u32, data: u32) -> FunctionSpec {
        let (kind, length) = match response(function) {
            Some(Rule::Fixed(length)) => (FIXED, length),
            Some(Rule::Counted(offset, _)) => (COUNTS, offset),
            _ => (OWN, 0),
        };
        FunctionSpec::new(function, flags | kind, 1, length as u32, 0, data)
    }

    pub(crate) const fn has(self, flag: u32) -> bool {
        self.0 & flag != 0
    }

    /// The function code.
    pub(crate) const fn function(self) -> u8 {
        self.0 as u8
    }

    pub(crate) const fn number(self, at: u32) -> u8 {
        (self.0 >> at) as u8 & 7
    }

    /// How many bytes of the request the response repeats; 0 for none, and for a response that
    /// repeats all.
    // For the C API; it may change in any version.
    #[doc(hidden)]
    pub const fn repeated(self) -> u8 {
        self.number(REPEATED)
    }

    /// No request.
    pub(crate) const NONE: FunctionSpec = FunctionSpec(0);

    /// 01: address and quantity.
    pub const READ_COILS: FunctionSpec = FunctionSpec::bits(READ_COILS);
    /// 02: address and quantity.
    pub const READ_DISCRETE_INPUTS: FunctionSpec = FunctionSpec::bits(READ_DISCRETE_INPUTS);
    /// 03: address and quantity.
    pub const READ_HOLDING_REGISTERS: FunctionSpec =
        FunctionSpec::registers(READ_HOLDING_REGISTERS);
    /// 04: address and quantity.
    pub const READ_INPUT_REGISTERS: FunctionSpec = FunctionSpec::registers(READ_INPUT_REGISTERS);
    /// 05: address, and FF00 or 0.
    pub const WRITE_SINGLE_COIL: FunctionSpec = FunctionSpec::echoed(WRITE_SINGLE_COIL, 0);
    /// 06: address and value.
    pub const WRITE_SINGLE_REGISTER: FunctionSpec = FunctionSpec::echoed(WRITE_SINGLE_REGISTER, 0);
    /// 07.
    pub const READ_EXCEPTION_STATUS: FunctionSpec = FunctionSpec::bare(READ_EXCEPTION_STATUS, 0, 1);
    /// 0B: two words are received.
    pub const GET_COMM_EVENT_COUNTER: FunctionSpec =
        FunctionSpec::bare(GET_COMM_EVENT_COUNTER, TAKES_WORDS, 1);
    /// 0C: status, event count and message count are received as words with the high byte
    /// first, then the events.
    pub const GET_COMM_EVENT_LOG: FunctionSpec = FunctionSpec::bare(GET_COMM_EVENT_LOG, 0, 2);
    /// 0F: address and quantity.
    pub const WRITE_MULTIPLE_COILS: FunctionSpec =
        FunctionSpec::echoed(WRITE_MULTIPLE_COILS, RANGE | BITS);
    /// 10: address and quantity.
    pub const WRITE_MULTIPLE_REGISTERS: FunctionSpec =
        FunctionSpec::echoed(WRITE_MULTIPLE_REGISTERS, RANGE | SENDS_WORDS);
    /// 11. Its response may be longer than its byte count says.
    pub const REPORT_SERVER_ID: FunctionSpec =
        FunctionSpec::new(REPORT_SERVER_ID, OWN, 1, SERVER_ID as u32, 0, 2);
    /// 16: address and AND mask; the OR mask is added later.
    pub const MASK_WRITE_REGISTER: FunctionSpec =
        FunctionSpec::new(MASK_WRITE_REGISTER, 0, 7, 7, 7, 0);
    /// 18: address.
    pub const READ_FIFO_QUEUE: FunctionSpec =
        FunctionSpec::new(READ_FIFO_QUEUE, OWN | TAKES_WORDS, 3, QUEUE as u32, 0, 5);

    /// 17: address and quantity to read; the range to write is added later.
    pub const READ_WRITE_REGISTERS: FunctionSpec =
        FunctionSpec(FunctionSpec::registers(READ_WRITE_MULTIPLE_REGISTERS).0 | SENDS_WORDS);

    /// 08: a sub-function; the data are added later.
    pub const DIAGNOSTICS: FunctionSpec =
        FunctionSpec::new(DIAGNOSTICS, FIXED | SENDS_WORDS | TAKES_WORDS, 3, 0, 3, 3);
    /// 14: one group is added later.
    pub const READ_FILE_RECORD: FunctionSpec =
        FunctionSpec::new(READ_FILE_RECORD, READ | GROUPS | TAKES_WORDS, 0, 0, 0, 4);
    /// 15: one group is added later.
    pub const WRITE_FILE_RECORD: FunctionSpec = FunctionSpec::new(
        WRITE_FILE_RECORD,
        FIXED | SENDS_WORDS | REPEATS_DATA,
        0,
        0,
        0,
        0,
    );
    /// 14: the caller supplies the groups.
    pub const READ_FILE_RECORDS: FunctionSpec =
        FunctionSpec::new(READ_FILE_RECORD, COUNTS | GROUPS, 1, 1, 0, 2);
    /// 15: the caller supplies the groups.
    pub const WRITE_FILE_RECORDS: FunctionSpec =
        FunctionSpec::new(WRITE_FILE_RECORD, FIXED | REPEATS_DATA, 1, 0, 1, 0);
    /// 2B: the MEI type; the data are added later.
    pub const ENCAPSULATED: FunctionSpec =
        FunctionSpec::new(ENCAPSULATED_INTERFACE_TRANSPORT, OWN, 2, 0, 2, 2);
    /// 2B/0E: MEI type, read device id code and object id. Its data begin after the code.
    pub const READ_DEVICE_IDENTIFICATION: FunctionSpec = FunctionSpec::new(
        ENCAPSULATED_INTERFACE_TRANSPORT,
        OWN,
        4,
        OBJECTS as u32,
        3,
        3,
    );
    /// A user-defined function; its code and its length rule are added later.
    pub const CUSTOM: FunctionSpec = FunctionSpec::new(0, 0, 1, 0, 0, 1);
}

/// A number of items. More than 65535 are refused as 65535 are.
pub(crate) fn quantity(items: usize) -> u16 {
    items.try_into().unwrap_or(u16::MAX)
}

/// Checks a range of addresses as every device would (application protocol,
/// figures 11 and following: quantity first, then addresses).
pub(crate) fn check_range(address: u16, quantity: u16, most: u16) -> Status {
    if quantity == 0 || quantity > most {
        Status::ILLEGAL_DATA_VALUE
    } else if address.checked_add(quantity - 1).is_none() {
        Status::ILLEGAL_DATA_ADDRESS
    } else {
        Status::OK
    }
}
