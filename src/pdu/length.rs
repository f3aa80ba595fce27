//! The length of a PDU, derived from its first bytes.

use super::custom::{find, is_free, is_user_defined, Function, Rule};
use super::diagnostics::sub_function::RETURN_QUERY_DATA;
use super::identification::MEI_READ_DEVICE_IDENTIFICATION;
use super::{functions, EXCEPTION};
use crate::error::Error;

/// The length of a PDU or frame.
///
/// ```
/// use mbm::pdu::length::{request, Length};
///
/// // The byte count of 10 is the sixth byte.
/// assert_eq!(request(&[0x10, 0, 107], &[]), Length::AtLeast(6));
/// assert_eq!(request(&[0x10, 0, 107, 0, 2, 4], &[]), Length::Exactly(10));
/// assert_eq!(request(&[0x65], &[]), Length::Unknown);
/// ```
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Length {
    /// This number of bytes. It may be greater than [`MAX_PDU`](super::MAX_PDU) if the
    /// first bytes are wrong; there is no such PDU.
    Exactly(usize),
    /// At least this number of bytes. When that many have arrived, more may be known.
    AtLeast(usize),
    /// Only the end of the frame determines the length: a silence, an end character, or the
    /// length in a header.
    Silence,
    /// The function is unknown.
    Unknown,
}

/// The length of a PDU whose byte at `offset` is a byte count, with `more` bytes after the
/// counted ones.
fn counted_length(pdu: &[u8], offset: usize, more: usize) -> Length {
    match pdu.get(offset) {
        Some(count) => Length::Exactly(offset + 1 + usize::from(*count) + more),
        None => Length::AtLeast(offset + 1),
    }
}

/// The length of a PDU of a user-defined function.
pub(super) fn by_rule(pdu: &[u8], rule: Rule) -> Length {
    match rule {
        Rule::Fixed(length) => Length::Exactly(usize::from(length)),
        Rule::Counted(offset, more) => counted_length(pdu, usize::from(offset), usize::from(more)),
        Rule::Silence => Length::Silence,
    }
}

/// The length of a PDU of 08: one word of data, except for Return Query Data.
fn diagnostics(pdu: &[u8]) -> Length {
    match pdu.get(1..3) {
        None => Length::AtLeast(3),
        Some(sub_function) if sub_function == RETURN_QUERY_DATA.to_be_bytes() => Length::Silence,
        Some(_) => Length::Exactly(5),
    }
}

/// The length of the request PDU that begins with these bytes.
///
/// ```
/// use mbm::pdu::length::{request, Length};
///
/// assert_eq!(request(&[3], &[]), Length::Exactly(5));
/// ```
pub fn request(pdu: &[u8], functions: &[Function]) -> Length {
    let Some(&code) = pdu.first() else {
        return Length::AtLeast(1);
    };
    match code {
        functions::DIAGNOSTICS => diagnostics(pdu),
        functions::ENCAPSULATED_INTERFACE_TRANSPORT => match pdu.get(1) {
            None => Length::AtLeast(2),
            Some(&MEI_READ_DEVICE_IDENTIFICATION) => Length::Exactly(4),
            Some(_) => Length::Silence,
        },
        code => {
            let declared = || find(functions, code).map(|function| function.request);
            by_table(pdu, functions::request(code).or_else(declared))
        }
    }
}

/// The length of the response PDU that begins with these bytes. For Report Server ID, it is
/// the length by its byte count. The PDU may be longer, because in some devices the byte count
/// covers only the id, and more bytes follow.
///
/// ```
/// use mbm::pdu::length::{response, Length};
///
/// assert_eq!(response(&[3], &[]), Length::AtLeast(2));
/// assert_eq!(response(&[3, 4], &[]), Length::Exactly(6));
/// ```
pub fn response(pdu: &[u8], functions: &[Function]) -> Length {
    let Some(&code) = pdu.first() else {
        return Length::AtLeast(1);
    };
    match code {
        functions::DIAGNOSTICS => diagnostics(pdu),
        functions::READ_FIFO_QUEUE => match pdu.get(1..3) {
            Some([high, low]) => {
                let count = u16::from_be_bytes([*high, *low]);
                Length::Exactly(usize::from(count.saturating_add(3)))
            }
            _ => Length::AtLeast(3),
        },
        functions::ENCAPSULATED_INTERFACE_TRANSPORT => match pdu.get(1) {
            None => Length::AtLeast(2),
            Some(&MEI_READ_DEVICE_IDENTIFICATION) => objects(pdu),
            Some(_) => Length::Silence,
        },
        code if code & EXCEPTION != 0 => Length::Exactly(2),
        code => {
            let declared = || find(functions, code).map(|function| function.response);
            by_table(pdu, functions::response(code).or_else(declared))
        }
    }
}

/// The length of a PDU by the rule of its function, if there is one.
fn by_table(pdu: &[u8], rule: Option<Rule>) -> Length {
    rule.map_or(Length::Unknown, |rule| by_rule(pdu, rule))
}

/// The length of a device identification, in which each object has its own length.
pub(crate) fn objects(pdu: &[u8]) -> Length {
    let mut end = 7;
    let Some(count) = pdu.get(6) else {
        return Length::AtLeast(end);
    };
    for _ in 0..*count {
        match pdu.get(end + 1) {
            Some(length) => end += 2 + usize::from(*length),
            None => return Length::AtLeast(end + 2),
        }
    }
    Length::Exactly(end)
}

/// Checks the length of a PDU of a user-defined function. Without a `rule`, the function code
/// must be one that the standard leaves to users, and any length is right.
pub(super) fn check(pdu: &[u8], function: u8, rule: Option<Rule>) -> Result<(), Error> {
    if !is_free(function) {
        return Err(Error::IllegalFunction);
    }
    let has_right_length = match rule.map(|rule| by_rule(pdu, rule)) {
        None if !is_user_defined(function) => return Err(Error::IllegalFunction),
        None | Some(Length::Silence) => true,
        Some(Length::Exactly(length)) => length == pdu.len(),
        Some(_) => false,
    };
    if has_right_length {
        Ok(())
    } else {
        Err(Error::IllegalDataValue)
    }
}
