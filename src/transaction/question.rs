//! What a transaction asks: a request, and how its response is known.

use crate::error::Status;
use crate::pdu::query::Query;
use crate::pdu::reply;
use core::num::NonZeroU8;

/// A request that is put to a unit, and what answers it.
pub trait Question {
    /// What is asked before anybody asks.
    const NONE: Self;

    /// Whether the transaction itself may ask again.
    const REPEATS: bool;

    /// The function code.
    fn function(&self) -> u8;

    /// Length of the request PDU.
    fn length(&self) -> u8;

    /// Writes the request PDU into `pdu`, which has [`Question::length`] bytes;
    /// `words` are the caller's.
    fn emit(&self, pdu: &mut [u8], words: &[u16]);

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

impl Question for Query {
    const NONE: Query = Query::NONE;
    const REPEATS: bool = true;

    fn function(&self) -> u8 {
        self.function()
    }

    fn length(&self) -> u8 {
        self.length()
    }

    fn emit(&self, pdu: &mut [u8], words: &[u16]) {
        self.emit(pdu, words);
    }

    fn may_be_broadcast(&self) -> bool {
        !self.is_read()
    }

    fn agrees(&self, pdu: &[u8]) -> bool {
        self.agrees(pdu)
    }

    fn expected(&self, pdu: &[u8]) -> Option<NonZeroU8> {
        reply::expected(self, pdu)
    }

    fn judge(&mut self, pdu: &[u8]) -> Status {
        reply::judge(self, pdu)
    }
}
