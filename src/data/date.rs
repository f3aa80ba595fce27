//! A date and a time of day, and the seconds since 1970 that they are. (Gregorian calendar, also
//! before 1582. There are no leap seconds.)

use crate::error::Error;

/// The device says that its clock shows summer time.
pub const SUMMER_TIME: u8 = 1;
/// The device says that its clock may be wrong: it was never set, or lost its power.
pub const UNRELIABLE: u8 = 2;

/// A date and a time of day, in the time zone of the device. Month and day may both be 0, with the
/// year 0: a time of day without a date.
///
/// ```
/// use mbm::data::date::Date;
///
/// let date = Date::of_seconds(1_700_000_000)?;
/// assert_eq!((date.year, date.month, date.day), (2023, 11, 14));
/// assert_eq!(date.seconds(), Ok(1_700_000_000));
/// assert!(date.exists());
/// assert!(!Date { month: 2, day: 30, ..date }.exists());
/// # Ok::<(), mbm::Error>(())
/// ```
#[repr(C)]
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Date {
    /// 1 to 9999.
    pub year: u16,
    /// 0 to 999.
    pub millisecond: u16,
    /// 1 to 12.
    pub month: u8,
    /// 1 to 31.
    pub day: u8,
    /// 0 to 23.
    pub hour: u8,
    /// 0 to 59.
    pub minute: u8,
    /// 0 to 59.
    pub second: u8,
    /// [`SUMMER_TIME`], [`UNRELIABLE`].
    pub flags: u8,
}

const DAYS_BEFORE_1970: u32 = 719_162;
const SECONDS_PER_DAY: u32 = 86_400;
const SECONDS_BEFORE_1970: i64 = DAYS_BEFORE_1970 as i64 * SECONDS_PER_DAY as i64;
/// A day has so many times 128 seconds. With them, the seconds of 9999 years fit in 32 bits.
const PARTS_PER_DAY: u32 = 675;

/// The days from 1 January of the year 1 to that of another year.
const fn days_before(year: u16) -> u32 {
    let passed = year.wrapping_sub(1);
    let centuries = passed / 100;
    365 * passed as u32 + (passed / 4 - centuries + centuries / 4) as u32
}

/// The days of a month.
const fn days_of(year: u16, month: u8) -> u8 {
    match month {
        2 if year.is_multiple_of(4) && (!year.is_multiple_of(100) || year.is_multiple_of(400)) => {
            29
        }
        2 => 28,
        4 | 6 | 9 | 11 => 30,
        _ => 31,
    }
}

impl Date {
    /// True if it is a time of day without a date.
    pub(crate) const fn is_time_only(&self) -> bool {
        self.year == 0 && self.month == 0 && self.day == 0
    }

    /// True if there is such a date and such a time.
    pub const fn exists(&self) -> bool {
        let is_date = self.year >= 1
            && self.year <= 9999
            && self.month >= 1
            && self.month <= 12
            && self.day >= 1
            && self.day <= days_of(self.year, self.month);
        (is_date || self.is_time_only())
            && self.hour < 24
            && self.minute < 60
            && self.second < 60
            && self.millisecond < 1000
    }

    /// The seconds since 1970-01-01 00:00:00, as if the time zone were UTC; without milliseconds.
    ///
    /// # Errors
    /// [`Error::InvalidArgument`] if the date does not exist, or for a time without a date.
    pub fn seconds(&self) -> Result<i64, Error> {
        if !self.exists() || self.is_time_only() {
            return Err(Error::InvalidArgument);
        }
        let mut days = days_before(self.year) + u32::from(self.day) - 1;
        for month in 1..self.month {
            days += u32::from(days_of(self.year, month));
        }
        let of_day =
            u32::from(self.hour) * 3600 + u32::from(self.minute) * 60 + u32::from(self.second);
        Ok((i64::from(days * PARTS_PER_DAY) << 7) + i64::from(of_day) - SECONDS_BEFORE_1970)
    }

    /// The date that is so many seconds after 1970-01-01 00:00:00.
    ///
    /// # Errors
    /// [`Error::OutOfRange`] for a date before the year 1 or after 9999.
    pub fn of_seconds(seconds: i64) -> Result<Date, Error> {
        const FIRST: i64 = -SECONDS_BEFORE_1970;
        const END: i64 = days_before(10_000) as i64 * SECONDS_PER_DAY as i64 + FIRST;
        if !(FIRST..END).contains(&seconds) {
            return Err(Error::OutOfRange);
        }
        let seconds = seconds - FIRST;
        let mut days = (seconds >> 7) as u32 / PARTS_PER_DAY;
        // The higher bits of both terms are equal.
        let of_day = (seconds as u32).wrapping_sub(days.wrapping_mul(SECONDS_PER_DAY));
        // At most seven years too many.
        let mut year = (days / 365 + 1) as u16;
        while days_before(year) > days {
            year -= 1;
        }
        days -= days_before(year);
        let mut month = 1;
        while days >= u32::from(days_of(year, month)) {
            days -= u32::from(days_of(year, month));
            month += 1;
        }
        Ok(Date {
            year,
            month,
            day: days as u8 + 1,
            hour: (of_day / 3600) as u8,
            minute: (of_day / 60 % 60) as u8,
            second: (of_day % 60) as u8,
            ..Date::default()
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn date(year: u16, month: u8, day: u8) -> Date {
        Date {
            year,
            month,
            day,
            ..Date::default()
        }
    }

    #[test]
    fn every_day_from_the_year_1_to_9999_is_its_number() {
        let (mut seconds, mut days) = (date(1, 1, 1).seconds().unwrap(), 0);
        for year in 1..=9999 {
            for month in 1..=12 {
                for day in 1..=days_of(year, month) {
                    let today = date(year, month, day);
                    assert_eq!(today.seconds(), Ok(seconds));
                    assert_eq!(Date::of_seconds(seconds), Ok(today));
                    seconds += i64::from(SECONDS_PER_DAY);
                    days += 1;
                }
            }
        }
        // 400 years have 97 leap days.
        assert_eq!(days, 146_097 * 25 - 366);
        assert_eq!(Date::of_seconds(seconds), Err(Error::OutOfRange));
        assert!(Date::of_seconds(seconds - 1).is_ok());
    }

    #[test]
    fn known_moments_are_as_other_clocks_have_them() {
        for (seconds, year, month, day, hour, minute, second) in [
            (0, 1970, 1, 1, 0, 0, 0),
            (946_684_800, 2000, 1, 1, 0, 0, 0),
            (951_782_400, 2000, 2, 29, 0, 0, 0),
            (1_234_567_890, 2009, 2, 13, 23, 31, 30),
            (i64::from(i32::MAX), 2038, 1, 19, 3, 14, 7),
            (i64::from(u32::MAX), 2106, 2, 7, 6, 28, 15),
            (-1, 1969, 12, 31, 23, 59, 59),
            (-62_135_596_800, 1, 1, 1, 0, 0, 0),
            (253_402_300_799, 9999, 12, 31, 23, 59, 59),
        ] {
            let known = Date {
                hour,
                minute,
                second,
                ..date(year, month, day)
            };
            assert_eq!(Date::of_seconds(seconds), Ok(known));
            assert_eq!(known.seconds(), Ok(seconds));
        }
        for seconds in [i64::MIN, -62_135_596_801, 253_402_300_800, i64::MAX] {
            assert_eq!(Date::of_seconds(seconds), Err(Error::OutOfRange));
        }
    }

    #[test]
    fn a_date_that_does_not_exist_has_no_seconds() {
        for (year, month, day) in [
            (2026, 2, 29),
            (1900, 2, 29),
            (2026, 4, 31),
            (2026, 13, 1),
            (2026, 0, 1),
            (2026, 1, 0),
            (2026, 1, 32),
            (0, 1, 1),
            (10_000, 1, 1),
            (0, 0, 0),
        ] {
            assert_eq!(
                date(year, month, day).seconds(),
                Err(Error::InvalidArgument)
            );
        }
        assert!(date(2000, 2, 29).exists());
        let wrong: [fn(&mut Date); 4] = [
            |date| date.hour = 24,
            |date| date.minute = 60,
            |date| date.second = 60,
            |date| date.millisecond = 1000,
        ];
        for change in wrong {
            let mut changed = date(2026, 1, 1);
            change(&mut changed);
            assert!(!changed.exists());
        }
    }
}
