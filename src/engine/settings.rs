//! Times and options of requests.

use crate::error::Error;
use crate::time::{self, millis, Micros16, DEFAULT_SILENCE};

/// A time in microseconds with a default. It stores the difference from the default, so zeroed
/// memory is the default, and no code has to set it.
///
/// ```
/// use mbm::master::MicrosSetting;
///
/// let mut timeout: MicrosSetting<2_000_000> = MicrosSetting::default();
/// assert_eq!(timeout.get(), 2_000_000);
/// timeout.set_timeout(500)?;
/// assert_eq!(timeout, MicrosSetting::new(500_000));
/// assert_eq!(timeout.set_timeout(1_000_001), Err(mbm::Error::InvalidArgument));
/// timeout.set_delay(20)?;
/// assert_eq!(timeout.get(), 20_000);
/// # Ok::<(), mbm::Error>(())
/// ```
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug, Default)]
#[repr(transparent)]
pub struct MicrosSetting<const DEFAULT: u32>(u32);

impl<const DEFAULT: u32> MicrosSetting<DEFAULT> {
    /// The setting of a time.
    pub const fn new(microseconds: u32) -> Self {
        MicrosSetting(microseconds.wrapping_sub(DEFAULT))
    }

    /// The time in microseconds.
    pub const fn get(self) -> u32 {
        self.0.wrapping_add(DEFAULT)
    }

    /// Sets a timeout in milliseconds, 0 to 1 000 000.
    ///
    /// # Errors
    /// [`Error::InvalidArgument`] above 1 000 000. Nothing changes then.
    #[inline(always)]
    pub fn set_timeout(&mut self, milliseconds: u32) -> Result<(), Error> {
        let Some(timeout) = time::timeout(milliseconds) else {
            return Err(Error::InvalidArgument);
        };
        *self = MicrosSetting::new(timeout);
        Ok(())
    }

    /// Sets a delay in milliseconds, 0 to 65 535.
    ///
    /// # Errors
    /// [`Error::InvalidArgument`] above 65 535. Nothing changes then.
    pub fn set_delay(&mut self, milliseconds: u32) -> Result<(), Error> {
        let Ok(delay) = u16::try_from(milliseconds) else {
            return Err(Error::InvalidArgument);
        };
        *self = MicrosSetting::new(millis(delay));
        Ok(())
    }
}

/// Times and options of requests, which hold until they are changed. Zeroed memory is the
/// default.
///
/// ```
/// use mbm::master::{MicrosSetting, Settings};
///
/// let mut settings = Settings::DEFAULT;
/// settings.set_baud_rate(19200);
/// settings.retries = 2;
/// // A timeout of 1 s, in milliseconds and in microseconds.
/// settings.response_timeout.set_timeout(1000)?;
/// assert_eq!(settings.response_timeout, MicrosSetting::new(1_000_000));
/// # Ok::<(), mbm::Error>(())
/// ```
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug, Default)]
#[repr(C)]
pub struct Settings {
    /// Response timeout: from the end of the request to the end of the reply. The default is 2 s.
    pub response_timeout: MicrosSetting<{ millis(2000) }>,
    /// The silence t3.5 that ends a frame (serial line guide V1.02, 2.5.1.1). The default is 4 ms.
    pub silence: MicrosSetting<DEFAULT_SILENCE>,
    /// Silence before a request. Set it with [`Settings::set_gap`]. The default is 4 ms.
    pub gap: MicrosSetting<DEFAULT_SILENCE>,
    /// Quiet time: the silence before the next request after a request without a reply, so
    /// that a late reply can pass. The default is 100 ms.
    pub quiet_time: MicrosSetting<{ millis(100) }>,
    /// Turnaround delay: the time that devices get to carry out a broadcast. The default is 100 ms.
    pub turnaround_delay: MicrosSetting<{ millis(100) }>,
    /// Time of one character in microseconds; 0 if the baud rate is unknown.
    pub character: Micros16,
    /// How often an unanswered request is repeated.
    pub retries: u8,
    /// How long the driver stays on after the flush, in characters.
    pub post_flush_characters: u8,
    /// True if the line echoes each request before its reply.
    pub echo_discard: bool,
}

impl Settings {
    /// The settings of a new master or client.
    pub const DEFAULT: Settings = Settings {
        response_timeout: MicrosSetting(0),
        silence: MicrosSetting(0),
        gap: MicrosSetting(0),
        quiet_time: MicrosSetting(0),
        turnaround_delay: MicrosSetting(0),
        character: 0,
        retries: 0,
        post_flush_characters: 0,
        echo_discard: false,
    };

    /// Sets the silence before a request, in microseconds.
    ///
    /// ```
    /// # include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/doc/pump.rs"));
    /// # fn main() -> Result<(), mbm::Error> {
    /// # let buffers = mbm::master::Buffers::new([0; 64], [0; 20], [0; 20]);
    /// # let mut master = mbm::master::Master::new(17, rtu(), buffers);
    /// master.settings().set_gap(5_000);
    /// # Ok(())
    /// # }
    /// ```
    pub const fn set_gap(&mut self, microseconds: u32) {
        self.gap = MicrosSetting::new(time::clamped(microseconds));
    }

    /// Derives gap, silence and character time from the baud rate in bits per second; 0 means that
    /// the rate is unknown.
    pub const fn set_baud_rate(&mut self, baud: u32) {
        self.silence = MicrosSetting::new(time::silence(baud));
        self.gap = self.silence;
        self.character = if baud == 0 { 0 } else { time::character(baud) };
    }

    /// Time of one character, also if the baud rate is unknown.
    // For the C API; it may change in any version.
    #[doc(hidden)]
    pub const fn any_character(&self) -> u16 {
        if self.character == 0 {
            time::DEFAULT_CHARACTER
        } else {
            self.character
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_gap_is_at_most_the_longest_time() {
        let mut settings = Settings::DEFAULT;
        settings.set_gap(u32::MAX);
        assert_eq!(settings.gap.get(), time::LONGEST);
        settings.set_gap(7);
        assert_eq!(settings.gap.get(), 7);
    }

    #[test]
    fn a_refused_time_changes_nothing() {
        let mut settings = Settings::DEFAULT;
        let response_timeout = &mut settings.response_timeout;
        assert_eq!(response_timeout.set_timeout(1_000_000), Ok(()));
        let refused = response_timeout.set_timeout(1_000_001);
        assert_eq!(refused, Err(Error::InvalidArgument));
        assert_eq!(response_timeout.get(), 1_000_000_000);
        let quiet_time = &mut settings.quiet_time;
        assert_eq!(quiet_time.set_delay(65_535), Ok(()));
        assert_eq!(quiet_time.set_delay(65_536), Err(Error::InvalidArgument));
        assert_eq!(quiet_time.get(), 65_535_000);
    }

    #[test]
    fn zeroed_settings_are_the_default() {
        let settings = Settings::default();
        assert_eq!(settings, Settings::DEFAULT);
        assert_eq!(settings.response_timeout.get(), 2_000_000);
        assert_eq!(settings.silence.get(), 4_000);
        assert_eq!(settings.gap.get(), 4_000);
        assert_eq!(settings.quiet_time.get(), 100_000);
        assert_eq!(settings.turnaround_delay.get(), 100_000);
    }
}
