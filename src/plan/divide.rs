//! Division for processors without: a Cortex-M0+ lacks it, and so does the client.

/// Divides, rounded down.
pub fn quotient(mut dividend: u32, divisor: u32) -> u32 {
    let mut result = 0;
    for shift in (0..u32::BITS).rev() {
        if dividend >> shift >= divisor {
            dividend = dividend.wrapping_sub(divisor << shift);
            result |= 1 << shift;
        }
    }
    result
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_quotient_is_rounded_down() {
        for dividend in [0, 1, 9, 10, 11, 999, 1000, 86_400_000, u32::MAX] {
            for divisor in [1, 2, 3, 10, 1000, u32::MAX - 1, u32::MAX] {
                assert_eq!(quotient(dividend, divisor), dividend / divisor);
            }
        }
    }
}
