//! What the engine needs to know about a request and its reply.

use super::{Engine, Storage};
use crate::port::Port;

/// A request: how its frame is written, and how its reply is recognised. The functions with
/// an `engine` argument take the engine that holds the request.
pub trait Transaction<P, S: Storage>: Sized {
    /// No request.
    const NONE: Self;

    /// True for a request of a master: it always determines the length of its reply, and the engine
    /// repeats it as its settings say. False for one of a client, whose queue repeats it.
    const IS_OF_MASTER: bool;

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
    fn has_unique_reply(&self) -> bool {
        false
    }

    /// Microseconds that the reply may take, and that the request may wait for the line.
    fn response_timeout(engine: &Engine<P, S, Self>) -> u32 {
        engine.settings.response_timeout.get()
    }

    /// True if a frame buffer of `space` bytes holds the frame of the request.
    fn fits(&self, space: S::Count) -> bool;

    /// Writes the frame of the request into the frame buffer.
    fn write(engine: &mut Engine<P, S, Self>);

    /// Length of the RTU frame of a reply that is no exception; 0 if the request does not
    /// determine it.
    fn reply_length(&self) -> S::Count;

    /// True if the frame of `length` bytes at `front`, whose unit, function code and CRC are
    /// right and which is no exception, answers the request.
    fn is_reply(engine: &Engine<P, S, Self>, front: S::Count, length: S::Count) -> bool;

    /// True if the frame at `front`, which is as long as the request and has its unit and
    /// function code, begins as the request does.
    fn is_echo(engine: &Engine<P, S, Self>, front: S::Count) -> bool;

    /// For a reply whose length the request does not determine: the length of the reply's frame
    /// that ends with the last received byte, with a right CRC; 0 if there is none. `is_silent`
    /// is true if the line has been silent since.
    fn find_ending_reply(_engine: &mut Engine<P, S, Self>, _is_silent: bool) -> S::Count
    where
        P: Port,
    {
        0u8.into()
    }

    /// Searches the `received` bytes that the port has written to the frame buffer from `first`
    /// on. True if the request ends.
    fn search(engine: &mut Engine<P, S, Self>, first: S::Count, received: S::Count) -> bool
    where
        P: Port,
    {
        engine.search(first, received)
    }
}
