//! How transactions behave.

use crate::time::{self, millis};

/// How a transaction behaves; kept from one to the next. Times are in
/// microseconds.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
#[repr(C)]
pub struct Settings {
    /// Silence before a request; set it with [`Settings::set_gap`].
    pub gap: u32,
    /// The silence t3.5 that ends a frame.
    pub silence: u32,
    /// From the end of the request to the end of the reply.
    pub response_timeout: u32,
    /// What slaves are given to carry out a broadcast.
    pub turnaround_delay: u32,
    /// What a late reply is given after a request that got none.
    pub quiet_time: u32,
    /// One character.
    pub character: u16,
    /// How often a request is repeated that was not answered.
    pub retries: u8,
    /// How long the driver is held on after the flush, in characters.
    pub post_flush_hold: u8,
    /// Whether each request comes back before its reply.
    pub echo_discard: bool,
}

impl Settings {
    /// What holds until somebody says otherwise.
    pub const DEFAULT: Settings = Settings {
        gap: time::DEFAULT_SILENCE,
        silence: time::DEFAULT_SILENCE,
        response_timeout: millis(2000),
        turnaround_delay: millis(100),
        quiet_time: millis(100),
        character: time::DEFAULT_CHARACTER,
        retries: 0,
        post_flush_hold: 0,
        echo_discard: false,
    };

    /// Sets the silence before a request, in microseconds.
    pub const fn set_gap(&mut self, microseconds: u32) {
        self.gap = time::clamped(microseconds);
    }

    /// Derives gap, silence and character time from the baud rate; 0 stands for an
    /// unknown one.
    pub const fn set_baud_rate(&mut self, baud: u32) {
        self.silence = time::silence(baud);
        self.gap = self.silence;
        self.character = time::character(baud);
    }

    /// Turns zeroed settings into the default. (Assigned as a whole, that would
    /// be copied from a constant, which takes flash, and RAM on an AVR.)
    #[cfg_attr(target_os = "none", inline(never))]
    pub fn preset(&mut self) {
        self.gap = Settings::DEFAULT.gap;
        self.silence = Settings::DEFAULT.silence;
        self.response_timeout = Settings::DEFAULT.response_timeout;
        self.turnaround_delay = Settings::DEFAULT.turnaround_delay;
        self.quiet_time = Settings::DEFAULT.quiet_time;
        self.character = Settings::DEFAULT.character;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_gap_is_at_most_the_longest_time() {
        let mut settings = Settings::DEFAULT;
        settings.set_gap(u32::MAX);
        assert_eq!(settings.gap, time::LONGEST);
        settings.set_gap(7);
        assert_eq!(settings.gap, 7);
    }

    #[test]
    fn zeroed_settings_become_the_default() {
        let mut settings = Settings {
            gap: 0,
            silence: 0,
            response_timeout: 0,
            turnaround_delay: 0,
            quiet_time: 0,
            character: 0,
            retries: 0,
            post_flush_hold: 0,
            echo_discard: false,
        };
        settings.preset();
        assert_eq!(settings, Settings::DEFAULT);
    }
}
