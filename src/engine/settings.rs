//! Times and options of requests.

use crate::time::{self, millis};

/// Times and options of requests, which hold until they are changed. Times are in
/// microseconds.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
#[repr(C)]
pub struct Settings {
    /// Silence before a request. Set it with [`Settings::set_gap`].
    pub gap: u32,
    /// The silence t3.5 that ends a frame (serial line guide V1.02, 2.5.1.1).
    pub silence: u32,
    /// Response timeout: from the end of the request to the end of the reply.
    pub response_timeout: u32,
    /// Turnaround delay: the time that slaves get to carry out a broadcast.
    pub turnaround_delay: u32,
    /// Quiet time: the silence before the next request after a request without a reply, so
    /// that a late reply can pass.
    pub quiet_time: u32,
    /// Time of one character; 0 if the baud rate is unknown.
    pub character: u16,
    /// How often an unanswered request is repeated.
    pub retries: u8,
    /// How long the driver stays on after the flush, in characters.
    pub post_flush_hold: u8,
    /// True if the line echoes each request before its reply.
    pub echo_discard: bool,
}

impl Settings {
    /// The settings of a new master or client.
    pub const DEFAULT: Settings = Settings {
        gap: time::DEFAULT_SILENCE,
        silence: time::DEFAULT_SILENCE,
        response_timeout: millis(2000),
        turnaround_delay: millis(100),
        quiet_time: millis(100),
        character: 0,
        retries: 0,
        post_flush_hold: 0,
        echo_discard: false,
    };

    /// Sets the silence before a request, in microseconds.
    pub const fn set_gap(&mut self, microseconds: u32) {
        self.gap = time::clamped(microseconds);
    }

    /// Derives gap, silence and character time from the baud rate; 0 means that the rate is
    /// unknown.
    pub const fn set_baud_rate(&mut self, baud: u32) {
        self.silence = time::silence(baud);
        self.gap = self.silence;
        self.character = if baud == 0 { 0 } else { time::character(baud) };
    }

    /// Time of one character, also if the baud rate is unknown.
    pub const fn any_character(&self) -> u16 {
        if self.character == 0 {
            time::DEFAULT_CHARACTER
        } else {
            self.character
        }
    }

    /// Turns zeroed settings into the default settings. Field by field, because a constant
    /// of the whole struct would take flash, and RAM on an AVR.
    #[cfg_attr(target_os = "none", inline(never))]
    pub fn set_default_if_zero(&mut self) {
        self.gap = Settings::DEFAULT.gap;
        self.silence = Settings::DEFAULT.silence;
        self.response_timeout = Settings::DEFAULT.response_timeout;
        self.turnaround_delay = Settings::DEFAULT.turnaround_delay;
        self.quiet_time = Settings::DEFAULT.quiet_time;
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
        settings.set_default_if_zero();
        assert_eq!(settings, Settings::DEFAULT);
    }
}
