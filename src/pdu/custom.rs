//! User-defined functions. The user declares the lengths of their PDUs.

use super::{is_public, EXCEPTION};

/// The length of a PDU of a user-defined function.
///
/// ```
/// use mbm::pdu::custom::{Function, Rule};
/// use mbm::pdu::length::{response, Length};
///
/// // The byte after the function code counts those after it, and one byte more follows.
/// let rule = Rule::Counted(1, 1);
/// let function = Function { code: 0x41, request: Rule::Fixed(2), response: rule };
/// assert_eq!(response(&[0x41, 4], &[function]), Length::Exactly(7));
/// ```
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Rule {
    /// This number of bytes, including the function code.
    Fixed(u8),
    /// The byte at offset `.0` from the function code is a byte count. After the bytes that
    /// it counts, `.1` more bytes follow.
    Counted(u8, u8),
    /// Up to the end of the frame: a silence in RTU, the end character in ASCII, the length in
    /// the header in TCP.
    Silence,
}

/// A user-defined function: its code and the lengths of its PDUs.
///
/// ```
/// use mbm::pdu::custom::{Function, Rule};
/// use mbm::pdu::request::Request;
///
/// let function = Function { code: 0x41, request: Rule::Fixed(2), response: Rule::Silence };
/// let request = Request::parse_with(&[0x41, 7], &[function])?;
/// assert_eq!(request, Request::Custom { function: 0x41, data: &[7] });
/// // One byte too many.
/// assert!(Request::parse_with(&[0x41, 7, 7], &[function]).is_err());
/// # Ok::<(), mbm::Error>(())
/// ```
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Function {
    /// The function code, 1 to 127. A code of the standard keeps the meaning of the standard.
    pub code: u8,
    /// Length of the request.
    pub request: Rule,
    /// Length of the response.
    pub response: Rule,
}

/// True for the function codes that the standard leaves to users (clause 5).
///
/// ```
/// assert!(mbm::pdu::custom::is_user_defined(65));
/// assert!(!mbm::pdu::custom::is_user_defined(3));
/// ```
pub const fn is_user_defined(function: u8) -> bool {
    matches!(function, 65..=72 | 100..=110)
}

/// True for a function code that a user may define: 1 to 127, except the codes of the
/// standard.
pub(super) const fn is_free(function: u8) -> bool {
    function != 0 && function & EXCEPTION == 0 && !is_public(function)
}

/// The declaration of a function code.
pub(super) fn find(functions: &[Function], code: u8) -> Option<&Function> {
    functions.iter().find(|function| function.code == code)
}
