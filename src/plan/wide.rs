//! A number with so many bits that a sum of two is rounded only once when it becomes a float. It is
//! computed with integers, for not every processor has arithmetic on floats.

/// The bits of a significand. Its sum with another one fits in 128 bits.
const BITS: u32 = 124;

/// significand * 2^exponent. The significand is 0 or has [`BITS`] bits; the lowest of these is 1
/// too if the exact number has more bits.
#[derive(Clone, Copy, Debug)]
pub(super) struct Wide {
    pub(super) is_below: bool,
    significand: u128,
    pub(super) exponent: i32,
}

impl Wide {
    /// `number` times `multiplier`, divided by `divisor`, times 10^`power`. The multiplier is at
    /// most 2^31, the divisor less than that and not 0, and the power at most 10 or -10.
    pub(super) fn new(number: u64, multiplier: u32, divisor: u32, power: i8) -> Wide {
        let (mut multiplier, mut divisor) = (u64::from(multiplier), u64::from(divisor));
        // 10^power is 5^power * 2^power. Below 2^55 in all.
        for _ in 0..power.unsigned_abs() {
            let factor = if power < 0 {
                &mut divisor
            } else {
                &mut multiplier
            };
            (*factor, _) = times_small(*factor, 5);
        }
        let mut product = 0u128;
        for _ in 0..u64::BITS {
            product <<= 1;
            if multiplier >> 63 != 0 {
                product += u128::from(number);
            }
            multiplier <<= 1;
        }
        let mut wide = Wide {
            is_below: false,
            significand: 0,
            exponent: i32::from(power) + u128::BITS as i32,
        };
        if product == 0 {
            return wide;
        }
        let mut rest = 0u64;
        while wide.significand >> (BITS - 1) == 0 {
            rest = rest << 1 | (product >> 127) as u64;
            product <<= 1;
            wide.significand <<= 1;
            if rest >= divisor {
                rest -= divisor;
                wide.significand |= 1;
            }
            wide.exponent -= 1;
        }
        wide.significand |= u128::from(rest != 0 || product != 0);
        wide
    }

    /// The sum of two numbers.
    pub(super) fn plus(self, other: Wide) -> Wide {
        if other.significand == 0 {
            return self;
        }
        if self.significand == 0 {
            return other;
        }
        let (large, small) = if self.exponent < other.exponent {
            (other, self)
        } else {
            (self, other)
        };
        let less = shifted(small.significand, (large.exponent - small.exponent) as u32);
        let mut sum = large;
        if large.is_below == small.is_below {
            sum.significand += less;
        } else if large.significand >= less {
            sum.significand -= less;
        } else {
            sum.significand = less - large.significand;
            sum.is_below = small.is_below;
        }
        if sum.significand == 0 {
            sum.is_below = false;
            return sum;
        }
        if sum.significand >> BITS != 0 {
            sum.significand = shifted(sum.significand, 1);
            sum.exponent += 1;
        }
        while sum.significand >> (BITS - 1) == 0 {
            sum.significand <<= 1;
            sum.exponent -= 1;
        }
        sum
    }

    /// The bits of the nearest float of 64 bits; if two are equally near, of the even one.
    pub(super) fn to_bits(self) -> u64 {
        /// The bits that a float has no place for.
        const SUPERFLUOUS: u32 = BITS - 53;
        let sign = u64::from(self.is_below) << 63;
        if self.significand == 0 {
            return sign;
        }
        let mut exponent = self.exponent + (BITS as i32 - 1) + 1023;
        let mut significand = self.significand;
        if exponent >= 0x7FF {
            return sign | 0x7FF << 52;
        }
        if exponent < 1 {
            significand = shifted(significand, (1 - exponent) as u32);
            exponent = 1;
        }
        let rest = significand << (u128::BITS - SUPERFLUOUS);
        let mut bits = (significand >> SUPERFLUOUS) as u64;
        if rest > 1 << 127 || rest == 1 << 127 && bits & 1 != 0 {
            bits += 1;
        }
        // The highest bit of the significand adds 1 to the exponent.
        sign | (bits + (((exponent - 1) as u64) << 52))
    }
}

/// Shifts to the right. The lowest bit is 1 too if a bit that is 1 goes out.
fn shifted(significand: u128, places: u32) -> u128 {
    if places >= u128::BITS {
        return 1;
    }
    let kept = significand >> places;
    kept | u128::from(kept << places != significand)
}

/// A product, and what of it goes beyond 64 bits. (An AVR has no other use for a multiplication of
/// 64 bits, which shifts and sums of this number would become.)
pub(super) fn times_small(mut number: u64, factor: u16) -> (u64, u16) {
    let (mut product, mut carry) = (0u64, 0u32);
    for _ in 0..u64::BITS / u16::BITS {
        carry += u32::from(number as u16) * u32::from(factor);
        number >>= 16;
        product = product >> 16 | u64::from(carry as u16) << 48;
        carry >>= 16;
    }
    (product, carry as u16)
}
