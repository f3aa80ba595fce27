//! The length that follows from the first bytes of a PDU must be that of the whole PDU.

use mbm::pdu::custom::{Function, Rule};
use mbm::pdu::length::Length;

/// Declarations of functions of users: one with a rule for requests, and any function code, of any
/// length.
pub const USERS: [Function; 1] = [Function {
    code: 0x5A,
    request: Rule::Counted(1, 0),
    response: Rule::Silence,
}];

pub fn any_function() -> Vec<Function> {
    let declare = |code| Function {
        code,
        request: Rule::Silence,
        response: Rule::Silence,
    };
    (0..=255).map(declare).collect()
}

/// Checks that a length that is known does not change with more bytes.
pub fn stays(bytes: &[u8], length_of: impl Fn(&[u8]) -> Length) {
    let mut known = None;
    for end in 0..=bytes.len() {
        match (known, length_of(&bytes[..end])) {
            (Some(known), length) => assert_eq!(known, length),
            (None, Length::AtLeast(least)) => assert!(least > end),
            (None, length) => known = Some(length),
        }
    }
}

/// Checks the length that follows from each prefix of a valid PDU.
pub fn agree(pdu: &[u8], length_of: impl Fn(&[u8]) -> Length) {
    for end in 0..=pdu.len() {
        match length_of(&pdu[..end]) {
            Length::Exactly(length) => assert_eq!(length, pdu.len()),
            Length::AtLeast(length) => assert!(end < length && length <= pdu.len()),
            Length::Silence | Length::Unknown => {}
        }
    }
}
