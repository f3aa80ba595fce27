//! Arithmetic of 64 bits for processors of 8 and 32 bits. The compiler would call functions for it
//! that not every toolchain has, and that no other code of firmware needs.

/// Shifts to the left.
pub fn shifted_left(mut number: u64, places: u8) -> u64 {
    for _ in 0..places {
        number <<= 1;
    }
    number
}

/// Shifts to the right.
pub fn shifted_right(mut number: u64, places: u8) -> u64 {
    for _ in 0..places {
        number >>= 1;
    }
    number
}

/// A product, and what of it goes beyond 64 bits.
pub fn times_small(mut number: u64, factor: u16) -> (u64, u16) {
    let (mut product, mut carry) = (0u64, 0u32);
    for _ in 0..u64::BITS / u16::BITS {
        carry += u32::from(number as u16) * u32::from(factor);
        number >>= 16;
        product = product >> 16 | u64::from(carry as u16) << 48;
        carry >>= 16;
    }
    (product, carry as u16)
}

/// The quotient, rounded down, and the rest. The divisor is not 0.
pub fn divide_small(mut number: u64, divisor: u16) -> (u64, u16) {
    let (mut quotient, mut rest) = (0u64, 0u32);
    for _ in 0..u64::BITS / u16::BITS {
        rest = rest << 16 | (number >> 48) as u32;
        number <<= 16;
        let digit = rest.checked_div(divisor.into()).unwrap_or(0);
        rest -= digit * u32::from(divisor);
        quotient = quotient << 16 | u64::from(digit);
    }
    (quotient, rest as u16)
}

#[cfg(test)]
mod tests {
    use super::*;

    const NUMBERS: [u64; 8] = [
        0,
        1,
        9_999,
        65_536,
        u32::MAX as u64,
        0x0123_4567_89AB_CDEF,
        i64::MAX as u64,
        u64::MAX,
    ];

    #[test]
    fn a_shift_is_that_of_the_language() {
        for number in NUMBERS {
            for places in 0..64 {
                assert_eq!(shifted_left(number, places), number << places);
                assert_eq!(shifted_right(number, places), number >> places);
            }
            assert_eq!(shifted_left(number, 64), 0);
            assert_eq!(shifted_right(number, 64), 0);
        }
    }

    #[test]
    fn a_product_and_a_quotient_are_those_of_the_language() {
        for number in NUMBERS {
            for small in [1, 2, 5, 10, 9_999, 10_000, 0x8000, u16::MAX] {
                let product = u128::from(number) * u128::from(small);
                let parts = (product as u64, (product >> 64) as u16);
                assert_eq!(times_small(number, small), parts);
                let (quotient, rest) = divide_small(number, small);
                assert_eq!(quotient, number / u64::from(small));
                assert_eq!(u64::from(rest), number % u64::from(small));
            }
        }
    }
}
