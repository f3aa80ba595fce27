//! The buffers, records and random numbers that a caller supplies to a client.

use super::policy::{again, again_when_busy, Policy};
use super::request::{RequestState, Stage};
use super::units::{find, note, rest, UnitRecord};
use crate::engine::{Frame, Storage};
use crate::error::Status;
use crate::time::{elapsed, timeout_at_most};

/// The storage of a client: the frame buffer of [`Storage`], and more that is optional.
///
/// ```
/// use mbm::client::{ClientStorage, UnitRecord};
///
/// /// How many requests of a unit were not answered.
/// fn unanswered(storage: &impl ClientStorage, unit: u16) -> u32 {
///     let record = storage.units().iter().find(|record| record.unit == unit);
///     record.map_or(0, |record| record.requests - record.replies)
/// }
///
/// /// Begins to count anew.
/// fn clear(storage: &mut impl ClientStorage) {
///     for record in storage.units_mut() {
///         *record = UnitRecord::new(record.unit as u8, record.delay);
///     }
///     // What is not sent yet stays.
///     let (_bytes, _jitter) = (storage.outgoing().len(), storage.random());
/// }
/// ```
pub trait ClientStorage: Storage<Count = u16> {
    /// The bytes of [`ClientStorage::outgoing`] from index `from` to before index `to`. The client
    /// ensures that `from` <= `to` <= length of the buffer.
    // The storage of C does this in another way.
    #[doc(hidden)]
    fn to_send(&mut self, from: u16, to: u16) -> &mut [u8] {
        let bytes = self.outgoing().get_mut(from.into()..to.into());
        bytes.unwrap_or_default()
    }

    /// The transmit buffer of a TCP client; a serial line does not use it.
    fn outgoing(&mut self) -> &mut [u8] {
        &mut []
    }

    /// Records of units that need their own delay or counts.
    fn units(&self) -> &[UnitRecord] {
        &[]
    }

    /// The same records, to be changed.
    fn units_mut(&mut self) -> &mut [UnitRecord] {
        &mut []
    }

    /// Microseconds until the unit may get its next request.
    // The storage of C does this in another way.
    #[doc(hidden)]
    fn rest(&mut self, unit: u8, now: u32) -> u32 {
        rest(self.units_mut(), unit, now)
    }

    /// Records that a request to a unit ended with `status`. `again` is true if the
    /// client will retry it.
    // The storage of C does this in another way.
    #[doc(hidden)]
    fn note(&mut self, unit: u8, status: Status, again: bool, now: u32) {
        note(self.units_mut(), unit, status, again, now);
    }

    /// The response timeout of a unit in milliseconds; 0 for that of the line. The client has
    /// just called [`ClientStorage::rest`] for the unit.
    // The storage of C does this in another way.
    #[doc(hidden)]
    fn unit_timeout_ms(&self, unit: u8) -> u32 {
        find(self.units(), unit).map_or(0, |unit| unit.timeout_ms)
    }

    /// Microseconds to wait before the next retry of a request that ended with `status`;
    /// `None` if the request is not retried.
    // The storage of C does this in another way.
    #[doc(hidden)]
    fn again(&mut self, policy: &Policy, state: &RequestState, status: Status) -> Option<u32> {
        if status.is_exception() {
            return again_when_busy(policy, state, status);
        }
        let unit = find(self.units(), state.unit());
        let limit = unit.map_or(0, |unit| unit.retry_limit);
        again(policy, state, limit, status, || self.random())
    }

    /// A random number for the jitter, a different one at each call.
    fn random(&mut self) -> u32 {
        0
    }
}

/// Only a frame buffer, enough for a client on a serial line. A TCP client needs
/// [`TcpBuffers`], and sends nothing without a buffer of bytes to send.
impl<F: AsRef<[u8]> + AsMut<[u8]>> ClientStorage for Frame<F> {}

/// The buffers of a TCP client: arrays, slices or other containers of bytes.
///
/// ```
/// use mbm::client::TcpBuffers;
///
/// // The bytes received, and the bytes to send, of any frame.
/// let buffers = TcpBuffers::new([0; 260], [0; 260]);
/// ```
#[derive(Clone, Debug, Default)]
pub struct TcpBuffers<F, O> {
    incoming: Frame<F>,
    outgoing: O,
}

impl<F, O> TcpBuffers<F, O> {
    /// Takes a buffer of received bytes, at least 9, and a buffer of bytes to send, at least 12.
    /// 260 bytes hold any frame. Larger ones take more responses from one read, and collect more
    /// requests for one write. At most 65 535 bytes of each are used.
    pub const fn new(incoming: F, outgoing: O) -> Self {
        TcpBuffers {
            incoming: Frame::new(incoming),
            outgoing,
        }
    }
}

impl<F: AsRef<[u8]> + AsMut<[u8]>, O> Storage for TcpBuffers<F, O> {
    type Count = u16;

    fn capacity(&self) -> u16 {
        self.incoming.capacity()
    }

    fn byte(&self, index: u16) -> u8 {
        self.incoming.byte(index)
    }

    fn set_byte(&mut self, index: u16, byte: u8) {
        self.incoming.set_byte(index, byte);
    }

    fn slice(&self, index: u16, count: u16) -> &[u8] {
        self.incoming.slice(index, count)
    }

    fn bytes(&mut self, index: u16, count: u16) -> &mut [u8] {
        self.incoming.bytes(index, count)
    }
}

impl<F, O> ClientStorage for TcpBuffers<F, O>
where
    F: AsRef<[u8]> + AsMut<[u8]>,
    O: AsMut<[u8]>,
{
    fn outgoing(&mut self) -> &mut [u8] {
        let bytes = self.outgoing.as_mut();
        let most = bytes.len().min(u16::MAX.into());
        bytes.get_mut(..most).unwrap_or_default()
    }
}

impl RequestState {
    /// Microseconds until the request is due.
    pub(super) fn remaining_wait(&self, now: u32, storage: &mut impl ClientStorage) -> u32 {
        let wait = match self.wait {
            0 => 0,
            wait => wait.saturating_sub(elapsed(now, self.since)),
        };
        if self.is(Stage::Queued) {
            wait.max(storage.rest(self.unit(), now))
        } else {
            wait
        }
    }

    /// The response timeout in microseconds, if it is `line` on this line.
    pub(super) fn response_timeout(&self, storage: &impl ClientStorage, line: u32) -> u32 {
        let timeout = match self.timeout_ms {
            0 => storage.unit_timeout_ms(self.unit()),
            own => own,
        };
        match timeout {
            0 => line,
            own => timeout_at_most(own),
        }
    }
}
