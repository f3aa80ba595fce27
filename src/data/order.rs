//! The order of a value's bytes in registers.

/// The order in which a device sends the bytes of a value of two registers: A is the most
/// significant byte, D the least significant. A value of four registers is ordered in the
/// same way.
///
/// The standard defines the byte order of one register, high byte first. It defines no
/// order for values of several registers, so devices use each of these.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub enum Order {
    /// High word first, high byte first. Most devices use this order.
    #[default]
    Abcd,
    /// Low word first, high byte first.
    Cdab,
    /// High word first, low byte first.
    Badc,
    /// Low word first, low byte first.
    Dcba,
}

impl Order {
    /// All four orders.
    pub const ALL: [Order; 4] = [Order::Abcd, Order::Cdab, Order::Badc, Order::Dcba];

    /// True if the low byte of each register comes first.
    pub const fn swaps_bytes(self) -> bool {
        matches!(self, Order::Badc | Order::Dcba)
    }

    /// True if the least significant register comes first.
    pub const fn low_word_first(self) -> bool {
        matches!(self, Order::Cdab | Order::Dcba)
    }

    /// The mask that converts byte positions of a value of `size` bytes (2, 4 or 8). The
    /// byte at position `n` of the value, counted from the most significant byte, is byte
    /// `n ^ mask` on the wire.
    pub const fn mask(self, size: usize) -> usize {
        let word = if self.low_word_first() {
            size.saturating_sub(2)
        } else {
            0
        };
        word + self.swaps_bytes() as usize
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn laid_out<const N: usize>(value: [u8; N]) -> [[u8; N]; 4] {
        Order::ALL.map(|order| core::array::from_fn(|place| value[place ^ order.mask(N)]))
    }

    #[test]
    fn the_name_of_each_order_is_the_order_of_the_bytes() {
        assert_eq!(laid_out(*b"ABCD"), [*b"ABCD", *b"CDAB", *b"BADC", *b"DCBA"]);
    }

    #[test]
    fn four_registers_are_ordered_as_two_are() {
        let wanted = [*b"ABCDEFGH", *b"GHEFCDAB", *b"BADCFEHG", *b"HGFEDCBA"];
        assert_eq!(laid_out(*b"ABCDEFGH"), wanted);
    }

    #[test]
    fn a_value_of_one_register_has_only_a_byte_order() {
        assert_eq!(laid_out(*b"AB"), [*b"AB", *b"AB", *b"BA", *b"BA"]);
    }

    #[test]
    fn the_default_is_high_word_first() {
        assert_eq!(Order::default(), Order::Abcd);
    }
}
