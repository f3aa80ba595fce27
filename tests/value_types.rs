//! Numbers, texts and dates of other forms in registers: every number that a form holds is read
//! back as it was written, in every order, and no register beside it is touched; every other
//! number is refused.

use mbm::data::clock::Layout;
use mbm::data::date::Date;
use mbm::data::order::Order;
use mbm::data::text::{Characters, TextForm};
use mbm::data::view::Registers;
use mbm::error::Error;
use proptest::prelude::*;

type Words<'a> = Registers<&'a mut [u16]>;

const FIRST: u16 = 65529;
const FILL: u16 = 0xA5C3;

/// Writes a value at each address, and reads it back where its registers are.
fn round_trip<T: Copy + PartialEq + std::fmt::Debug>(
    count: u16,
    value: T,
    set: impl Fn(&mut Words, u16, T) -> Result<(), Error>,
    get: impl Fn(&Words, u16) -> Result<T, Error>,
) {
    for address in 65527..=65535 {
        let mut words = [FILL; 7];
        let mut registers = Registers::new(&mut words[..], FIRST, Order::Abcd).unwrap();
        let status = set(&mut registers, address, value);
        if address < FIRST || u32::from(address) + u32::from(count) > 0x1_0000 {
            assert_eq!(status, Err(Error::IllegalDataAddress));
            assert_eq!(get(&registers, address), Err(Error::IllegalDataAddress));
            assert_eq!(words, [FILL; 7]);
            continue;
        }
        assert_eq!(status, Ok(()));
        assert_eq!(get(&registers, address), Ok(value));
        for (place, word) in words.iter().enumerate() {
            let is_of_value = (usize::from(address - FIRST)..).take(count.into());
            assert!(*word == FILL || is_of_value.into_iter().any(|own| own == place));
        }
    }
}

/// Asserts that a call is refused as out of range, and sets nothing.
fn out_of_range(set: impl Fn(&mut Words) -> Result<(), Error>) {
    let mut words = [FILL; 7];
    let mut registers = Registers::new(&mut words[..], FIRST, Order::Abcd).unwrap();
    assert_eq!(set(&mut registers), Err(Error::OutOfRange));
    assert_eq!(words, [FILL; 7]);
}

fn any_order() -> impl Strategy<Value = Order> {
    prop::sample::select(Order::ALL.to_vec())
}

/// An order that three registers have too.
fn whole_order() -> impl Strategy<Value = Order> {
    prop::sample::select(Order::ALL[..4].to_vec())
}

fn any_date() -> impl Strategy<Value = Date> {
    (-62_135_596_800_i64..253_402_300_800, 0u16..1000).prop_map(|(seconds, millisecond)| Date {
        millisecond,
        ..Date::of_seconds(seconds).unwrap()
    })
}

proptest! {
    #[test]
    fn decimal_digits_are_read_back(
        number in 0u64..=9_999_999_999_999_999,
        count in 1u16..=4,
        order in whole_order(),
        less in 0u32..40,
    ) {
        let most = 10_000_u64.pow(count.into());
        let (within, signed) = ((number >> less) % most, ((number >> less) % most).cast_signed());
        round_trip(count, within, |to, at, number| to.set_m10k(order, at, count, number),
            |of, at| of.m10k(order, at, count));
        for signed in [signed, -signed] {
            round_trip(count, signed, |to, at, number| to.set_signed_m10k(order, at, count, number),
                |of, at| of.signed_m10k(order, at, count));
        }
        if count < 4 {
            out_of_range(|to| to.set_m10k(order, FIRST, count, most + within));
            out_of_range(|to| to.set_signed_m10k(order, FIRST, count, -(most.cast_signed()) - signed));
        }
        if count <= 2 {
            let (within, most) = (within as u32, most as u32);
            round_trip(count, within, |to, at, number| to.set_bcd(order, at, count, number),
                |of, at| of.bcd(order, at, count));
            out_of_range(|to| to.set_bcd(order, FIRST, count, most + within));
        }
    }

    #[test]
    fn integers_of_24_and_48_bits_are_read_back(
        raw in any::<u64>(), order in any_order(), whole in whole_order()
    ) {
        let (short, long) = (raw as u32 >> 8, raw >> 16);
        round_trip(2, short, |to, at, number| to.set_u24(order, at, number),
            |of, at| of.u24(order, at));
        round_trip(2, (raw as i32) >> 8, |to, at, number| to.set_i24(order, at, number),
            |of, at| of.i24(order, at));
        round_trip(3, long, |to, at, number| to.set_u48(whole, at, number),
            |of, at| of.u48(whole, at));
        round_trip(3, (raw as i64) >> 16, |to, at, number| to.set_i48(whole, at, number),
            |of, at| of.i48(whole, at));
        out_of_range(|to| to.set_u24(order, FIRST, 0x0100_0000 | short));
        out_of_range(|to| to.set_i24(order, FIRST, 0x0080_0000 | (short as i32)));
        out_of_range(|to| to.set_u48(whole, FIRST, 1 << 48 | long));
        out_of_range(|to| to.set_i48(whole, FIRST, 1 << 47 | (long as i64)));
    }

    #[test]
    fn signs_and_amounts_are_read_back(number in any::<i32>(), order in any_order()) {
        let number = number.max(-i32::MAX);
        round_trip(2, number, |to, at, number| to.set_sign_magnitude(order, at, 2, number),
            |of, at| of.sign_magnitude(order, at, 2));
        let short = number >> 16;
        round_trip(1, short.max(-32767), |to, at, number| to.set_sign_magnitude(order, at, 1, number),
            |of, at| of.sign_magnitude(order, at, 1));
        if !(-32767..=32767).contains(&number) {
            out_of_range(|to| to.set_sign_magnitude(order, FIRST, 1, number));
        }
    }

    #[test]
    fn bits_of_a_field_are_read_back_and_leave_the_others(
        raw in any::<u64>(),
        count in 1u16..=4,
        first in 0u8..64,
        bits in 1u8..=64,
        order in whole_order(),
    ) {
        let mut words = [FILL; 7];
        let mut registers = Registers::new(&mut words[..], FIRST, order).unwrap();
        let before = registers.raw(order, FIRST, count).unwrap();
        let number = raw >> (64 - bits);
        let status = registers.set_bits(order, FIRST, count, first, bits, number);
        if u16::from(first) + u16::from(bits) > 16 * count {
            prop_assert_eq!(status, Err(Error::InvalidArgument));
            prop_assert_eq!(words, [FILL; 7]);
        } else {
            prop_assert_eq!(status, Ok(()));
            prop_assert_eq!(registers.bits(order, FIRST, count, first, bits), Ok(number));
            let mask = u64::MAX >> (64 - bits) << first;
            let after = registers.raw(order, FIRST, count).unwrap();
            prop_assert_eq!(after & !mask, before & !mask);
        }
    }

    #[test]
    fn texts_are_read_back_in_every_form(
        text in prop::collection::vec(1u8.., 0..=4),
        has_spaces in any::<bool>(),
        order in any_order(),
    ) {
        prop_assume!(!has_spaces || text.last() != Some(&b' '));
        for characters in [Characters::Both, Characters::Low, Characters::High] {
            let form = TextForm { characters, has_spaces };
            let mut words = [FILL; 7];
            let mut registers = Registers::new(&mut words[..], FIRST, order).unwrap();
            registers.set_text_of(form, order, FIRST, 4, &text).unwrap();
            let mut buffer = [0; 4];
            let back = registers.text_of(form, order, FIRST, 4, &mut buffer).unwrap();
            prop_assert_eq!(&*back, &text[..]);
            prop_assert_eq!(&words[form.registers(4)..], &[FILL; 7][form.registers(4)..]);
        }
    }

    #[test]
    fn dates_are_read_back_in_every_layout(date in any_date(), order in any_order(), whole in whole_order()) {
        let full = Layout::new(b"Y M D h m s f", false).unwrap();
        round_trip(7, date, |to, at, date| to.set_date(&full, order, at, &date),
            |of, at| of.date(&full, order, at));
        let whole_second = Date { millisecond: 0, ..date };
        for (text, is_bcd, years) in [
            ("yM Dh ms", false, 2000..=2255),
            ("nM Dh ms", false, 1900..=2155),
            ("Cy MD hm s-", true, 1..=9999),
            ("s m h D M Y", true, 1..=9999),
            ("sm hD My", true, 2000..=2099),
        ] {
            let layout = Layout::new(text.as_bytes(), is_bcd).unwrap();
            if years.contains(&date.year) {
                round_trip(layout.registers(), whole_second,
                    |to, at, date| to.set_date(&layout, order, at, &date),
                    |of, at| of.date(&layout, order, at));
            } else {
                out_of_range(|to| to.set_date(&layout, order, FIRST, &whole_second));
            }
        }
        if (2000..=2127).contains(&date.year) {
            round_trip(4, date, |to, at, date| to.set_iec870_date(whole, at, 4, &date),
                |of, at| of.iec870_date(whole, at, 4));
        } else {
            out_of_range(|to| to.set_iec870_date(whole, FIRST, 4, &date));
        }
    }
}

#[test]
fn a_layout_has_as_many_registers_as_groups() {
    for (text, count) in [("hm", 1), ("h m", 2), ("Y M D h m s f", 7), ("MD nh ms", 3)] {
        let layout = Layout::new(text.as_bytes(), false).unwrap();
        assert_eq!(layout.registers(), count);
    }
}
