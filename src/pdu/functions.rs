//! The table of the functions of the standard (application protocol V1.1b3, clause 6): the code, the
//! name, the lengths of request and response, and whether a function reads or writes. The parts of
//! this crate, the C API, the fuzzers and the tests take these facts from here.
//!
//! Lengths that depend on more than one byte are `None` here: [`super::length`] has them.

use super::custom::is_user_defined;
use super::custom::Rule::{self, Counted, Fixed};

/// What a function does to the data of a device.
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
        $request:expr, $response:expr, $direction:ident;)*) => {
        $($(#[$clause])* pub const $constant: u8 = $code;)*

        /// The codes of all functions.
        pub const CODES: &[u8] = &[$($constant),*];

        /// True for the function codes that the standard defines.
        pub const fn is_public(function: u8) -> bool {
            matches!(function, $($constant)|*)
        }

        /// The name of a function.
        pub const fn name(function: u8) -> &'static str {
            match function {
                $($constant => $name,)*
                code if is_user_defined(code) => "user-defined function",
                _ => "unknown function",
            }
        }

        /// The length of the request; `None` for an unknown function, and for one with a rule of its
        /// own.
        pub const fn request(function: u8) -> Option<Rule> {
            match function {
                $($constant => $request,)*
                _ => None,
            }
        }

        /// The length of the response, as [`request`].
        pub const fn response(function: u8) -> Option<Rule> {
            match function {
                $($constant => $response,)*
                _ => None,
            }
        }

        /// What a function does. [`Direction::Either`] for an unknown one.
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
        Some(Fixed(5)), Some(Counted(1, 0)), Reads;
    /// Read Discrete Inputs (clause 6.2).
    READ_DISCRETE_INPUTS = 0x02, "read discrete inputs",
        Some(Fixed(5)), Some(Counted(1, 0)), Reads;
    /// Read Holding Registers (clause 6.3).
    READ_HOLDING_REGISTERS = 0x03, "read holding registers",
        Some(Fixed(5)), Some(Counted(1, 0)), Reads;
    /// Read Input Registers (clause 6.4).
    READ_INPUT_REGISTERS = 0x04, "read input registers",
        Some(Fixed(5)), Some(Counted(1, 0)), Reads;
    /// Write Single Coil (clause 6.5).
    WRITE_SINGLE_COIL = 0x05, "write single coil",
        Some(Fixed(5)), Some(Fixed(5)), Writes;
    /// Write Single Register (clause 6.6).
    WRITE_SINGLE_REGISTER = 0x06, "write single register",
        Some(Fixed(5)), Some(Fixed(5)), Writes;
    /// Read Exception Status (clause 6.7).
    READ_EXCEPTION_STATUS = 0x07, "read exception status",
        Some(Fixed(1)), Some(Fixed(2)), Reads;
    /// Diagnostics (clause 6.8).
    DIAGNOSTICS = 0x08, "diagnostics",
        None, None, Either;
    /// Get Comm Event Counter (clause 6.9).
    GET_COMM_EVENT_COUNTER = 0x0B, "get comm event counter",
        Some(Fixed(1)), Some(Fixed(5)), Reads;
    /// Get Comm Event Log (clause 6.10).
    GET_COMM_EVENT_LOG = 0x0C, "get comm event log",
        Some(Fixed(1)), Some(Counted(1, 0)), Reads;
    /// Write Multiple Coils (clause 6.11).
    WRITE_MULTIPLE_COILS = 0x0F, "write multiple coils",
        Some(Counted(5, 0)), Some(Fixed(5)), Writes;
    /// Write Multiple Registers (clause 6.12).
    WRITE_MULTIPLE_REGISTERS = 0x10, "write multiple registers",
        Some(Counted(5, 0)), Some(Fixed(5)), Writes;
    /// Report Server ID (clause 6.13). The response may be longer than its byte count says.
    REPORT_SERVER_ID = 0x11, "report server id",
        Some(Fixed(1)), Some(Counted(1, 0)), Reads;
    /// Read File Record (clause 6.14).
    READ_FILE_RECORD = 0x14, "read file record",
        Some(Counted(1, 0)), Some(Counted(1, 0)), Reads;
    /// Write File Record (clause 6.15).
    WRITE_FILE_RECORD = 0x15, "write file record",
        Some(Counted(1, 0)), Some(Counted(1, 0)), Writes;
    /// Mask Write Register (clause 6.16).
    MASK_WRITE_REGISTER = 0x16, "mask write register",
        Some(Fixed(7)), Some(Fixed(7)), Writes;
    /// Read/Write Multiple Registers (clause 6.17).
    READ_WRITE_MULTIPLE_REGISTERS = 0x17, "read/write multiple registers",
        Some(Counted(9, 0)), Some(Counted(1, 0)), Either;
    /// Read FIFO Queue (clause 6.18).
    READ_FIFO_QUEUE = 0x18, "read FIFO queue",
        Some(Fixed(3)), None, Reads;
    /// Encapsulated Interface Transport (clause 6.19).
    ENCAPSULATED_INTERFACE_TRANSPORT = 0x2B, "encapsulated interface transport",
        None, None, Either;
}
