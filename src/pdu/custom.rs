//! Functions that a user defines, whose lengths only the user knows.

use super::{is_public, EXCEPTION};

/// How long a PDU of a user's function is.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Rule {
    /// So many bytes, with the function code.
    Fixed(u8),
    /// The byte at this offset from the function code counts the bytes behind
    /// it, after which `Counted::1` more follow.
    Counted(u8, u8),
    /// Until the line is silent; only framings that carry a length, or keep
    /// time, can end it.
    Silence,
}

/// A function that a user defines: its code and the lengths of its PDUs.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Function {
    /// The function code, 1 to 127; what the standard says of its own functions
    /// stands.
    pub code: u8,
    /// The request.
    pub request: Rule,
    /// The response.
    pub response: Rule,
}

/// True for the codes that the standard leaves to users (clause 5).
pub const fn is_user_defined(function: u8) -> bool {
    matches!(function, 65..=72 | 100..=110)
}

/// True for a code that a user may give a meaning to: any that no function of
/// the standard has.
pub(super) const fn is_free(function: u8) -> bool {
    function != 0 && function & EXCEPTION == 0 && !is_public(function)
}

/// What a user said of a function code.
pub(super) fn find(functions: &[Function], code: u8) -> Option<&Function> {
    functions.iter().find(|function| function.code == code)
}
