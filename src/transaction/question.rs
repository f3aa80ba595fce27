//! What a transaction asks: a request, and how its response is known.

use crate::error::Status;
use core::num::NonZeroU8;

/// A request that is put to a unit, and what answers it.
pub trait Question {
    /// What is asked before anybody asks.
    const NONE: Self;

    /// The function code.
    fn function(&self) -> u8;

    /// Length of the request PDU.
    fn length(&self) -> u8;

    /// Writes the request PDU into `pdu`, which has [`Question::length`] bytes.
    fn emit(&self, pdu: &mut [u8]);

    /// Whether it may be sent to all units at once.
    fn may_be_broadcast(&self) -> bool;

    /// Whether a unit responds to it at all.
    fn is_answered(&self) -> bool {
        true
    }

    /// True if `pdu`, complete or not, agrees with the head of the request.
    fn agrees(&self, pdu: &[u8]) -> bool;

    /// The length of the response that begins with the bytes of `pdu`, or the
    /// least length while they do not tell; `None` if no response begins so.
    fn expected(&self, pdu: &[u8]) -> Option<NonZeroU8>;

    /// What a `pdu` of the [`Question::expected`] length says, with two bytes
    /// behind it: success, an exception of the remote device, or
    /// [`Status::MALFORMED_REPLY`].
    fn judge(&mut self, pdu: &[u8]) -> Status;

    /// See [`crate::frame::Wanted::ends`].
    fn ends(&mut self, _ended: bool) {}
}
