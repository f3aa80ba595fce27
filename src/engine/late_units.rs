//! The units of a line that may still answer earlier requests. See `late`.

use crate::time::Micros;

/// How many units that owe replies at the same time are remembered exactly: 10 on a host, 4 where
/// pointers have 32 bits, 1 on an AVR, where each takes 8 bytes of 2048.
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
/// The `owed` of the record that stands for all units without a record of their own.
pub(super) const ANY: u8 = 0xFF;

/// A unit that owes replies.
#[derive(Clone, Copy, Hash, Debug)]
#[repr(C)]
pub struct LateUnit {
    pub(super) unit: u8,
    /// How many replies it owes, and flags; 0: the record is free.
    pub(super) owed: u8,
    /// The most time that can be left until the unit is clean, in units of 2^16 microseconds.
    /// If the clock shows more, the unit has been clean for long.
    pub(super) most: u16,
    /// When the unit is clean: it has been silent for long enough since its last request.
    pub(super) clean: Micros,
}

impl LateUnit {
    /// True if the record says what `unit` owes.
    pub(super) fn is_of(&self, unit: u8) -> bool {
        self.owed != 0 && (self.unit == unit || self.owed == ANY)
    }

    /// Microseconds from `now` until the unit is clean.
    #[cfg_attr(target_os = "none", inline(never))]
    pub(super) fn left(&self, now: u32) -> u32 {
        let left = self.clean.wrapping_sub(now);
        if (left >> 16) as u16 > self.most {
            0
        } else {
            left
        }
    }

    /// Sets the time at which the unit is clean to `silence` microseconds after `since`, unless
    /// it is later already.
    #[inline(always)]
    pub(super) fn clean_after(&mut self, silence: u32, since: u32) {
        let clean = since.wrapping_add(silence);
        if self.owed == 0 || (self.clean.wrapping_sub(clean) as i32) < 0 {
            self.clean = clean;
            // The clock may step back a little.
            self.most = (silence >> 16) as u16 + 1;
        }
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
            most: 0,
            clean: 0,
        }; LATE_UNITS],
    };

    /// The record of the replies that the unit owes.
    #[cfg_attr(target_os = "none", inline(never))]
    pub(super) fn record(&mut self, unit: u8) -> Option<&mut LateUnit> {
        let records = self.records.iter_mut();
        // The records that were ever used come first. Looking at these alone saves time on a
        // host, which has more records.
        let mut used = records.take_while(|record| LATE_UNITS <= 4 || record.most > 0);
        used.find(|record| record.is_of(unit))
    }

    /// Microseconds after `now` for which the next request to the unit waits until it is clean.
    pub fn rest(&mut self, unit: u8, now: u32) -> u32 {
        match self.record(unit) {
            Some(record) if record.owed & CANCELLED != 0 => record.left(now),
            _ => 0,
        }
    }

    /// Makes the engine hold the next reply after a cancelled request, as after a timeout. It
    /// is for model checkers: they find that the master then never gets a reply of the device
    /// again.
    // For model checkers.
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
                0 => {
                    let most = record.most.min(1);
                    *record = LateUnit {
                        most,
                        ..LateUnits::NONE.records[0]
                    };
                }
                _ => record.clean = record.left(now),
            }
        }
    }
}
