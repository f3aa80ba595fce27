//! The length that follows from the first bytes of a PDU must be that of the whole PDU.

use mbm::pdu::length::Length;

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
