//! What a receiver wants of a framing: to find the one frame that answers, in
//! whatever has arrived.

use crate::error::Status;
use core::num::NonZeroU8;

/// What was seen on the way to a reply, the more telling the greater. The low
/// digit is that of the status it becomes.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Hash, Debug)]
pub struct Seen(u8);

impl Seen {
    /// No frame.
    pub const NOTHING: Seen = Seen(0x02);
    /// A frame of another unit.
    pub const OTHER_UNIT: Seen = Seen(0x10);
    /// A frame of our unit with another function.
    pub const OTHER_FUNCTION: Seen = Seen(0x21);
    /// A frame of our unit and function that is not the reply.
    pub const MALFORMED: Seen = Seen(0x35);
    /// A complete frame of our unit and function with a wrong CRC.
    pub const BAD_CRC: Seen = Seen(0x43);
    /// The reply has begun, but the buffer cannot hold it.
    pub const TOO_LONG: Seen = Seen(0x59);

    /// The status of a request for which nothing better was seen.
    pub const fn status(self) -> Status {
        Status::from_code(0xE0 | (self.0 & 0x0F))
    }
}

const _: () = {
    assert!(Seen::NOTHING.status().code() == Status::RESPONSE_TIMED_OUT.code());
    assert!(Seen::OTHER_UNIT.status().code() == Status::INVALID_SLAVE_ID.code());
    assert!(Seen::OTHER_FUNCTION.status().code() == Status::INVALID_FUNCTION.code());
    assert!(Seen::MALFORMED.status().code() == Status::MALFORMED_REPLY.code());
    assert!(Seen::BAD_CRC.status().code() == Status::INVALID_CRC.code());
    assert!(Seen::TOO_LONG.status().code() == Status::BUFFER_TOO_SMALL.code());
};

/// What a frame is searched for.
pub trait Wanted {
    /// The unit that sends it.
    fn unit(&self) -> u8;

    /// The function code of its PDU, for which that with the highest bit set
    /// may stand.
    fn function(&self) -> u8;

    /// The length of the PDU of a frame that begins with these bytes; `None`
    /// for a frame that is not waited for.
    fn length(&self, frame: &[u8]) -> Option<NonZeroU8>;

    /// What a frame of such a PDU is, from the unit on and with two bytes behind
    /// the PDU.
    fn judge(&mut self, frame: &[u8]) -> Verdict;

    /// Says that more arrived, or, by silence or by the framing, that nothing
    /// more belongs to the frame.
    fn ends(&mut self, _ended: bool) {}

    /// Bytes in front of the buffer that can be freed for a frame that the buffer
    /// is too small for.
    fn reserve(&self) -> usize {
        0
    }
}

/// Where the frame stands that was found.
#[derive(Clone, Copy)]
pub struct Found {
    /// Where its content starts: unit, PDU and two bytes more.
    pub start: u16,
    /// Bytes of the content.
    pub content: u16,
    /// Bytes of the frame on the wire, from the start of the content on.
    pub length: u16,
}

/// What a frame is that looked like the one that is wanted.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Verdict {
    /// The one.
    Right,
    /// One of our own, of which nothing more is to be said.
    Own,
    /// Not the one.
    Wrong,
}

/// Where in the caller's buffer the bytes to send stand, then those that
/// arrived, and how a reply is found among these.
pub trait Search: Sized {
    /// Over nothing.
    const EMPTY: Self;

    /// Bytes of the frame of a PDU of `length` bytes.
    fn frame_length(length: u8) -> u16;

    /// Stands over `count` bytes to be sent, which the buffer holds.
    fn hold(&mut self, count: u16);

    /// Writes the frame of the PDU that `pdu` writes, `length` bytes long; false
    /// if `buffer` cannot hold it.
    fn write(
        &self,
        buffer: &mut [u8],
        unit: u8,
        length: usize,
        pdu: impl FnOnce(&mut [u8]),
    ) -> bool;

    /// The part of `buffer` to receive into.
    fn room<'a>(&mut self, buffer: &'a mut [u8]) -> Option<&'a mut [u8]>;

    /// Stands over nothing, of which nothing is left to be skimmed.
    fn clear(&mut self);

    /// Says that `count` bytes more are in the buffer, as in [`Search::room`].
    fn arrived(&mut self, count: u16);

    /// Says that `count` bytes more were sent.
    fn sent(&mut self, count: u16);

    /// Has the next search look behind what is not complete.
    fn skim(&mut self);

    /// True if nothing arrived since [`Search::skim`].
    fn is_skimmed(&self) -> bool;

    /// The bytes that are yet to be sent.
    fn unsent<'a>(&self, buffer: &'a [u8]) -> Option<&'a [u8]>;

    /// The bytes from `offset` into the frame that was found.
    fn behind<'a>(&self, buffer: &'a [u8], offset: usize) -> Option<&'a [u8]>;

    /// The most telling thing seen so far.
    fn seen(&self) -> Seen;

    /// Frames with a right check that were passed over.
    fn foreign_frames(&self) -> u8;

    /// True if bytes were passed over that were no frame.
    fn has_passed_noise(&self) -> bool;

    /// True if the bytes that arrived fill a buffer of `length` bytes.
    fn fills(&self, length: usize) -> bool;

    /// True if the bytes at the end begin a frame that is not complete.
    fn has_begun(&self) -> bool;

    /// Says where the frame stands that was found, and stands over the bytes that
    /// arrived after it, with nothing seen so far. The caller moves them to the
    /// front of the buffer.
    fn keep(&mut self) -> Found;

    /// Looks for a frame with a right check that is what is `wanted`.
    fn search(&mut self, buffer: &mut [u8], wanted: &mut impl Wanted) -> bool;
}
