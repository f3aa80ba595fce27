//! A length that the first bytes of a PDU tell must be that of the whole.

use mbm::pdu::length::Length;

/// Holds what each beginning of a right PDU tells against the PDU itself.
pub fn agree(pdu: &[u8], tells: impl Fn(&[u8]) -> Length) {
    for end in 0..=pdu.len() {
        match tells(&pdu[..end]) {
            Length::Exactly(length) => assert_eq!(length, pdu.len()),
            Length::AtLeast(length) => assert!(end < length && length <= pdu.len()),
            Length::Silence | Length::Unknown => {}
        }
    }
}
