//! Accepts a reply on a serial line that deviates from the standard: see
//! `src/client/request/deviation.rs`.
//!
//! The search does not take such a reply. The reply ends the request once the line is silent, so
//! that a right reply that follows it wins. If its unit owes replies to earlier requests, it may be a
//! late one: then it is held, as a right one is.
//!
//! Only [`Serial::set_lenient`] names this module. A program that does not call that function
//! contains none of this code.

use super::request::ClientRequest;
use super::storage::ClientStorage;
use super::transaction::{ClientTransaction, Serial};
use crate::engine::{Extension, Finding, Moment};
use crate::frame::rtu;
use crate::port::Port;

impl<P: Port, S: ClientStorage, J: ClientRequest> Serial<P, S, J> {
    /// Sets whether a reply is accepted that has more data than was requested, of which the first
    /// count, or that repeats another address or value than a write. For RTU frames: ASCII frames stay
    /// as strict as they are.
    pub fn set_lenient(&mut self, is_lenient: bool) {
        let lenient = match is_lenient {
            true => Some(extend as Extension<P, S, ClientTransaction<P, S, J>>),
            false => None,
        };
        self.set_lenience(lenient);
    }
}

/// See [`Extension`].
fn extend<P: Port, S: ClientStorage, J: ClientRequest>(
    engine: &mut Serial<P, S, J>,
    moment: Moment,
) -> bool {
    moment == Moment::Missed && accept_deviating(engine)
}

/// Makes the deviating reply that ends with the last byte the result, if there is one.
fn accept_deviating<P: Port, S: ClientStorage, J: ClientRequest>(
    engine: &mut Serial<P, S, J>,
) -> bool {
    if !engine.awaits_reply() {
        return false;
    }
    let Some((length, counts)) = find(engine) else {
        return false;
    };
    if engine.run_length < length {
        // By chance, the CRC was right within it.
        engine.foreign_frames = engine.foreign_frames.wrapping_sub(1);
    }
    let front = engine.end - length;
    engine.seen = Finding::OK;
    engine.exception = 0;
    engine.is_early = true;
    engine.content = counts;
    engine.storage.move_down(front, counts);
    engine.begin_frame();
    if engine.take_response() {
        // The bytes after it are searched on.
        engine.end = counts;
    }
    true
}

/// The length of the frame of a deviating reply that ends with the last byte, and how many bytes of
/// unit and PDU count.
fn find<P: Port, S: ClientStorage, J: ClientRequest>(
    engine: &mut Serial<P, S, J>,
) -> Option<(u16, u16)> {
    let (unit, function) = (engine.unit, engine.function);
    let have = engine.end - engine.content;
    let mut length = have.min(rtu::MAX_FRAME as u16);
    while length >= rtu::MIN_FRAME as u16 {
        let frame = engine.storage.bytes(engine.end - length, length);
        if frame.starts_with(&[unit, function]) && rtu::is_frame(frame) {
            let pdu = frame.get_mut(rtu::PDU..usize::from(length - u16::from(rtu::CRC)))?;
            let state = engine.request.client_request.as_ref()?.state();
            let counts = state.counted_length(pdu);
            if counts > 0 {
                return Some((length, u16::from(counts) + rtu::PDU as u16));
            }
        }
        length -= 1;
    }
    None
}
