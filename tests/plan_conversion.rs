//! Values with an offset and a power of ten, against exact arithmetic; and what is not available.

use mbm::data::order::Order;
use mbm::error::Error;
use mbm::plan::conversion::power;
use mbm::plan::field::{
    BIT, DOUBLE, FLOAT, HOLDING_REGISTERS, INT16, INT32, INT64, REGISTERS, TEXT, UINT16, UINT32,
    UINT64,
};
use mbm::plan::value::Words;
use mbm::plan::{Conversion, Field};
use proptest::prelude::*;

fn field(value_type: u8) -> Field {
    Field {
        unit: 1,
        table: HOLDING_REGISTERS,
        value_type,
        interval_ms: 1000,
        ..Field::NONE
    }
}

/// The lowest `count` words of a number, the most significant first.
fn words(number: u64, count: usize) -> Vec<u16> {
    (0..count)
        .rev()
        .map(|place| (number >> (16 * place)) as u16)
        .collect()
}

fn of<'a>(words: &'a [u16], field: &'a Field) -> Words<'a> {
    Words {
        words,
        before: 0,
        field,
    }
}

fn available(value_type: u8, number: u64, count: usize, conversion: &Conversion) -> bool {
    let field = field(value_type);
    match of(&words(number, count), &field).available(conversion) {
        Ok(()) => true,
        Err(refused) => {
            assert_eq!(refused, Error::NotAvailable);
            false
        }
    }
}

const NONE: Conversion = Conversion {
    not_available: &[],
    is_standard: false,
    offset: 0,
    offset_decimals: 0,
};
const STANDARD: Conversion = Conversion {
    is_standard: true,
    ..NONE
};

#[test]
fn the_standard_number_of_each_type_is_not_available() {
    for (value_type, number, count) in [
        (INT16, 0x8000, 1),
        (UINT16, 0xFFFF, 1),
        (INT32, 0x8000_0000, 2),
        (UINT32, 0xFFFF_FFFF, 2),
        (INT64, 0x8000_0000_0000_0000, 4),
        (UINT64, u64::MAX, 4),
        (TEXT, 0, 1),
        (REGISTERS, 0, 1),
    ] {
        assert!(
            !available(value_type, number, count, &STANDARD),
            "{value_type}"
        );
        assert!(available(value_type, number, count, &NONE), "{value_type}");
        for other in [1, 0x7FFF, number ^ 1, number ^ 0x100] {
            assert!(
                available(value_type, other, count, &STANDARD),
                "{value_type} {other:x}"
            );
        }
    }
    // 0 is a number of a counter.
    assert!(available(UINT32, 0, 2, &STANDARD));
    // Another width has another number.
    assert!(available(UINT32, 0xFFFF, 2, &STANDARD));
    assert!(available(INT32, 0x8000, 2, &STANDARD));
}

#[test]
fn a_float_that_is_not_a_number_is_never_available() {
    for bits in [0x7FC0_0000, 0xFFC0_0000, 0x7F80_0001, 0xFFFF_FFFF] {
        assert!(!available(FLOAT, bits, 2, &NONE));
    }
    for bits in [0, 0x8000_0000, 0x7F80_0000, 0xFF80_0000, 0x7F7F_FFFF] {
        assert!(available(FLOAT, bits, 2, &STANDARD));
    }
    for bits in [0x7FF8 << 48, 0xFFF8 << 48, 0x7FF0 << 48 | 1, u64::MAX] {
        assert!(!available(DOUBLE, bits, 4, &NONE));
    }
    for bits in [0, 0x8000 << 48, 0x7FF0 << 48, 0xFFF0 << 48] {
        assert!(available(DOUBLE, bits, 4, &STANDARD));
    }
}

#[test]
fn a_listed_number_is_not_available_in_every_order() {
    let orders = [Order::Abcd, Order::Cdab, Order::Badc, Order::Dcba];
    for (number_of_order, order) in (1..).zip(orders) {
        for (value_type, number, count) in [
            (UINT16, 0x7FFF, 1),
            (INT32, 0x7FFF_FFFF, 2),
            (UINT64, 0x0123_4567_89AB_CDEF, 4),
            (FLOAT, 0xC479_C000, 2),
        ] {
            let listed = [words(5, count), words(number, count)].concat();
            let conversion = Conversion {
                not_available: &listed,
                ..NONE
            };
            let mut own = field(value_type);
            own.order = number_of_order;
            let size = 2 * count;
            let mut bytes: Vec<u8> = (0..size).map(|_| 0).collect();
            for (place, byte) in number.to_be_bytes()[8 - size..].iter().enumerate() {
                bytes[place ^ order.mask(size)] = *byte;
            }
            let sent: Vec<u16> = bytes
                .chunks(2)
                .map(|pair| u16::from_be_bytes([pair[0], pair[1]]))
                .collect();
            let refused = of(&sent, &own).available(&conversion);
            assert_eq!(refused, Err(Error::NotAvailable));
            assert_eq!(of(&sent, &own).available(&NONE), Ok(()));
        }
    }
}

#[test]
fn bits_of_a_register_are_listed_as_their_number() {
    let own = Field {
        bit: 4,
        count: 3,
        ..field(BIT)
    };
    let conversion = Conversion {
        not_available: &[7],
        ..STANDARD
    };
    assert_eq!(
        of(&[0x0070], &own).available(&conversion),
        Err(Error::NotAvailable)
    );
    assert_eq!(of(&[0xFF6F], &own).available(&conversion), Ok(()));
}

#[test]
fn a_power_that_is_not_minus_10_to_10_makes_a_value_not_available() {
    for number in -10..=10_i16 {
        assert_eq!(
            power(&of(&[number as u16], &field(INT16))),
            Ok(number as i8)
        );
    }
    for number in [-11, 11, i16::MIN, i16::MAX] {
        let refused = power(&of(&[number as u16], &field(INT16)));
        assert_eq!(refused, Err(Error::NotAvailable));
    }
    assert_eq!(
        power(&of(&[0x4120, 0], &field(FLOAT))),
        Err(Error::InvalidArgument)
    );
    assert_eq!(power(&of(&[0xFFFF, 0xFFFE], &field(INT32))), Ok(-2));
}

#[test]
fn an_offset_of_a_float_is_added_to_its_exact_product() {
    let value = |number: f32, multiplier, offset, offset_decimals, power| {
        let own = Field {
            multiplier,
            ..field(FLOAT)
        };
        let conversion = Conversion {
            offset,
            offset_decimals,
            ..NONE
        };
        let words = words(number.to_bits().into(), 2);
        of(&words, &own)
            .converted(&conversion, power)
            .map(f64::from_bits)
    };
    assert_eq!(value(300.0, 0, -27315, 2, 0), Ok(26.85));
    assert_eq!(value(-1.5, -2, 5, 1, 2), Ok(300.5));
    assert_eq!(value(f32::INFINITY, -1, 5, 0, -10), Ok(f64::NEG_INFINITY));
    assert_eq!(value(f32::NAN, 1, 5, 0, 0), Err(Error::NotAvailable));
    assert_eq!(value(1e-45, 1, 1, 9, 0), Ok(1e-9));
    assert_eq!(value(f32::MAX, 1, 1, 9, 0), Ok(f32::MAX.into()));
    assert_eq!(value(0.0, 1, -27315, 2, 0), Ok(-273.15));
    assert_eq!(value(273.0, 1, -273, 0, 0), Ok(0.0));
}

#[test]
fn a_float_too_large_or_too_small_for_a_float_of_64_bits_is_infinite_or_rounded() {
    let value = |number: f64, power| {
        let own = field(DOUBLE);
        let words = words(number.to_bits(), 4);
        f64::from_bits(of(&words, &own).converted(&NONE, power).expect("a number"))
    };
    assert_eq!(value(f64::MAX, 1), f64::INFINITY);
    assert_eq!(value(-1e300, 10), f64::NEG_INFINITY);
    assert_eq!(value(5e-324, -1), 0.0);
    assert_eq!(value(5e-324, 1), 5e-323);
    assert_eq!(value(2.5e-315, -8), 2.5e-323);
    assert_eq!(value(f64::MIN_POSITIVE, 0), f64::MIN_POSITIVE);
}

#[test]
fn wrong_arguments_are_refused() {
    let own = field(UINT16);
    let deep = Conversion {
        offset_decimals: 10,
        ..NONE
    };
    assert_eq!(
        of(&[1], &own).converted(&deep, 0),
        Err(Error::InvalidArgument)
    );
    assert_eq!(
        of(&[1], &own).decimal(&deep, 0, 0),
        Err(Error::InvalidArgument)
    );
    assert_eq!(
        of(&[1], &own).decimal(&NONE, 0, 10),
        Err(Error::InvalidArgument)
    );
    for value_type in [TEXT, REGISTERS] {
        let refused = of(&[1], &field(value_type)).converted(&NONE, 0);
        assert_eq!(refused, Err(Error::InvalidArgument));
    }
    for value_type in [UINT64, INT64, FLOAT, DOUBLE, TEXT, REGISTERS] {
        let refused = of(&[1, 1, 1, 1], &field(value_type)).decimal(&NONE, 0, 0);
        assert_eq!(refused, Err(Error::InvalidArgument));
    }
}

#[test]
fn a_decimal_that_does_not_fit_is_out_of_range() {
    let own = field(UINT32);
    let all = [0xFFFF, 0xFFFF];
    assert_eq!(of(&all, &own).decimal(&NONE, 0, 0), Err(Error::OutOfRange));
    assert_eq!(of(&all, &own).decimal(&NONE, -1, 0), Ok(429_496_730));
    assert_eq!(of(&all, &own).decimal(&NONE, 10, 9), Err(Error::OutOfRange));
    let own = field(INT32);
    assert_eq!(of(&[0x8000, 0], &own).decimal(&NONE, 0, 0), Ok(i32::MIN));
    assert_eq!(
        of(&[0x7FFF, 0xFFFF], &own).decimal(&NONE, 0, 0),
        Ok(i32::MAX)
    );
}

proptest! {
    #[test]
    fn a_converted_integer_is_the_float_nearest_to_the_exact_value(
        number in any::<i64>(),
        less in 0u32..64,
        value_type in UINT16..=INT64,
        multiplier in any::<i16>(),
        divisor in prop::sample::select(vec![0, 1, 2, 5, 8, 10, 100, 125, 1000, 1_000_000]),
        offset in any::<i32>(),
        offset_decimals in 0u8..=9,
        power in -10i8..=10,
    ) {
        let count = 1usize << (value_type / 2 - 1);
        let bits = (number >> less) as u64;
        let own = Field { multiplier: multiplier.into(), divisor, ..field(value_type) };
        let conversion = Conversion { offset, offset_decimals, ..NONE };
        let words = words(bits, count);
        let value = of(&words, &own).converted(&conversion, power).expect("a value");
        let number: i128 = match value_type {
            UINT16 => (bits as u16).into(),
            INT16 => (bits as i16).into(),
            UINT32 => (bits as u32).into(),
            INT32 => (bits as i32).into(),
            UINT64 => bits.into(),
            _ => (bits as i64).into(),
        };
        // In units of 10^-19.
        let or_1 = |number: i32| i128::from(if number == 0 { 1 } else { number });
        let product = number * or_1(multiplier.into()) * (1_000_000_000 / or_1(divisor));
        let shift = i32::from(power) + 10;
        let Some(product) = product.checked_mul(10i128.pow(shift as u32)) else {
            return Ok(());
        };
        let offset = i128::from(offset) * 10i128.pow(19 - u32::from(offset_decimals));
        let exact: f64 = format!("{}e-19", product + offset).parse().expect("a number");
        prop_assert_eq!(f64::from_bits(value), exact);
    }

    #[test]
    fn a_decimal_is_the_exact_value_rounded_half_away_from_0(
        number in any::<i32>(),
        less in 0u32..32,
        value_type in UINT16..=INT32,
        multiplier in any::<i16>(),
        divisor in 0i32..=30000,
        offset in any::<i32>(),
        far in 0u32..32,
        offset_decimals in 0u8..=9,
        power in -10i8..=10,
        decimals in 0u8..=9,
    ) {
        let count = 1usize << (value_type / 2 - 1);
        let bits = (number >> less) as u32;
        let offset = offset >> far;
        let own = Field { multiplier: multiplier.into(), divisor, ..field(value_type) };
        let conversion = Conversion { offset, offset_decimals, ..NONE };
        let words = words(bits.into(), count);
        let number: i128 = match value_type {
            UINT16 => (bits as u16).into(),
            INT16 => (bits as i16).into(),
            UINT32 => bits.into(),
            _ => (bits as i32).into(),
        };
        let or_1 = |number: i32| i128::from(if number == 0 { 1 } else { number });
        let of_number = i32::from(power) + i32::from(decimals);
        let of_offset = i32::from(decimals) - i32::from(offset_decimals);
        let less = 0.max(-of_number).max(if offset == 0 { 0 } else { -of_offset });
        let ten = |power: i32| 10i128.pow(power.max(0) as u32);
        // Both terms and their denominator, which have less than 2^127.
        let product = number * or_1(multiplier.into()) * ten(of_number + less);
        let added = i128::from(offset) * or_1(divisor) * ten(of_offset + less);
        let denominator = or_1(divisor) * ten(less);
        let sum = product + added;
        let rounded = (2 * sum.abs() + denominator) / (2 * denominator) * sum.signum();
        match of(&words, &own).decimal(&conversion, power, decimals) {
            Ok(value) => prop_assert_eq!(i128::from(value), rounded),
            Err(refused) => {
                prop_assert_eq!(refused, Error::OutOfRange);
                let is_wide = [product, added, denominator]
                    .iter()
                    .any(|number| number.abs() >= 1 << 64);
                prop_assert!(is_wide || i32::try_from(rounded).is_err());
            }
        }
    }
}
