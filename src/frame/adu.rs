//! The content of a frame, which is the same in every framing.

/// The content of a frame: unit and PDU.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Adu<'a> {
    /// The transaction identifier of a TCP frame; 0 in other framings.
    pub transaction: u16,
    /// The unit id: of the unit that receives a request, or that sent a response.
    pub unit: u8,
    /// The PDU: function code and data.
    pub pdu: &'a [u8],
}
