//! Dates and times in registers: in a layout of registers and bytes that a text describes, and in
//! the form of IEC 870-5-4.
//!
//! A layout has a letter for each register, or two for its high and its low byte, and a space
//! between two registers: `Y M D h m s` are six registers, `yM Dh ms` three.
//!
//! | letter | part |
//! |---|---|
//! | `Y` | the year, such as 2026; only as a register |
//! | `y` | the years since 2000; with `C` the last two digits of the year |
//! | `n` | the years since 1900 |
//! | `C` | the first two digits of the year, such as 20 |
//! | `M`, `D` | month and day, from 1 on |
//! | `h`, `m`, `s` | hours, minutes, seconds |
//! | `f` | milliseconds, 0 to 999; only as a register |
//! | `-` | nothing of the date: not read, written as 0 |

use super::date::{Date, SUMMER_TIME, UNRELIABLE};
use super::digits::{from_bcd, to_bcd};
use super::order::Order;
use super::view::{RegisterBytes, RegisterBytesMut, Registers};
use crate::error::Error;

/// The letters of a layout; the place of each is the number of its part.
const LETTERS: &[u8; 11] = b"-YynCMDhmsf";
const NOTHING: usize = 0;
const YEAR: usize = 1;
const SINCE_2000: usize = 2;
const SINCE_1900: usize = 3;
const CENTURY: usize = 4;
const MONTH: usize = 5;
const DAY: usize = 6;
const HOUR: usize = 7;
const MINUTE: usize = 8;
const SECOND: usize = 9;
const MILLISECOND: usize = 10;
const PARTS: usize = LETTERS.len();

/// A part of a date in the registers of a layout.
#[derive(Clone, Copy)]
struct Place {
    part: usize,
    register: u16,
    /// It is a byte of the register; that with the lower value.
    is_byte: bool,
    is_low: bool,
}

/// A layout, and whether its numbers are in BCD.
///
/// ```
/// use mbm::data::clock::Layout;
///
/// let layout = Layout::new(b"yM Dh ms", false)?;
/// assert_eq!(layout.registers(), 3);
/// // There is no such letter.
/// assert_eq!(Layout::new(b"Q", false).err(), Some(mbm::Error::InvalidArgument));
/// # Ok::<(), mbm::Error>(())
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Layout<'a> {
    text: &'a [u8],
    is_bcd: bool,
}

impl<'a> Layout<'a> {
    /// Checks a layout, such as `Y M D h m s`.
    ///
    /// # Errors
    /// [`Error::InvalidArgument`] for a layout with another letter, a letter twice, more than two
    /// letters for a register, a year or milliseconds in one byte, a month without a day, or
    /// neither month nor hour.
    pub fn new(text: &'a [u8], is_bcd: bool) -> Result<Layout<'a>, Error> {
        let layout = Layout { text, is_bcd };
        let mut seen = 0u16;
        for group in text.split(|one| *one == b' ') {
            if !matches!(group.len(), 1 | 2) {
                return Err(Error::InvalidArgument);
            }
            for letter in group {
                let part = part_of(*letter).ok_or(Error::InvalidArgument)?;
                let is_wide = matches!(part, YEAR | MILLISECOND);
                let bit = 1 << part;
                if is_wide && group.len() == 2 || part != NOTHING && seen & bit != 0 {
                    return Err(Error::InvalidArgument);
                }
                seen |= bit;
            }
        }
        let has = |part: usize| seen >> part & 1 != 0;
        let years = [YEAR, SINCE_2000, SINCE_1900].map(|part| u8::from(has(part)));
        let years = years.iter().sum::<u8>();
        let is_date = years == 1 && has(MONTH) && has(DAY) && (!has(CENTURY) || has(SINCE_2000));
        let has_none = years == 0 && !has(MONTH) && !has(DAY) && !has(CENTURY);
        let is_right = (is_date || has_none && has(HOUR))
            // What is smaller needs what is larger.
            && (has(HOUR) || !has(MINUTE))
            && (has(MINUTE) || !has(SECOND))
            && (has(SECOND) || !has(MILLISECOND));
        if is_right {
            Ok(layout)
        } else {
            Err(Error::InvalidArgument)
        }
    }

    /// The number of registers.
    pub fn registers(&self) -> u16 {
        self.text.iter().filter(|one| **one == b' ').count() as u16 + 1
    }

    /// The places of its parts.
    fn places(&self) -> impl Iterator<Item = Place> + 'a {
        let groups = self.text.split(|one| *one == b' ').zip(0..);
        groups.flat_map(|(group, register)| {
            group.iter().enumerate().map(move |(at, letter)| Place {
                part: part_of(*letter).unwrap_or(NOTHING),
                register,
                is_byte: group.len() == 2,
                is_low: at == 1,
            })
        })
    }

    /// True if there is such a date, and if it has a day exactly if the layout has one.
    fn is_for(&self, date: &Date) -> bool {
        date.exists() && date.is_time_only() != self.text.contains(&b'M')
    }

    /// The date that has these parts.
    fn date(&self, parts: &[u16; PARTS]) -> Result<Date, Error> {
        let [_, year, since_2000, since_1900, century, month, day, hour, minute, second, millisecond] =
            *parts;
        let first = if self.text.contains(&b'C') {
            century.saturating_mul(100)
        } else {
            2000
        };
        let year = if self.text.contains(&b'y') {
            first.saturating_add(since_2000)
        } else if self.text.contains(&b'n') {
            since_1900.saturating_add(1900)
        } else {
            year
        };
        let byte = |part: u16| u8::try_from(part).unwrap_or(u8::MAX);
        let date = Date {
            year,
            millisecond,
            month: byte(month),
            day: byte(day),
            hour: byte(hour),
            minute: byte(minute),
            second: byte(second),
            flags: 0,
        };
        if !self.is_for(&date) {
            return Err(Error::MalformedValue);
        }
        Ok(date)
    }

    /// The parts of a date.
    fn parts(&self, date: &Date) -> Result<[u16; PARTS], Error> {
        if !self.is_for(date) {
            return Err(Error::InvalidArgument);
        }
        let mut parts = [0; PARTS];
        parts[YEAR] = date.year;
        parts[SINCE_1900] = date.year.wrapping_sub(1900);
        if self.text.contains(&b'C') {
            parts[CENTURY] = date.year / 100;
            parts[SINCE_2000] = date.year % 100;
        } else {
            parts[SINCE_2000] = date.year.wrapping_sub(2000);
        }
        parts[MONTH] = date.month.into();
        parts[DAY] = date.day.into();
        parts[HOUR] = date.hour.into();
        parts[MINUTE] = date.minute.into();
        parts[SECOND] = date.second.into();
        parts[MILLISECOND] = date.millisecond;
        // What the registers have no place for would be lost.
        for part in [HOUR, MINUTE, SECOND, MILLISECOND] {
            let letter = LETTERS.get(part).unwrap_or(&0);
            if parts.get(part) != Some(&0) && !self.text.contains(letter) {
                return Err(Error::OutOfRange);
            }
        }
        Ok(parts)
    }
}

/// The number of the part that a letter stands for.
fn part_of(letter: u8) -> Option<usize> {
    LETTERS.iter().position(|one| *one == letter)
}

impl<C: RegisterBytes> Registers<C> {
    /// The date in the registers from `address` on. They follow each other in every order; one
    /// that swaps bytes swaps those of each register.
    ///
    /// # Errors
    /// [`Error::IllegalDataAddress`]; [`Error::MalformedValue`] for a date that does not exist,
    /// or a digit above 9.
    ///
    /// ```
    /// use mbm::data::clock::Layout;
    /// use mbm::data::{Order, Registers};
    ///
    /// let layout = Layout::new(b"Y M D h m s", false)?;
    /// let response = Registers::new(&[2026_u16, 11, 28, 12, 30, 0][..], 107, Order::Abcd)?;
    /// let date = response.date(&layout, Order::Abcd, 107)?;
    /// assert_eq!((date.year, date.month, date.hour), (2026, 11, 12));
    /// # Ok::<(), mbm::Error>(())
    /// ```
    pub fn date(&self, layout: &Layout, order: Order, address: u16) -> Result<Date, Error> {
        let length = 2 * usize::from(layout.registers());
        let _ = self.byte_index(address, length)?;
        let mut parts = [0; PARTS];
        for place in layout.places() {
            let word: u16 = self.get_in(order, address.wrapping_add(place.register))?;
            let raw = match (place.is_byte, place.is_low) {
                (false, _) => word,
                (true, false) => word >> 8,
                (true, true) => word & 0xFF,
            };
            let number = if place.part != NOTHING && layout.is_bcd {
                from_bcd(raw.into())? as u16
            } else {
                raw
            };
            if let Some(part) = parts.get_mut(place.part) {
                *part = number;
            }
        }
        layout.date(&parts)
    }

    /// The date in three or four registers of IEC 870-5-4: year, month and day, hour and minute,
    /// and, in the fourth, the milliseconds of the minute. An order with the low word first has
    /// them from the last one on.
    ///
    /// # Errors
    /// [`Error::IllegalDataAddress`]; [`Error::InvalidArgument`] for another count, or an order
    /// by halves; [`Error::MalformedValue`] for a date that does not exist.
    ///
    /// ```
    /// use mbm::data::{Order, Registers};
    ///
    /// let response = Registers::new(&[26_u16, 0x0B1C, 0x0C1E][..], 107, Order::Abcd)?;
    /// let date = response.iec870_date(Order::Abcd, 107, 3)?;
    /// assert_eq!((date.year, date.day, date.minute), (2026, 28, 30));
    /// # Ok::<(), mbm::Error>(())
    /// ```
    pub fn iec870_date(&self, order: Order, address: u16, count: u16) -> Result<Date, Error> {
        let [year, days, minutes, milliseconds] = iec870_places(order, count)?;
        let _ = self.byte_index(address, 2 * usize::from(count))?;
        let word = |place: u16| self.get_in::<u16>(order, address.wrapping_add(place));
        let (year, days, minutes) = (word(year)?, word(days)?, word(minutes)?);
        let milliseconds = if count == 4 { word(milliseconds)? } else { 0 };
        let flag = |bit: u16, flag: u8| if minutes & bit == 0 { 0 } else { flag };
        let date = Date {
            year: 2000 + (year & 0x7F),
            millisecond: milliseconds % 1000,
            month: (days >> 8 & 0x0F) as u8,
            day: (days & 0x1F) as u8,
            hour: (minutes >> 8 & 0x1F) as u8,
            minute: (minutes & 0x3F) as u8,
            second: (milliseconds / 1000) as u8,
            flags: flag(0x8000, SUMMER_TIME) | flag(0x80, UNRELIABLE),
        };
        if date.exists() {
            Ok(date)
        } else {
            Err(Error::MalformedValue)
        }
    }
}

impl<C: RegisterBytesMut> Registers<C> {
    /// Sets the date that [`Registers::date`] reads.
    ///
    /// # Errors
    /// [`Error::IllegalDataAddress`]; [`Error::InvalidArgument`] for a date that does not
    /// exist; [`Error::OutOfRange`] for one that the registers cannot hold exactly. Nothing is
    /// set then.
    ///
    /// ```
    /// use mbm::data::clock::Layout;
    /// use mbm::data::date::Date;
    /// use mbm::data::{Order, Registers};
    ///
    /// let date = Date { year: 2026, month: 11, day: 28, hour: 12, ..Date::default() };
    /// let mut words = [0_u16; 2];
    /// let mut registers = Registers::new(&mut words[..], 107, Order::Abcd)?;
    /// registers.set_date(&Layout::new(b"yM Dh", false)?, Order::Abcd, 107, &date)?;
    /// assert_eq!(words, [0x1A0B, 0x1C0C]);
    /// # Ok::<(), mbm::Error>(())
    /// ```
    pub fn set_date(
        &mut self,
        layout: &Layout,
        order: Order,
        address: u16,
        date: &Date,
    ) -> Result<(), Error> {
        let parts = layout.parts(date)?;
        let length = 2 * usize::from(layout.registers());
        let _ = self.byte_index(address, length)?;
        let number = |place: Place| {
            let number = parts.get(place.part).copied().unwrap_or(0);
            let raw = if layout.is_bcd {
                to_bcd(number.into(), if place.is_byte { 2 } else { 4 })? as u16
            } else {
                number
            };
            if place.is_byte && raw > 0xFF {
                return Err(Error::OutOfRange);
            }
            Ok(raw)
        };
        if layout.text.contains(&b'n') && date.year < 1900
            || layout.text.contains(&b'y') && !layout.text.contains(&b'C') && date.year < 2000
        {
            return Err(Error::OutOfRange);
        }
        for place in layout.places() {
            let _ = number(place)?;
        }
        for place in layout.places() {
            let raw = number(place)?;
            let at = address.wrapping_add(place.register);
            let word = match (place.is_byte, place.is_low) {
                (false, _) => raw,
                (true, false) => raw << 8,
                (true, true) => self.get_in::<u16>(order, at)? | raw,
            };
            self.set_in(order, at, word)?;
        }
        Ok(())
    }

    /// Sets the date that [`Registers::iec870_date`] reads. The day of the week is 0, which stands
    /// for none.
    ///
    /// # Errors
    /// As [`Registers::set_date`]; [`Error::InvalidArgument`] also for another count or an order by
    /// halves.
    ///
    /// ```
    /// use mbm::data::date::Date;
    /// use mbm::data::{Order, Registers};
    ///
    /// let date = Date { year: 2026, month: 11, day: 28, hour: 12, minute: 30, ..Date::default() };
    /// let mut words = [0_u16; 3];
    /// let mut registers = Registers::new(&mut words[..], 107, Order::Abcd)?;
    /// registers.set_iec870_date(Order::Abcd, 107, 3, &date)?;
    /// assert_eq!(words, [26, 0x0B1C, 0x0C1E]);
    /// # Ok::<(), mbm::Error>(())
    /// ```
    pub fn set_iec870_date(
        &mut self,
        order: Order,
        address: u16,
        count: u16,
        date: &Date,
    ) -> Result<(), Error> {
        let places = iec870_places(order, count)?;
        let _ = self.byte_index(address, 2 * usize::from(count))?;
        if !date.exists() || date.is_time_only() {
            return Err(Error::InvalidArgument);
        }
        let milliseconds = u16::from(date.second) * 1000 + date.millisecond;
        if date.year < 2000 || date.year > 2127 || count == 3 && milliseconds != 0 {
            return Err(Error::OutOfRange);
        }
        let flag = |flag: u8, bit: u16| if date.flags & flag == 0 { 0 } else { bit };
        let words = [
            date.year - 2000,
            u16::from(date.month) << 8 | u16::from(date.day),
            u16::from(date.hour) << 8
                | u16::from(date.minute)
                | flag(SUMMER_TIME, 0x8000)
                | flag(UNRELIABLE, 0x80),
            milliseconds,
        ];
        for (word, place) in words.iter().zip(places).take(count.into()) {
            self.set_in(order, address.wrapping_add(place), *word)?;
        }
        Ok(())
    }
}

/// Where the registers of IEC 870-5-4 are.
fn iec870_places(order: Order, count: u16) -> Result<[u16; 4], Error> {
    // An order by halves has no place for three registers.
    if !matches!(count, 3 | 4) || order.place(0, 3).is_none() {
        return Err(Error::InvalidArgument);
    }
    Ok([0, 1, 2, 3].map(|nth| order.place(nth, count).unwrap_or(0)))
}
