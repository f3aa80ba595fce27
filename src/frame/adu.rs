//! What every framing carries.

/// What a frame carries.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Adu<'a> {
    /// The transaction identifier of a TCP frame; 0 in others.
    pub transaction: u16,
    /// The unit that a request is for, or a response comes from.
    pub unit: u8,
    /// Function code and data.
    pub pdu: &'a [u8],
}
