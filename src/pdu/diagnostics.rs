//! The sub-functions of 08, Diagnostics.

use super::fields::expect;
use crate::error::Error;

/// The sub-functions of 08 (clause 6.8.1).
pub mod sub_function {
    /// Return Query Data: the response repeats the data, any number of words.
    pub const RETURN_QUERY_DATA: u16 = 0x00;
    /// Restart Communications Option; data FF00 also clears the event log.
    pub const RESTART_COMMUNICATIONS: u16 = 0x01;
    /// Return Diagnostic Register.
    pub const RETURN_DIAGNOSTIC_REGISTER: u16 = 0x02;
    /// Change ASCII Input Delimiter; the character is the high byte.
    pub const CHANGE_ASCII_INPUT_DELIMITER: u16 = 0x03;
    /// Force Listen Only Mode; there is no response.
    pub const FORCE_LISTEN_ONLY: u16 = 0x04;
    /// Clear Counters and Diagnostic Register.
    pub const CLEAR_COUNTERS: u16 = 0x0A;
    /// Return Bus Message Count.
    pub const BUS_MESSAGE_COUNT: u16 = 0x0B;
    /// Return Bus Communication Error Count.
    pub const BUS_COMMUNICATION_ERROR_COUNT: u16 = 0x0C;
    /// Return Bus Exception Error Count.
    pub const BUS_EXCEPTION_ERROR_COUNT: u16 = 0x0D;
    /// Return Server Message Count.
    pub const SERVER_MESSAGE_COUNT: u16 = 0x0E;
    /// Return Server No Response Count.
    pub const SERVER_NO_RESPONSE_COUNT: u16 = 0x0F;
    /// Return Server NAK Count.
    pub const SERVER_NAK_COUNT: u16 = 0x10;
    /// Return Server Busy Count.
    pub const SERVER_BUSY_COUNT: u16 = 0x11;
    /// Return Bus Character Overrun Count.
    pub const BUS_CHARACTER_OVERRUN_COUNT: u16 = 0x12;
    /// Clear Overrun Counter and Flag.
    pub const CLEAR_OVERRUN_COUNTER: u16 = 0x14;
}

/// The data of Restart Communications Option that also clear the event log.
pub const CLEAR_LOG: u16 = 0xFF00;

/// True for a sub-function of the standard.
const fn is_known(sub_function: u16) -> bool {
    matches!(sub_function, 0x00..=0x04 | 0x0A..=0x12 | 0x14)
}

/// Checks a sub-function and its data: one word, or any number of words for Return Query Data.
pub(super) fn check_sub_function(sub_function: u16, data: &[u8]) -> Result<(), Error> {
    if !is_known(sub_function) {
        return Err(Error::IllegalFunction);
    }
    let any = sub_function == sub_function::RETURN_QUERY_DATA;
    expect(!data.is_empty() && data.len().is_multiple_of(2) && (any || data.len() == 2))
}
