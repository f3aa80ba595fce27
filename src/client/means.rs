//! What the caller lends to a client.

use super::policy::{again, Policy};
use super::units::{note, rest, Unit};
use crate::engine::{Frame, Storage};
use crate::error::Status;

/// What the caller lends to a client, besides the frame buffer.
pub trait Means: Storage<Count = u16> {
    /// The bytes between two places of [`Means::outgoing`], of which the first is not
    /// behind the second and the second not behind the end.
    fn to_send(&mut self, from: u16, to: u16) -> &mut [u8] {
        let bytes = self.outgoing().get_mut(from.into()..to.into());
        bytes.unwrap_or_default()
    }

    /// What TCP requests are gathered in; unused on a serial line.
    fn outgoing(&mut self) -> &mut [u8] {
        &mut []
    }

    /// A record for each unit that is to be treated in its own way.
    fn units(&mut self) -> &mut [Unit] {
        &mut []
    }

    /// How much longer a unit rests, in microseconds.
    fn rest(&mut self, unit: u8, now: u32) -> u32 {
        rest(self.units(), unit, now)
    }

    /// Takes note of a request to a unit that ended, or is to be asked `again`.
    fn note(&mut self, unit: u8, status: Status, again: bool, now: u32) {
        note(self.units(), unit, status, again, now);
    }

    /// How long a request that ended with `status`, and was asked again `retries`
    /// times, waits to be asked again; `None` if it is not.
    fn again(&mut self, policy: &Policy, retries: u8, status: Status) -> Option<u32> {
        again(policy, retries, status, || self.random())
    }

    /// Any number, another each time; for jitter.
    fn random(&mut self) -> u32 {
        0
    }
}

/// A client's frame buffer alone; on TCP, which has an outgoing buffer, it sends nothing.
impl<F: AsRef<[u8]> + AsMut<[u8]>> Means for Frame<F> {}
