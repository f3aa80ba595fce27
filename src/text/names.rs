//! Names from the standard for sub-functions, exceptions and other codes.

use crate::pdu::diagnostics::sub_function as sub;
use crate::pdu::identification;

/// The name of a sub-function of function 08, diagnostics.
pub const fn sub_function(code: u16) -> &'static str {
    match code {
        sub::RETURN_QUERY_DATA => "return query data",
        sub::RESTART_COMMUNICATIONS => "restart communications option",
        sub::RETURN_DIAGNOSTIC_REGISTER => "return diagnostic register",
        sub::CHANGE_ASCII_INPUT_DELIMITER => "change ASCII input delimiter",
        sub::FORCE_LISTEN_ONLY => "force listen only mode",
        sub::CLEAR_COUNTERS => "clear counters and diagnostic register",
        sub::BUS_MESSAGE_COUNT => "return bus message count",
        sub::BUS_COMMUNICATION_ERROR_COUNT => "return bus communication error count",
        sub::BUS_EXCEPTION_ERROR_COUNT => "return bus exception error count",
        sub::SERVER_MESSAGE_COUNT => "return server message count",
        sub::SERVER_NO_RESPONSE_COUNT => "return server no response count",
        sub::SERVER_NAK_COUNT => "return server NAK count",
        sub::SERVER_BUSY_COUNT => "return server busy count",
        sub::BUS_CHARACTER_OVERRUN_COUNT => "return bus character overrun count",
        sub::CLEAR_OVERRUN_COUNTER => "clear overrun counter and flag",
        _ => "unknown sub-function",
    }
}

/// The name of an exception code (V1.1b3, 7).
pub const fn exception(code: u8) -> &'static str {
    match code {
        0x01 => "illegal function",
        0x02 => "illegal data address",
        0x03 => "illegal data value",
        0x04 => "server device failure",
        0x05 => "acknowledge",
        0x06 => "server device busy",
        0x08 => "memory parity error",
        0x0A => "gateway path unavailable",
        0x0B => "gateway target device failed to respond",
        _ => "unknown code",
    }
}

/// The name of a read device id code (V1.1b3, 6.21).
pub const fn device_id(code: u8) -> &'static str {
    match code {
        identification::BASIC => "basic",
        identification::REGULAR => "regular",
        identification::EXTENDED => "extended",
        identification::INDIVIDUAL => "individual",
        _ => "unknown",
    }
}
