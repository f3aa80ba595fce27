//! Sub-functions and other codes of functions, and the functions that a user declares. The function
//! codes of the header are made of the table in `src/pdu/functions.rs`.

use mbm::error::Error;
use mbm::pdu::custom::{Function, Rule};
use mbm::pdu::MAX_PDU;
use mbm::pdu::{diagnostics, identification};

/// Sub-function of 08: the device returns the data, of any number of words (V1.1b3, 6.8.1).
pub const MBM_DIAGNOSTICS_RETURN_QUERY_DATA: u16 = 0x00;
/// Sub-function of 08: restarts the communications port. The data FF 00 also clear the
/// event log.
pub const MBM_DIAGNOSTICS_RESTART_COMMUNICATIONS: u16 = 0x01;
/// Sub-function of 08: the device returns its diagnostic register.
pub const MBM_DIAGNOSTICS_RETURN_DIAGNOSTIC_REGISTER: u16 = 0x02;
/// Sub-function of 08: sets the character that ends ASCII frames after CR. The first byte
/// of the data is the character.
pub const MBM_DIAGNOSTICS_CHANGE_ASCII_INPUT_DELIMITER: u16 = 0x03;
/// Sub-function of 08: the device listens only. It sends no reply.
pub const MBM_DIAGNOSTICS_FORCE_LISTEN_ONLY: u16 = 0x04;
/// Sub-function of 08: clears the counters and the diagnostic register.
pub const MBM_DIAGNOSTICS_CLEAR_COUNTERS: u16 = 0x0A;
/// Sub-function of 08: the number of messages that the device detected on the bus.
pub const MBM_DIAGNOSTICS_BUS_MESSAGE_COUNT: u16 = 0x0B;
/// Sub-function of 08: the number of messages with a wrong CRC.
pub const MBM_DIAGNOSTICS_BUS_COMMUNICATION_ERROR_COUNT: u16 = 0x0C;
/// Sub-function of 08: the number of exceptions that the device sent.
pub const MBM_DIAGNOSTICS_BUS_EXCEPTION_ERROR_COUNT: u16 = 0x0D;
/// Sub-function of 08: the number of messages addressed to this device.
pub const MBM_DIAGNOSTICS_SERVER_MESSAGE_COUNT: u16 = 0x0E;
/// Sub-function of 08: the number of messages to which the device sent no reply.
pub const MBM_DIAGNOSTICS_SERVER_NO_RESPONSE_COUNT: u16 = 0x0F;
/// Sub-function of 08: the number of messages to which the device replied with a NAK.
pub const MBM_DIAGNOSTICS_SERVER_NAK_COUNT: u16 = 0x10;
/// Sub-function of 08: the number of messages to which the device replied that it is busy.
pub const MBM_DIAGNOSTICS_SERVER_BUSY_COUNT: u16 = 0x11;
/// Sub-function of 08: the number of messages that character overruns destroyed.
pub const MBM_DIAGNOSTICS_BUS_CHARACTER_OVERRUN_COUNT: u16 = 0x12;
/// Sub-function of 08: clears the counter of character overruns.
pub const MBM_DIAGNOSTICS_CLEAR_OVERRUN_COUNTER: u16 = 0x14;

/// MEI type of 2B: CANopen General Reference (V1.1b3, 6.20).
pub const MBM_MEI_CANOPEN: u8 = 0x0D;
/// MEI type of 2B: Read Device Identification (V1.1b3, 6.21).
pub const MBM_MEI_READ_DEVICE_IDENTIFICATION: u8 = 0x0E;
/// Read device id code: the basic objects, 00 to 02.
pub const MBM_DEVICE_ID_BASIC: u8 = 1;
/// Read device id code: the regular objects, 00 to 7F.
pub const MBM_DEVICE_ID_REGULAR: u8 = 2;
/// Read device id code: all objects, 00 to FF.
pub const MBM_DEVICE_ID_EXTENDED: u8 = 3;
/// Read device id code: one object.
pub const MBM_DEVICE_ID_INDIVIDUAL: u8 = 4;

/// Length rule: the PDU is as long as its frame. On an RTU line silence ends the frame.
pub const MBM_RULE_SILENCE: u8 = 0;
/// Length rule: the PDU always has the same number of bytes.
pub const MBM_RULE_FIXED: u8 = 1;
/// Length rule: a byte of the PDU gives the number of bytes that follow it.
pub const MBM_RULE_COUNTED: u8 = 2;

const _: () = {
    use diagnostics::sub_function::*;
    assert!(MBM_DIAGNOSTICS_RETURN_QUERY_DATA == RETURN_QUERY_DATA);
    assert!(MBM_DIAGNOSTICS_RESTART_COMMUNICATIONS == RESTART_COMMUNICATIONS);
    assert!(MBM_DIAGNOSTICS_RETURN_DIAGNOSTIC_REGISTER == RETURN_DIAGNOSTIC_REGISTER);
    assert!(MBM_DIAGNOSTICS_CHANGE_ASCII_INPUT_DELIMITER == CHANGE_ASCII_INPUT_DELIMITER);
    assert!(MBM_DIAGNOSTICS_FORCE_LISTEN_ONLY == FORCE_LISTEN_ONLY);
    assert!(MBM_DIAGNOSTICS_CLEAR_COUNTERS == CLEAR_COUNTERS);
    assert!(MBM_DIAGNOSTICS_BUS_MESSAGE_COUNT == BUS_MESSAGE_COUNT);
    assert!(MBM_DIAGNOSTICS_BUS_COMMUNICATION_ERROR_COUNT == BUS_COMMUNICATION_ERROR_COUNT);
    assert!(MBM_DIAGNOSTICS_BUS_EXCEPTION_ERROR_COUNT == BUS_EXCEPTION_ERROR_COUNT);
    assert!(MBM_DIAGNOSTICS_SERVER_MESSAGE_COUNT == SERVER_MESSAGE_COUNT);
    assert!(MBM_DIAGNOSTICS_SERVER_NO_RESPONSE_COUNT == SERVER_NO_RESPONSE_COUNT);
    assert!(MBM_DIAGNOSTICS_SERVER_NAK_COUNT == SERVER_NAK_COUNT);
    assert!(MBM_DIAGNOSTICS_SERVER_BUSY_COUNT == SERVER_BUSY_COUNT);
    assert!(MBM_DIAGNOSTICS_BUS_CHARACTER_OVERRUN_COUNT == BUS_CHARACTER_OVERRUN_COUNT);
    assert!(MBM_DIAGNOSTICS_CLEAR_OVERRUN_COUNTER == CLEAR_OVERRUN_COUNTER);
    assert!(MBM_MEI_CANOPEN == identification::MEI_CANOPEN);
    assert!(MBM_MEI_READ_DEVICE_IDENTIFICATION == identification::MEI_READ_DEVICE_IDENTIFICATION);
    assert!(MBM_DEVICE_ID_BASIC == identification::BASIC);
    assert!(MBM_DEVICE_ID_REGULAR == identification::REGULAR);
    assert!(MBM_DEVICE_ID_EXTENDED == identification::EXTENDED);
    assert!(MBM_DEVICE_ID_INDIVIDUAL == identification::INDIVIDUAL);
};

/// The length rule for the PDUs of a function of your own. A length includes the function
/// code. As MBM_INIT, it is MBM_RULE_SILENCE.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct mbm_rule {
    /// MBM_RULE_SILENCE, MBM_RULE_FIXED or MBM_RULE_COUNTED.
    pub kind: u8,
    /// MBM_RULE_FIXED: bytes of the PDU, 1 to 253. MBM_RULE_COUNTED: the position of the
    /// counting byte, 1 to 252 bytes after the function code.
    pub bytes: u8,
    /// MBM_RULE_COUNTED: the number of bytes that follow the counted bytes.
    pub more: u8,
}

/// Declares a function of your own. The standard leaves the codes 65 to 72 and 100 to 110
/// to users: without a declaration their PDUs have any length. Another code that the
/// standard does not define works only with a declaration. A code that the
/// standard defines keeps its meaning, also if you declare it.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct mbm_function {
    /// The function code, 1 to 127.
    pub code: u8,
    /// The length of its requests.
    pub request: mbm_rule,
    /// The length of its responses.
    pub response: mbm_rule,
}

/// Converts a rule to the core's type. `None` if the rule is not valid. (Inlined: a call
/// that passes the result takes more flash than the conversion.)
#[inline(always)]
pub(super) fn rule(rule: mbm_rule) -> Option<Rule> {
    let fits = |most| rule.bytes > 0 && rule.bytes <= most;
    match rule.kind {
        MBM_RULE_SILENCE => Some(Rule::Silence),
        MBM_RULE_FIXED if fits(MAX_PDU as u8) => Some(Rule::Fixed(rule.bytes)),
        MBM_RULE_COUNTED if fits(MAX_PDU as u8 - 1) => Some(Rule::Counted(rule.bytes, rule.more)),
        _ => None,
    }
}

/// The declaration of a function code, if `functions` has one.
///
/// # Errors
/// [`Error::InvalidArgument`] if any item of `functions` is not a valid declaration.
pub(super) fn declared(
    functions: &[mbm_function],
    code: Option<u8>,
) -> Result<Option<Function>, Error> {
    let mut found = None;
    for function in functions {
        let rules = rule(function.request).zip(rule(function.response));
        let (request, response) = match rules {
            Some(rules) if (1..=127).contains(&function.code) => rules,
            _ => return Err(Error::InvalidArgument),
        };
        if found.is_none() && Some(function.code) == code {
            found = Some(Function {
                code: function.code,
                request,
                response,
            });
        }
    }
    Ok(found)
}
