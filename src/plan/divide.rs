//! Division for processors that have no such instruction, as a Cortex-M0+. The client has no
//! division either.

/// Divides by at most 2^31: the quotient, rounded down, and the rest.
pub fn divide(mut dividend: u32, divisor: u32) -> (u32, u32) {
    let mut rest = 0;
    for _ in 0..u32::BITS {
        rest = rest << 1 | dividend >> 31;
        dividend <<= 1;
        if rest >= divisor {
            rest = rest.wrapping_sub(divisor);
            dividend |= 1;
        }
    }
    (dividend, rest)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_quotient_is_rounded_down_and_has_a_rest() {
        for dividend in [0, 1, 9, 10, 11, 999, 1000, 86_400_000, u32::MAX] {
            for divisor in [1, 2, 3, 10, 1000, 86_400_000, 1 << 31] {
                let expected = (dividend / divisor, dividend % divisor);
                assert_eq!(divide(dividend, divisor), expected);
            }
        }
    }
}
