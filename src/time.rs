//! Time in microseconds on a clock that wraps, and the silences of the serial line guide.
//!
//! All functions use only differences of two times, so the wrap of the clock at 2^32 does
//! not matter. Two times that are compared must be less than 71 minutes apart.

use core::ops::AddAssign;

/// Microseconds: how long something lasts, or a time of a clock that wraps at 2^32.
pub type Micros = u32;
/// Microseconds of one character.
pub type Micros16 = u16;
/// Milliseconds: how long something lasts, or a time of a clock that wraps at 2^32.
pub type Millis = u32;

/// How far the clock may step back, in microseconds. A clock that adds a hardware counter to
/// millisecond ticks steps back if it is read after the counter has wrapped and before the
/// interrupt has counted the tick.
const STEP_BACK: u32 = 0x1_0000;

/// The longest wait in microseconds, about 36 minutes. A poll at most 35 minutes after the
/// end of the wait sees that it is over.
pub const LONGEST: u32 = 1 << 31;

/// The silence in microseconds while the baud rate is unknown: about 3.5 characters of 11
/// bits at 9600 baud.
pub const DEFAULT_SILENCE: u32 = 4_000;

/// The bits of a character with a parity or a second stop bit, the most that a standard line has.
pub(crate) const MOST_BITS: u8 = 11;

/// The length of a character in microseconds while the baud rate is unknown: 11 bits at 9600
/// baud.
pub const DEFAULT_CHARACTER: u16 = 1_146;

/// The fixed silence above 19200 baud, in microseconds (serial line guide V1.02, 2.5.1.1).
const FAST_SILENCE: u32 = 1_750;

/// Microseconds from `since` to `now`; 0 if the clock stepped back a little, so that `now`
/// is before `since`.
///
/// ```
/// use mbm::time::elapsed;
///
/// // The clock has wrapped in between.
/// assert_eq!(elapsed(5, u32::MAX - 4), 10);
/// ```
#[inline(always)]
pub const fn elapsed(now: u32, since: u32) -> u32 {
    let time = now.wrapping_sub(since);
    if time > u32::MAX - STEP_BACK {
        0
    } else {
        time
    }
}

/// True if at least `time` microseconds have [`elapsed`] from `since` to `now`; false if the
/// clock stepped back a little. (One comparison, because 32-bit comparisons cost much on an
/// AVR.)
#[inline(always)]
pub(crate) const fn has_elapsed(time: u32, now: u32, since: u32) -> bool {
    now.wrapping_sub(since).wrapping_add(STEP_BACK) >= time.wrapping_add(STEP_BACK)
}

/// Limits a duration that the caller chose to [`LONGEST`].
pub(crate) const fn clamped(microseconds: u32) -> u32 {
    if microseconds > LONGEST {
        LONGEST
    } else {
        microseconds
    }
}

/// Converts milliseconds to microseconds.
///
/// ```
/// assert_eq!(mbm::time::millis(20), 20_000);
/// ```
#[inline(always)]
pub const fn millis(milliseconds: u16) -> u32 {
    milliseconds as u32 * 1000
}

/// The longest timeout that a caller may set, in milliseconds, about 16 minutes. A request may
/// wait for three times as long for a second reply, which still fits into 32 bits.
pub const LONGEST_TIMEOUT_MS: u32 = 1_000_000;

/// Converts a timeout in milliseconds to microseconds. One above [`LONGEST_TIMEOUT_MS`] counts
/// as that.
#[inline(always)]
pub(crate) const fn timeout_at_most(milliseconds: u32) -> u32 {
    if milliseconds > LONGEST_TIMEOUT_MS {
        LONGEST_TIMEOUT_MS * 1000
    } else {
        milliseconds * 1000
    }
}

/// Converts a timeout in milliseconds to microseconds. `None` above 1 000 000.
///
/// ```
/// assert_eq!(mbm::time::timeout(500), Some(500_000));
/// assert_eq!(mbm::time::timeout(1_000_001), None);
/// ```
#[cfg_attr(target_os = "none", inline(never))]
pub const fn timeout(milliseconds: u32) -> Option<u32> {
    if milliseconds > LONGEST_TIMEOUT_MS {
        None
    } else {
        Some(milliseconds * 1000)
    }
}

/// The length of a character of 11 bits, in microseconds, rounded up, at most 65535.
/// [`DEFAULT_CHARACTER`] if `baud` is 0.
///
/// ```
/// // 11 bits.
/// assert_eq!(mbm::time::character(9600), 1146);
/// ```
pub const fn character(baud: u32) -> u16 {
    character_of(MOST_BITS, baud)
}

/// As [`character`], of this number of bits, the start and stop bits included.
#[inline(always)]
pub(crate) const fn character_of(bits: u8, baud: u32) -> u16 {
    let time = match (bits as u32 * 1_000_000).checked_div(baud) {
        Some(time) => time,
        None => return DEFAULT_CHARACTER,
    };
    if time >= 0xFFFF {
        0xFFFF
    } else {
        time as u16 + 1
    }
}

/// Adds `count` characters of `character` microseconds to a time. (A 32-bit multiplication costs 84
/// bytes of flash on an AVR. Two additions in memory a character do without.)
#[inline(always)]
pub(crate) fn add_characters<N>(time: &mut u32, count: N, character: u16)
where
    N: Copy + Ord + From<u8> + AddAssign + Into<usize>,
{
    if !cfg!(target_arch = "avr") {
        *time = time.wrapping_add(count.into() as u32 * u32::from(character));
        return;
    }
    let mut added = N::from(0);
    while added < count {
        *time = time.wrapping_add(character.into());
        added += 1.into();
    }
}

/// For how many microseconds after the start of a frame of `count` characters its last bit is
/// sure not to have left: until an eighth of the time and a character before its end. A
/// character may have 10 bits instead of 11, clocks differ, and a program that sleeps for this
/// time may wake up late, though the driver must go off in time. 0 if `character` is 0, the
/// length of an unknown one.
// For the C API; it may change in any version.
#[doc(hidden)]
pub const fn sure_to_be_sending(character: u16, count: u16) -> u32 {
    character as u32 * (count - count / 8).saturating_sub(1) as u32
}

/// The silence t3.5 that separates two frames, in microseconds. [`DEFAULT_SILENCE`] if
/// `baud` is 0.
///
/// ```
/// assert_eq!(mbm::time::silence(9600), 4011);
/// // From 19200 baud on, the standard wants a fixed silence.
/// assert_eq!(mbm::time::silence(115_200), 1750);
/// ```
pub const fn silence(baud: u32) -> u32 {
    if baud > 19_200 {
        FAST_SILENCE
    } else {
        match 38_500_000u32.checked_div(baud) {
            Some(time) => time + 1,
            None => DEFAULT_SILENCE,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_frame_still_leaves_while_a_program_sleeps() {
        for (count, sleep) in [
            (0, 0),
            (1, 0),
            (4, 3),
            (8, 6),
            (256, 223),
            (u16::MAX, 57_343),
        ] {
            assert_eq!(sure_to_be_sending(1146, count), 1146 * sleep, "{count}");
            assert_eq!(sure_to_be_sending(0, count), 0);
        }
    }

    #[test]
    fn silence_is_three_and_a_half_characters_up_to_19200_baud() {
        assert_eq!(silence(9_600), 4_011);
        assert_eq!(silence(19_200), 2_006);
        assert_eq!(silence(300), 128_334);
    }

    #[test]
    fn silence_is_fixed_above_19200_baud() {
        assert_eq!(silence(19_201), 1_750);
        assert_eq!(silence(115_200), 1_750);
    }

    #[test]
    fn an_unknown_baud_rate_gives_the_defaults() {
        assert_eq!(silence(0), DEFAULT_SILENCE);
        assert_eq!(character(0), DEFAULT_CHARACTER);
    }

    #[test]
    fn a_character_is_eleven_bits() {
        assert_eq!(character(9_600), 1_146);
        assert_eq!(character(1), 0xFFFF);
    }

    #[test]
    fn every_number_of_milliseconds_fits() {
        for milliseconds in 0..=u16::MAX {
            assert_eq!(millis(milliseconds) / 1000, milliseconds.into());
        }
    }

    #[test]
    fn a_timeout_is_refused_above_a_million_milliseconds() {
        assert_eq!(timeout(0), Some(0));
        assert_eq!(timeout(LONGEST_TIMEOUT_MS), Some(1_000_000_000));
        assert_eq!(timeout(LONGEST_TIMEOUT_MS + 1), None);
        assert_eq!(timeout(u32::MAX), None);
    }

    #[test]
    fn elapsed_survives_the_wrap() {
        assert_eq!(elapsed(5, u32::MAX - 4), 10);
    }

    #[test]
    fn the_longest_time_elapses_though_the_clock_steps_back_a_little() {
        assert_eq!(clamped(u32::MAX), LONGEST);
        assert_eq!(clamped(LONGEST - 1), LONGEST - 1);
        let twice = LONGEST.wrapping_add(millis(u16::MAX));
        assert!(!has_elapsed(twice, twice - 1, 0));
        assert!(has_elapsed(twice, twice, 0));
        assert!(!has_elapsed(twice, 1_000, 2_000));
    }

    #[test]
    fn a_clock_that_steps_back_a_little_has_not_moved() {
        assert_eq!(elapsed(1_000, 1_001), 0);
        assert_eq!(elapsed(1_000, 2_000), 0);
        assert_eq!(elapsed(0xFFFF_0000, 0xFFFF_FFFF), 0);
        assert!(!has_elapsed(1, 1_000, 1_001));
        assert!(!has_elapsed(0, 1_000, 2_000));
        assert!(!has_elapsed(1_000, 0xFFFF_0000, 0xFFFF_FFFF));
    }

    #[test]
    fn a_time_has_elapsed_once_it_is_reached() {
        assert!(has_elapsed(0, 7, 7));
        assert!(has_elapsed(10, 5, u32::MAX - 4));
        assert!(!has_elapsed(11, 5, u32::MAX - 4));
        assert!(has_elapsed(millis(u16::MAX), millis(u16::MAX), 0));
    }
}
