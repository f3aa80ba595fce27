//! A number with so many bits that a sum of two is rounded only once when it becomes a float. It is
//! computed with integers, for not every processor has arithmetic on floats.

use crate::data::arithmetic::times_small;

/// The bits of a significand. Its sum with another one fits in 128 bits.
const BITS: u32 = 124;

/// An integer of 128 bits. It is shifted by one place at a time: the compiler would call functions
/// to shift it by any number, or make code that fits in no register of a small processor.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct Long {
    high: u64,
    low: u64,
}

impl Long {
    const ZERO: Long = Long { high: 0, low: 0 };

    fn is_zero(&self) -> bool {
        *self == Long::ZERO
    }

    /// True if it has [`BITS`] bits or more.
    fn is_full(&self) -> bool {
        self.high >> (BITS - 1 - u64::BITS) != 0
    }

    fn double(&mut self) {
        self.high = self.high << 1 | self.low >> 63;
        self.low <<= 1;
    }

    /// Shifts to the right. The lowest bit is 1 too if a bit that is 1 goes out.
    fn shift_right(&mut self, places: u32) {
        // After 128 places only that bit is left.
        for _ in 0..places.min(u128::BITS) {
            self.low = self.low >> 1 | self.high << 63 | self.low & 1;
            self.high >>= 1;
        }
    }

    fn add(&mut self, other: Long) {
        let (low, is_over) = self.low.overflowing_add(other.low);
        self.low = low;
        self.high += other.high + u64::from(is_over);
    }

    /// Subtracts what is not more.
    fn subtract(&mut self, other: Long) {
        let (low, is_under) = self.low.overflowing_sub(other.low);
        self.low = low;
        self.high -= other.high + u64::from(is_under);
    }
}

/// significand * 2^exponent. The significand is 0 or has [`BITS`] bits; the lowest of these is 1
/// too if the exact number has more bits.
#[derive(Clone, Copy, Debug)]
pub(super) struct Wide {
    pub(super) is_below: bool,
    significand: Long,
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
        let number = Long {
            high: 0,
            low: number,
        };
        let mut product = Long::ZERO;
        for _ in 0..u64::BITS {
            product.double();
            if multiplier >> 63 != 0 {
                product.add(number);
            }
            multiplier <<= 1;
        }
        let mut wide = Wide {
            is_below: false,
            significand: Long::ZERO,
            exponent: i32::from(power) + u128::BITS as i32,
        };
        if product.is_zero() {
            return wide;
        }
        let mut rest = 0u64;
        while !wide.significand.is_full() {
            rest = rest << 1 | product.high >> 63;
            product.double();
            wide.significand.double();
            if rest >= divisor {
                rest -= divisor;
                wide.significand.low |= 1;
            }
            wide.exponent -= 1;
        }
        wide.significand.low |= u64::from(rest != 0 || !product.is_zero());
        wide
    }

    /// The sum of two numbers.
    pub(super) fn plus(self, other: Wide) -> Wide {
        if other.significand.is_zero() {
            return self;
        }
        if self.significand.is_zero() {
            return other;
        }
        let (mut sum, mut small) = if self.exponent < other.exponent {
            (other, self)
        } else {
            (self, other)
        };
        small
            .significand
            .shift_right((sum.exponent - small.exponent) as u32);
        if sum.is_below == small.is_below {
            sum.significand.add(small.significand);
        } else {
            if sum.significand < small.significand {
                (sum.significand, small.significand) = (small.significand, sum.significand);
                sum.is_below = small.is_below;
            }
            sum.significand.subtract(small.significand);
        }
        if sum.significand.is_zero() {
            sum.is_below = false;
            return sum;
        }
        if sum.significand.high >> (BITS - u64::BITS) != 0 {
            sum.significand.shift_right(1);
            sum.exponent += 1;
        }
        while !sum.significand.is_full() {
            sum.significand.double();
            sum.exponent -= 1;
        }
        sum
    }

    /// The bits of the nearest float of 64 bits; if two are equally near, of the even one.
    pub(super) fn to_bits(self) -> u64 {
        /// The bits of the high half that a float has no place for, beside the low half.
        const SUPERFLUOUS: u32 = BITS - 53 - u64::BITS;
        const HALF: Long = Long {
            high: 1 << (SUPERFLUOUS - 1),
            low: 0,
        };
        let sign = u64::from(self.is_below) << 63;
        let mut significand = self.significand;
        if significand.is_zero() {
            return sign;
        }
        let mut exponent = self.exponent + (BITS as i32 - 1) + 1023;
        if exponent >= 0x7FF {
            return sign | 0x7FF << 52;
        }
        if exponent < 1 {
            significand.shift_right((1 - exponent) as u32);
            exponent = 1;
        }
        let mut bits = significand.high >> SUPERFLUOUS;
        significand.high &= (1 << SUPERFLUOUS) - 1;
        if significand > HALF || significand == HALF && bits & 1 != 0 {
            bits += 1;
        }
        // The highest bit of the significand adds 1 to the exponent.
        sign | (bits + (((exponent - 1) as u64) << 52))
    }
}
