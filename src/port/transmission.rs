//! When the last byte has left a UART that does not say so.

use crate::time::{character_of, elapsed, Micros, Micros16};

/// The time that accepted bytes take to leave a UART, computed from its baud rate.
#[derive(Clone, Debug)]
pub(super) struct Transmission {
    /// The time of a character; 0 if the baud rate is unknown.
    character: Micros16,
    /// The accepted bytes have left `wait` microseconds after `since`.
    since: Micros,
    wait: Micros,
}

impl Transmission {
    /// Of a device whose baud rate is unknown: all bytes have left.
    pub const UNKNOWN: Self = Transmission {
        character: 0,
        since: 0,
        wait: 0,
    };

    /// Of a character with this number of bits, the start and stop bits included.
    pub fn new(baud: u32, bits: u8) -> Self {
        Transmission {
            character: character_of(bits, baud),
            ..Transmission::UNKNOWN
        }
    }

    /// True if the baud rate is known.
    pub fn is_known(&self) -> bool {
        self.character > 0
    }

    /// Begins a frame. The last one has left, however long ago: the clock may have wrapped.
    pub fn begin(&mut self) {
        self.wait = 0;
    }

    /// Notes that the device has accepted bytes.
    pub fn note(&mut self, bytes: usize, now: Micros) {
        let character = u32::from(self.character);
        if elapsed(now, self.since) >= self.wait {
            self.since = now;
            self.wait = character;
        }
        let more = character.saturating_mul(bytes as u32);
        self.wait = self.wait.saturating_add(more);
    }

    /// True if all accepted bytes have left, and a character more could have.
    pub fn has_ended(&self, now: Micros) -> bool {
        elapsed(now, self.since) >= self.wait
    }
}
