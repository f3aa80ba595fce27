//! What is kept for each unit, in storage that the caller lends.

use crate::error::Status;
use crate::time::elapsed;
use crate::transaction::Storage;

/// One unit: how it is to be treated, and how it behaves. The counts wrap at
/// 2^32.
#[repr(C)]
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Unit {
    /// Requests that ended, retries apart.
    pub requests: u32,
    /// Of these, those that were answered, exceptions included.
    pub replies: u32,
    /// Of the answers, those that were exceptions.
    pub exceptions: u32,
    /// Requests that were asked again.
    pub retries: u32,
    /// Rest for this unit between the end of a request and the next, in
    /// microseconds.
    pub delay: u32,
    /// When the last request to it ended.
    pub(super) last: u32,
    /// Which unit this is.
    pub unit: u8,
    /// How the last request ended.
    pub status: u8,
    /// It may still need its rest.
    pub(super) tired: bool,
}

impl Unit {
    /// A unit that was not asked yet, with a rest of so many microseconds.
    pub const fn new(unit: u8, delay: u32) -> Unit {
        Unit {
            requests: 0,
            replies: 0,
            exceptions: 0,
            retries: 0,
            delay,
            last: 0,
            unit,
            status: 0,
            tired: false,
        }
    }

    /// How much longer the unit rests.
    pub(super) fn rest(&mut self, now: u32) -> u32 {
        let rest = self.delay.saturating_sub(elapsed(now, self.last));
        self.tired &= rest > 0;
        if self.tired {
            rest
        } else {
            0
        }
    }

    /// Takes note of a request that ended, or is to be asked again.
    pub(super) fn note(&mut self, status: Status, again: bool, now: u32) {
        self.last = now;
        self.tired = true;
        self.status = status.code();
        if again {
            self.retries = self.retries.wrapping_add(1);
            return;
        }
        self.requests = self.requests.wrapping_add(1);
        if !status.is_failure() {
            self.replies = self.replies.wrapping_add(1);
        }
        if status.is_exception() {
            self.exceptions = self.exceptions.wrapping_add(1);
        }
    }
}

/// The record of a unit, if the caller lent one.
pub(super) fn find(units: &mut [Unit], unit: u8) -> Option<&mut Unit> {
    units.iter_mut().find(|record| record.unit == unit)
}

/// What the caller lends to a client, besides the frame buffer.
pub trait Means: Storage {
    /// What TCP requests are gathered in; unused on a serial line.
    fn outgoing(&mut self) -> &mut [u8] {
        &mut []
    }

    /// A record for each unit that is to be treated in its own way.
    fn units(&mut self) -> &mut [Unit] {
        &mut []
    }

    /// Any number, another each time; for jitter.
    fn random(&mut self) -> u32 {
        0
    }
}
