//! What the engine needs to know about a request and its reply.

use super::{Engine, Storage};
use crate::frame::rtu;

/// What a received frame is to the pending request.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Match {
    /// The frame is the reply.
    Reply,
    /// The frame is the echo of the request.
    Echo,
    /// The frame is neither.
    Unrelated,
}

/// A request: how its frame is written, and how its reply is recognised. The functions with
/// an `engine` argument take the engine that holds the request.
pub trait RequestSpec<P, S: Storage>: Sized {
    /// No request.
    const NONE: Self;

    /// True if the request determines the length of its reply, and the engine repeats the
    /// request as its settings say.
    const HAS_FIXED_REPLY: bool;

    /// The function code.
    fn function(&self) -> u8;

    /// True if the request may be broadcast.
    fn may_be_broadcast(&self) -> bool;

    /// False if units do not respond to the request.
    fn is_answered(&self) -> bool {
        true
    }

    /// True if the reply repeats data that are in no other request, so that no late reply can
    /// be taken for it.
    #[inline(always)]
    fn has_unique_reply(&self) -> bool {
        false
    }

    /// Microseconds that the reply may take, and that the request may wait for the line.
    #[inline(always)]
    fn response_timeout(engine: &mut Engine<P, S, Self>) -> u32 {
        engine.settings.response_timeout
    }

    /// True if a frame buffer of `space` bytes holds the frame of the request.
    fn fits(&self, space: S::Count) -> bool;

    /// Writes the frame of the request into the frame buffer.
    fn write(engine: &mut Engine<P, S, Self>);

    /// Length of the frame of a reply that is no exception; 0 if it is not known yet, or
    /// greater than the frame buffer.
    fn reply_length(&self, space: S::Count) -> S::Count;

    /// The length of the frame that begins with the `have` bytes at `front`. These are at least
    /// the unit of the request and one more byte. While they do not determine the length, the
    /// least possible length; 0 if no expected frame begins with them.
    fn expected_length(
        engine: &mut Engine<P, S, Self>,
        front: S::Count,
        have: S::Count,
    ) -> S::Count;

    /// Compares the frame at `front`, whose CRC is right, with the request. Its unit and PDU
    /// have `content` bytes. Stores the exception code.
    fn validate(engine: &mut Engine<P, S, Self>, front: S::Count, content: S::Count) -> Match;

    /// Searches the received bytes for the reply, and moves it to the front of the buffer.
    /// False if it has not arrived yet.
    #[inline(always)]
    fn find_reply(engine: &mut Engine<P, S, Self>) -> bool {
        engine.find_rtu_reply::<false>()
    }

    /// As [`RequestSpec::find_reply`], once the line is silent: also searches after an incomplete
    /// candidate.
    #[inline(always)]
    fn find_reply_in_silence(engine: &mut Engine<P, S, Self>) -> bool {
        engine.resync(1u8.into())
    }

    /// Skips the byte at `front`, but keeps it if it may belong to a deviating reply (see
    /// `lenient`). Returns the index of the next byte.
    #[inline(always)]
    fn skip_or_keep_byte(engine: &mut Engine<P, S, Self>, front: S::Count) -> S::Count {
        engine.skip_byte(front);
        front + 1u8.into()
    }

    /// Notes the frame at `front`, which does not answer the request, as a deviating reply.
    #[inline(always)]
    fn note_deviating(_engine: &mut Engine<P, S, Self>, _front: S::Count) {}

    /// Drops the bytes that were kept.
    #[inline(always)]
    fn drop_kept(_engine: &mut Engine<P, S, Self>) {}

    /// Accepts the deviating reply as the answer. False if there is none.
    #[inline(always)]
    fn accept_deviating(_engine: &mut Engine<P, S, Self>) -> bool {
        false
    }

    /// How many bytes of unit and PDU a frame of `length` bytes on the wire carries.
    #[inline(always)]
    fn content(&self, length: S::Count) -> S::Count {
        length - rtu::CRC.into()
    }
}
