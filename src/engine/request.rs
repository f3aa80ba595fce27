//! What the engine needs to know of a request and its reply.

use super::{Engine, Storage};
use crate::frame::rtu;

/// What a frame is that begins as the reply does.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Verdict {
    /// The reply.
    Right,
    /// The request itself.
    Echo,
    /// Neither.
    Wrong,
}

/// A request, how it travels, and how its reply is known. The functions that take an
/// engine take the one that the request is in.
pub trait Request<P, S: Storage>: Sized {
    /// No request.
    const NONE: Self;

    /// The length of the reply is known as soon as the request is sent, and the engine
    /// repeats the request as its settings say.
    const IS_PLAIN: bool;

    /// The function code.
    fn function(&self) -> u8;

    /// True if the request may be sent to all units at once.
    fn may_be_broadcast(&self) -> bool;

    /// False if no unit responds to the request.
    fn is_answered(&self) -> bool {
        true
    }

    /// True if a frame buffer of `room` bytes holds the frame of the request.
    fn fits(&self, room: S::Count) -> bool;

    /// Writes the frame of the request into the frame buffer.
    fn write(engine: &mut Engine<P, S, Self>);

    /// Bytes of the frame of a reply that is no exception; 0 if that is not known yet, or
    /// more than the frame buffer holds.
    fn reply_length(&self, room: S::Count) -> S::Count;

    /// The length of the frame that begins with the `have` bytes at `front`, at least the
    /// unit of the request and one byte more; or the least length while they do not tell;
    /// 0 if no frame that is waited for begins so.
    fn wanted(engine: &mut Engine<P, S, Self>, front: S::Count, have: S::Count) -> S::Count;

    /// Says what the frame at `front` is, whose CRC is right, and whose unit and PDU have
    /// `content` bytes. Keeps the exception code.
    fn judge(engine: &mut Engine<P, S, Self>, front: S::Count, content: S::Count) -> Verdict;

    /// Looks for the reply among what has arrived, and moves it to the front; false
    /// if it is not there yet.
    #[inline(always)]
    fn search(engine: &mut Engine<P, S, Self>) -> bool {
        engine.search_rtu::<false>()
    }

    /// As [`Request::search`], once the line is silent: also behind a frame that has begun
    /// and is not complete.
    #[inline(always)]
    fn search_silent(engine: &mut Engine<P, S, Self>) -> bool {
        engine.skim(1u8.into())
    }

    /// Passes over the byte at `front`, but keeps it if it may belong to a deviating reply
    /// (see `lenient`). Returns where the next byte stands.
    #[inline(always)]
    fn pass_and_keep(engine: &mut Engine<P, S, Self>, front: S::Count) -> S::Count {
        engine.pass(front);
        front + 1u8.into()
    }

    /// Notes the frame at `front`, which does not answer the request, as a deviating reply.
    #[inline(always)]
    fn note_deviating(_engine: &mut Engine<P, S, Self>, _front: S::Count) {}

    /// Drops the bytes that were kept.
    #[inline(always)]
    fn drop_kept(_engine: &mut Engine<P, S, Self>) {}

    /// Has a deviating reply be the answer; false if there was none.
    #[inline(always)]
    fn take_deviating(_engine: &mut Engine<P, S, Self>) -> bool {
        false
    }

    /// Bytes of unit and PDU in a frame of `length` bytes on the wire.
    #[inline(always)]
    fn content(&self, length: S::Count) -> S::Count {
        length - rtu::CRC.into()
    }
}
