//! The units of a line that may still answer earlier requests. See `late`.

use crate::time::elapsed;

/// How many units are remembered exactly that owe replies at the same time: 10 on a host, 4 where
/// pointers have 32 bits, 1 on an AVR, where each takes 6 bytes of 2048.
pub(super) const LATE_UNITS: usize = match size_of::<usize>() {
    2 => 1,
    4 => 4,
    _ => 10,
};

/// In [`LateUnit::owed`]: how many replies the unit owes.
pub(super) const REPLIES: u8 = 0x1F;
/// One of them may be later than the quiet time: no damaged reply to its request was seen.
pub(super) const SLOW: u8 = 0x20;
/// A request was cancelled, so the next one waits until the unit is clean.
pub(super) const CANCELLED: u8 = 0x40;
/// What a record owes that stands for all units without a record of their own.
pub(super) const ANY: u8 = 0xFF;

/// The longest time in microseconds for which a unit is expected to answer late, 134 s.
pub(super) const LONGEST: u32 = 1 << 27;

/// A unit that owes replies.
#[derive(Clone, Copy, Hash, Debug)]
#[repr(C)]
pub struct LateUnit {
    pub(super) unit: u8,
    /// What it owes, and flags; 0: the record is free.
    pub(super) owed: u8,
    /// [`LONGEST`] before the time at which it is clean. Each request has its own timeout.
    pub(super) since: u32,
}

impl LateUnit {
    /// True if the record says what `unit` owes.
    pub(super) fn is_of(&self, unit: u8) -> bool {
        self.owed != 0 && (self.unit == unit || self.owed == ANY)
    }
}

/// The units that owe replies. If more owe some than there are records, the last record stands for
/// all others: then these wait as after a cancelled request.
#[derive(Clone, Hash, Debug)]
#[repr(C)]
pub struct LateUnits {
    pub(super) records: [LateUnit; LATE_UNITS],
}

impl LateUnits {
    /// No unit owes a reply.
    pub(super) const NONE: LateUnits = LateUnits {
        records: [LateUnit {
            unit: 0,
            owed: 0,
            since: 0,
        }; LATE_UNITS],
    };

    /// The record that says what the unit owes.
    #[cfg_attr(target_os = "none", inline(never))]
    pub(super) fn record(&mut self, unit: u8) -> Option<&mut LateUnit> {
        let mut records = self.records.iter_mut();
        records.find(|record| record.is_of(unit))
    }

    /// Microseconds after `now` for which the next request to the unit waits until it is clean.
    pub fn rest(&mut self, unit: u8, now: u32) -> u32 {
        match self.record(unit) {
            Some(record) if record.owed & CANCELLED != 0 => {
                LONGEST.saturating_sub(elapsed(now, record.since))
            }
            _ => 0,
        }
    }

    /// Has the next reply held after a cancelled request, as after a timeout. For model checkers, which
    /// find that a device is not heard again then.
    #[doc(hidden)]
    pub fn forget_cancelled(&mut self) {
        for record in &mut self.records {
            record.owed &= !CANCELLED;
        }
    }

    /// No unit owes a reply any more.
    pub(crate) fn clear(&mut self) {
        *self = LateUnits::NONE;
    }

    /// As [`super::Engine::rebase`].
    pub(super) fn rebase(&mut self, now: u32) {
        for record in &mut self.records {
            match record.owed {
                0 => *record = LateUnits::NONE.records[0],
                _ => record.since = 0u32.wrapping_sub(elapsed(now, record.since).min(LONGEST)),
            }
        }
    }
}
