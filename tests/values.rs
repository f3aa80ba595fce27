//! Typed values in registers: their bytes in each word order, reading back what was written,
//! and that no register outside the given range is ever read or written.

use mbm::data::bits;
use mbm::data::clock::Layout;
use mbm::data::date::Date;
use mbm::data::order::Order;
use mbm::data::text::{Characters, TextForm};
use mbm::data::value::{ShortDouble, Value};
use mbm::data::view::{RegisterBytes, Registers};
use mbm::error::Error;
use proptest::prelude::*;
use std::fmt::Debug;

const OUTSIDE: Error = Error::IllegalDataAddress;

/// Converts data bytes to words.
fn words(bytes: &[u8]) -> Vec<u16> {
    let pairs = bytes.chunks(2);
    pairs
        .map(|pair| u16::from_be_bytes([pair[0], pair[1]]))
        .collect()
}

fn ordered<C: RegisterBytes>(cells: C, first: u16, order: Order) -> Registers<C> {
    Registers::new(cells, first, order).unwrap()
}

fn over<C: RegisterBytes>(cells: C, first: u16) -> Registers<C> {
    ordered(cells, first, Order::Abcd)
}

fn refused<C: RegisterBytes>(cells: C, first: u16) -> Option<Error> {
    Registers::new(cells, first, Order::Abcd).err()
}

/// Reads the value at address 100 from `bytes`, and checks that the same words give the same.
fn read<T: Value + PartialEq + Debug>(bytes: &[u8], order: Order) -> T {
    let words = words(bytes);
    let mut registers = over(&words[..], 100);
    let value = registers.get_in(order, 100).unwrap();
    registers.order = order;
    assert_eq!(registers.get::<T>(100), Ok(value));
    assert_eq!(over(bytes, 100).get_in::<T>(order, 100), Ok(value));
    assert_eq!(T::from_words(&words, order), Ok(value));
    value
}

/// Writes `value` and returns its bytes. Checks that writing it to words gives the same bytes.
fn written<T: Value>(value: T, order: Order) -> Vec<u8> {
    let size = size_of::<T::Bytes>();
    let mut bytes = vec![0xEE; size];
    let mut words = vec![0xEEEE_u16; size / 2];
    over(&mut bytes[..], 100).set_in(order, 100, value).unwrap();
    let mut registers = over(&mut words[..], 100);
    registers.order = order;
    registers.set(100, value).unwrap();
    let of_words: Vec<u8> = words.iter().flat_map(|word| word.to_be_bytes()).collect();
    assert_eq!(of_words, bytes);
    let mut only = vec![0xEEEE_u16; size / 2];
    value.to_words(&mut only, order).unwrap();
    assert_eq!(only, words);
    bytes
}

#[test]
fn a_double_word_has_four_orders() {
    for (order, bytes) in [
        (Order::Abcd, [0xAE, 0x41, 0x56, 0x52]),
        (Order::Cdab, [0x56, 0x52, 0xAE, 0x41]),
        (Order::Badc, [0x41, 0xAE, 0x52, 0x56]),
        (Order::Dcba, [0x52, 0x56, 0x41, 0xAE]),
    ] {
        assert_eq!(read::<u32>(&bytes, order), 2_923_517_522, "{order:?}");
        assert_eq!(read::<i32>(&bytes, order), -1_371_449_774, "{order:?}");
        assert_eq!(written(2_923_517_522_u32, order), bytes);
        assert_eq!(written(-1_371_449_774_i32, order), bytes);
    }
}

#[test]
fn floats_have_the_format_of_ieee_754() {
    for (value, [a, b, c, d]) in [
        (1.0_f32, [0x3F, 0x80, 0, 0]),
        (-2.0, [0xC0, 0, 0, 0]),
        (230.5, [0x43, 0x66, 0x80, 0]),
        (std::f32::consts::PI, [0x40, 0x49, 0x0F, 0xDB]),
        (f32::INFINITY, [0x7F, 0x80, 0, 0]),
        (f32::MIN_POSITIVE, [0, 0x80, 0, 0]),
    ] {
        for (order, bytes) in [
            (Order::Abcd, [a, b, c, d]),
            (Order::Cdab, [c, d, a, b]),
            (Order::Badc, [b, a, d, c]),
            (Order::Dcba, [d, c, b, a]),
        ] {
            assert_eq!(read::<f32>(&bytes, order), value);
            assert_eq!(written(value, order), bytes);
        }
    }
}

#[test]
fn doubles_have_the_format_of_ieee_754() {
    let [a, b, c, d, e, f, g, h] = [0x40, 0x09, 0x21, 0xFB, 0x54, 0x44, 0x2D, 0x18];
    for (order, bytes) in [
        (Order::Abcd, [a, b, c, d, e, f, g, h]),
        (Order::Cdab, [g, h, e, f, c, d, a, b]),
        (Order::Badc, [b, a, d, c, f, e, h, g]),
        (Order::Dcba, [h, g, f, e, d, c, b, a]),
    ] {
        assert_eq!(read::<f64>(&bytes, order), std::f64::consts::PI);
        assert_eq!(read::<u64>(&bytes, order), 0x4009_21FB_5444_2D18);
        assert_eq!(read::<i64>(&bytes, order), 0x4009_21FB_5444_2D18);
        assert_eq!(written(std::f64::consts::PI, order), bytes);
        assert_eq!(written(0x4009_21FB_5444_2D18_u64, order), bytes);
    }
}

#[test]
fn bits_and_bytes_of_one_register_do_not_depend_on_the_order() {
    let bytes = [0x80_u8, 0xFE];
    let registers = ordered(&bytes[..], 7, Order::Dcba);
    assert_eq!(registers.u8(7, true), Ok(0x80));
    assert_eq!(registers.u8(7, false), Ok(0xFE));
    assert_eq!(registers.i8(7, true), Ok(-128));
    assert_eq!(registers.i8(7, false), Ok(-2));
    assert_eq!(registers.bit(7, 15), Ok(true));
    assert_eq!(registers.bit(7, 14), Ok(false));
    assert_eq!(registers.bit(7, 1), Ok(true));
    assert_eq!(registers.bit(7, 0), Ok(false));
    assert_eq!(registers.bit(7, 16), Err(Error::InvalidArgument));
    assert_eq!(registers.get::<u16>(7), Ok(0xFE80));
    assert_eq!(registers.get_in::<i16>(Order::Cdab, 7), Ok(-32514));
}

#[test]
fn setting_a_bit_or_a_byte_changes_no_other() {
    let mut words = [0xAAAA_u16; 3];
    let mut registers = over(&mut words[..], 0);
    registers.set_bit(0, 0, true).unwrap();
    registers.set_bit(0, 15, false).unwrap();
    registers.set_u8(1, true, 0x12).unwrap();
    registers.set_i8(2, false, -1).unwrap();
    assert_eq!(registers.set_bit(0, 16, true), Err(Error::InvalidArgument));
    assert_eq!(registers.set_bit(3, 0, true), Err(OUTSIDE));
    assert_eq!(words, [0x2AAB, 0x12AA, 0xAAFF]);
}

#[test]
fn a_text_ends_at_its_first_nul_or_at_the_end_of_its_field() {
    let bytes = *b"METER 7\0XY";
    let registers = over(&bytes[..], 10);
    let mut buffer = [0; 8];
    assert_eq!(registers.text(10, 10, &mut buffer).unwrap(), b"METER 7");
    assert_eq!(registers.text(10, 5, &mut buffer).unwrap(), b"METER");
    assert_eq!(registers.text(14, 2, &mut buffer).unwrap(), b"XY");
    assert_eq!(registers.text(15, 0, &mut buffer).unwrap(), b"");
    assert_eq!(registers.text(14, 3, &mut buffer), Err(OUTSIDE));
    let low_word_first = registers.text_in(Order::Cdab, 10, 10, &mut buffer);
    assert_eq!(low_word_first.unwrap(), b"METER 7");
    let swapped = ordered(&b"EMET R\x007"[..], 10, Order::Badc);
    assert_eq!(swapped.text(10, 8, &mut buffer).unwrap(), b"METER 7");
    assert_eq!(swapped.text(10, 3, &mut buffer).unwrap(), b"MET");
}

#[test]
fn a_text_that_does_not_fit_into_the_buffer_is_refused() {
    let mut buffer = *b"...";
    let status = over(&b"ABCD"[..], 0).text(0, 4, &mut buffer).err();
    assert_eq!((status, &buffer), (Some(Error::BufferTooSmall), b"..."));
}

#[test]
fn a_text_is_written_and_filled_up_with_zeros() {
    let mut bytes = *b"........";
    let mut registers = over(&mut bytes[..], 0);
    registers.set_text(0, 5, b"ABC").unwrap();
    let too_long = registers.set_text(0, 5, b"ABCDEF");
    assert_eq!(too_long, Err(Error::BufferTooSmall));
    assert_eq!(registers.set_text(2, 5, b"A"), Err(OUTSIDE));
    assert_eq!(bytes, *b"ABC\0\0\0..");
    let mut registers = over(&mut bytes[..], 0);
    registers.set_text_in(Order::Dcba, 1, 4, b"ABCD").unwrap();
    assert_eq!(bytes, *b"ABBADC..");
}

#[test]
fn raw_bytes_are_copied_and_compared_in_the_order_of_the_wire() {
    let mut held = [0x0102_u16, 0x0304, 0x0506];
    let mut registers = ordered(&mut held[..], 40, Order::Dcba);
    let mut bytes = [0; 3];
    registers.bytes(41, &mut bytes).unwrap();
    assert_eq!(bytes, [3, 4, 5]);
    assert_eq!(registers.is_equal(41, &[3, 4, 5]), Ok(true));
    assert_eq!(registers.is_equal(41, &[3, 4, 6]), Ok(false));
    assert_eq!(registers.is_equal(41, &[3, 4, 5, 6, 7]), Err(OUTSIDE));
    assert_eq!(registers.is_equal(42, &[]), Ok(true));
    assert_eq!(registers.bytes(39, &mut bytes), Err(OUTSIDE));
    registers.set_bytes(40, &[9, 8, 7]).unwrap();
    assert_eq!(registers.set_bytes(42, &[1, 1, 1]), Err(OUTSIDE));
    assert_eq!(registers.is_equal(40, &[9, 8, 7]), Ok(true));
    assert_eq!(held, [0x0908, 0x0704, 0x0506]);
}

#[test]
fn the_bytes_of_a_device_that_swaps_them_are_swapped_back() {
    for order in Order::ALL {
        let wanted: &[u8] = match order.swaps_bytes() {
            false => &[1, 2, 3, 4, 5],
            true => &[2, 1, 4, 3, 6],
        };
        let mut bytes = [0; 5];
        let held = over(&[1u8, 2, 3, 4, 5, 6][..], 40);
        assert_eq!(held.bytes_in(order, 40, &mut bytes), Ok(()));
        assert_eq!(bytes, wanted);
        let mut words = [0x0909u16; 3];
        let mut written = over(&mut words[..], 40);
        assert_eq!(written.set_bytes_in(order, 40, wanted), Ok(()));
        let refused = written.set_bytes_in(order, 41, wanted);
        assert_eq!(refused, Err(Error::IllegalDataAddress));
        let last = if order.swaps_bytes() { 0x0906 } else { 0x0509 };
        assert_eq!(words, [0x0102, 0x0304, last]);
    }
}

#[test]
fn registers_end_at_address_65535() {
    let words = [1_u16, 2, 3, 4];
    let last = over(&words[..], 65532);
    assert_eq!(last.get::<u16>(65535), Ok(4));
    assert_eq!(last.get::<u32>(65535), Err(OUTSIDE));
    assert_eq!(last.get::<u64>(65532), Ok(0x0001_0002_0003_0004));
    assert_eq!(last.get::<u64>(65533), Err(OUTSIDE));
    assert_eq!(last.get::<u16>(0), Err(OUTSIDE));
    assert_eq!(refused(&words[..], 65533), Some(OUTSIDE));
    assert_eq!(refused(&[0_u8; 4][..], 65535), Some(OUTSIDE));
    assert_eq!(refused(&[0_u16; 65536][..], 0), None);
    assert_eq!(refused(&[0_u16; 65537][..], 0), Some(OUTSIDE));
    assert_eq!(refused(&mut [0_u16; 2][..], 65535), Some(OUTSIDE));
}

#[test]
fn a_number_in_words_is_in_the_first_of_them_or_refused() {
    let words = [0x4366_u16, 0x8000, 0x1234];
    assert_eq!(f32::from_words(&words, Order::Abcd), Ok(230.5));
    assert_eq!(i16::from_words(&words[2..], Order::Badc), Ok(0x3412));
    for order in Order::ALL {
        assert_eq!(f32::from_words(&words[..1], order), Err(OUTSIDE));
        assert_eq!(u64::from_words(&words, order), Err(OUTSIDE));
        assert_eq!(u16::from_words(&[], order), Err(OUTSIDE));
        let mut written = words;
        assert_eq!(1_u64.to_words(&mut written, order), Err(OUTSIDE));
        assert_eq!(written, words);
        assert_eq!(1_u16.to_words(&mut written, order), Ok(()));
        assert_eq!(written[1..], words[1..]);
    }
}

#[test]
fn an_odd_number_of_bytes_is_refused() {
    assert_eq!(refused(&[1_u8, 2, 3][..], 0), Some(Error::InvalidArgument));
    assert_eq!(refused(&mut [1_u8][..], 0), Some(Error::InvalidArgument));
}

fn any_order() -> impl Strategy<Value = Order> {
    prop::sample::select(Order::ALL.to_vec())
}

/// Writes a value, reads it back, and checks that no other word has changed.
fn round_trip<T: Value>(value: T, order: Order, address: u16, first: u16, fill: u16) {
    let size = size_of::<T::Bytes>() / 2;
    let mut words = [fill; 9];
    let mut registers = ordered(&mut words[..], first, order);
    let status = registers.set(address, value);
    let start = usize::from(address.wrapping_sub(first));
    if address < first || start + size > 9 {
        assert_eq!(status, Err(OUTSIDE));
        assert_eq!(registers.get::<T>(address).err(), Some(OUTSIDE));
        assert_eq!(words, [fill; 9]);
        return;
    }
    assert_eq!(status, Ok(()));
    let back: T = registers.get(address).unwrap();
    assert_eq!(back.to_bytes().as_ref(), value.to_bytes().as_ref());
    for (index, word) in words.iter().enumerate() {
        assert!(*word == fill || (start..start + size).contains(&index));
    }
}

proptest! {
    #[test]
    fn every_value_is_read_back_in_every_order_or_refused_as_out_of_range(
        bits: u64, order in any_order(), first in 0..65528_u16, step in -3..14_i32, fill: u16,
    ) {
        let address = (i32::from(first) + step).clamp(0, 65535) as u16;
        round_trip(bits as u16, order, address, first, fill);
        round_trip(bits as i16, order, address, first, fill);
        round_trip(bits as u32, order, address, first, fill);
        round_trip(bits as i32, order, address, first, fill);
        round_trip(bits, order, address, first, fill);
        round_trip(bits as i64, order, address, first, fill);
        round_trip(f32::from_bits(bits as u32), order, address, first, fill);
        round_trip(f64::from_bits(bits), order, address, first, fill);
    }

    #[test]
    fn every_address_and_every_length_is_handled(
        bytes in prop::collection::vec(any::<u8>(), 0..40),
        first: u16, address: u16, length in 0..200_usize, near: bool, order in any_order(),
    ) {
        let address = if near { first.saturating_add(address % 24) } else { address };
        let mut copy = bytes.clone();
        let Ok(registers) = Registers::new(&bytes[..], first, order) else {
            prop_assert!(bytes.len() % 2 == 1 || bytes.len() / 2 > 65536 - usize::from(first));
            return Ok(());
        };
        let start = 2 * (usize::from(address).wrapping_sub(first.into()) & 0xFFFF);
        let inside = address >= first && start + length + length % 2 <= bytes.len();
        let mut buffer = vec![0; length];
        let wanted = if inside { Ok(()) } else { Err(OUTSIDE) };
        prop_assert_eq!(registers.bytes(address, &mut buffer), wanted);
        if inside {
            prop_assert_eq!(&buffer[..], &bytes[start..start + length]);
            prop_assert_eq!(registers.is_equal(address, &buffer), Ok(true));
        }
        prop_assert_eq!(registers.text(address, length, &mut [0; 200]).is_ok(), inside);
        prop_assert_eq!(registers.get::<u16>(address).is_ok(), address >= first && start + 2 <= bytes.len());
        prop_assert_eq!(registers.bit(address, 3).is_ok(), registers.u8(address, true).is_ok());
        let mut registers = ordered(&mut copy[..], first, order);
        prop_assert_eq!(registers.set_bytes(address, &buffer), wanted);
        prop_assert_eq!(registers.set_text(address, length, &[]), wanted);
        prop_assert_eq!(registers.set_bit(address, 3, true), registers.set_u8(address, true, 1));
    }

    #[test]
    fn a_text_is_read_back(text in "[ -~]{0,12}", order in any_order(), length in 12..16_usize) {
        let mut words = [0xFFFF_u16; 8];
        let mut registers = ordered(&mut words[..], 0, order);
        registers.set_text(0, length, text.as_bytes()).unwrap();
        let mut buffer = [0; 16];
        prop_assert_eq!(registers.text(0, length, &mut buffer).unwrap(), text.as_bytes());
    }

    #[test]
    fn packed_bits_are_read_back_from_bytes_and_from_words(
        coils in prop::collection::vec(any::<bool>(), 0..100), first in 0..65436_u16, address: u16,
    ) {
        let mut bytes = [0xAA_u8; 13];
        let mut words = [0xAAAA_u16; 7];
        bits::pack(&mut bytes, coils.iter().copied()).unwrap();
        bits::pack(&mut words, coils.iter().copied()).unwrap();
        prop_assert!(bits::unpack(&bytes, coils.len()).unwrap().eq(coils.iter().copied()));
        prop_assert!(bits::unpack(&words, coils.len()).unwrap().eq(coils.iter().copied()));
        let quantity = coils.len() as u16;
        for address in (first..first + 100).chain([address]) {
            let coil = coils.get(usize::from(address.wrapping_sub(first)));
            let wanted = coil.copied().ok_or(OUTSIDE);
            prop_assert_eq!(bits::is_set(&bytes, first, quantity, address), wanted);
            prop_assert_eq!(bits::is_set(&words, first, quantity, address), wanted);
        }
    }

    #[test]
    fn a_double_is_rounded_to_the_nearest_float(bits: u64, exponent in 870..1160_u64, near: bool) {
        // Most doubles are out of the range of a float. Half of these are moved near it.
        let bits = if near { bits & 0x800F_FFFF_FFFF_FFFF | exponent << 52 } else { bits };
        let value = f64::from_bits(bits);
        let short = ShortDouble::from_bytes(bits.to_be_bytes()).0;
        prop_assert_eq!(short.is_nan(), value.is_nan());
        if !value.is_nan() {
            prop_assert_eq!(short.to_bits(), (value as f32).to_bits());
            let wide = f64::from_be_bytes(ShortDouble(short).to_bytes());
            prop_assert_eq!(wide.to_bits(), f64::from(short).to_bits());
        }
    }
}

// --- numbers, texts and dates of other forms in registers: every number that a form holds is read
// back as it was written, in every order, and no register beside it is touched; every other number
// is refused ---

type Words<'a> = Registers<&'a mut [u16]>;

const FIRST: u16 = 65529;
const FILL: u16 = 0xA5C3;

/// Writes a value at each address, and reads it back where its registers are.
fn round_trip_of<T: Copy + PartialEq + std::fmt::Debug>(
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
        round_trip_of(count, within, |to, at, number| to.set_m10k(order, at, count, number),
            |of, at| of.m10k(order, at, count));
        for signed in [signed, -signed] {
            round_trip_of(count, signed, |to, at, number| to.set_signed_m10k(order, at, count, number),
                |of, at| of.signed_m10k(order, at, count));
        }
        if count < 4 {
            out_of_range(|to| to.set_m10k(order, FIRST, count, most + within));
            out_of_range(|to| to.set_signed_m10k(order, FIRST, count, -(most.cast_signed()) - signed));
        }
        if count <= 2 {
            let (within, most) = (within as u32, most as u32);
            round_trip_of(count, within, |to, at, number| to.set_bcd(order, at, count, number),
                |of, at| of.bcd(order, at, count));
            out_of_range(|to| to.set_bcd(order, FIRST, count, most + within));
        }
    }

    #[test]
    fn integers_of_24_and_48_bits_are_read_back(
        raw in any::<u64>(), order in any_order(), whole in whole_order()
    ) {
        let (short, long) = (raw as u32 >> 8, raw >> 16);
        round_trip_of(2, short, |to, at, number| to.set_u24(order, at, number),
            |of, at| of.u24(order, at));
        round_trip_of(2, (raw as i32) >> 8, |to, at, number| to.set_i24(order, at, number),
            |of, at| of.i24(order, at));
        round_trip_of(3, long, |to, at, number| to.set_u48(whole, at, number),
            |of, at| of.u48(whole, at));
        round_trip_of(3, (raw as i64) >> 16, |to, at, number| to.set_i48(whole, at, number),
            |of, at| of.i48(whole, at));
        out_of_range(|to| to.set_u24(order, FIRST, 0x0100_0000 | short));
        out_of_range(|to| to.set_i24(order, FIRST, 0x0080_0000 | (short as i32)));
        out_of_range(|to| to.set_u48(whole, FIRST, 1 << 48 | long));
        out_of_range(|to| to.set_i48(whole, FIRST, 1 << 47 | (long as i64)));
    }

    #[test]
    fn signs_and_amounts_are_read_back(number in any::<i32>(), order in any_order()) {
        let number = number.max(-i32::MAX);
        round_trip_of(2, number, |to, at, number| to.set_sign_magnitude(order, at, 2, number),
            |of, at| of.sign_magnitude(order, at, 2));
        let short = number >> 16;
        round_trip_of(1, short.max(-32767), |to, at, number| to.set_sign_magnitude(order, at, 1, number),
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
        round_trip_of(7, date, |to, at, date| to.set_date(&full, order, at, &date),
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
                round_trip_of(layout.registers(), whole_second,
                    |to, at, date| to.set_date(&layout, order, at, &date),
                    |of, at| of.date(&layout, order, at));
            } else {
                out_of_range(|to| to.set_date(&layout, order, FIRST, &whole_second));
            }
        }
        if (2000..=2127).contains(&date.year) {
            round_trip_of(4, date, |to, at, date| to.set_iec870_date(whole, at, 4, &date),
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
