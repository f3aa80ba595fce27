//! How the bytes of a value lie in registers.

/// How a device lays out a value of two registers whose bytes are A (the most
/// significant), B, C and D; wider values likewise.
///
/// The standard knows registers alone, high byte first. A value of several
/// has no order in it, so that each is in use somewhere.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub enum Order {
    /// High word first, high byte first: what most devices do.
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
    /// The four.
    pub const ALL: [Order; 4] = [Order::Abcd, Order::Cdab, Order::Badc, Order::Dcba];

    /// True if the low byte of each register comes first.
    pub const fn swaps_bytes(self) -> bool {
        matches!(self, Order::Badc | Order::Dcba)
    }

    /// True if the least significant register comes first.
    pub const fn low_word_first(self) -> bool {
        matches!(self, Order::Cdab | Order::Dcba)
    }

    /// What the places of the bytes of a value of `size` bytes (2, 4 or 8) differ
    /// by: the byte that is `place` after the most significant one travels
    /// `place ^ mask` after the first.
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
    fn each_order_is_named_after_what_it_does() {
        assert_eq!(laid_out(*b"ABCD"), [*b"ABCD", *b"CDAB", *b"BADC", *b"DCBA"]);
    }

    #[test]
    fn four_registers_are_ordered_as_two_are() {
        let wanted = [*b"ABCDEFGH", *b"GHEFCDAB", *b"BADCFEHG", *b"HGFEDCBA"];
        assert_eq!(laid_out(*b"ABCDEFGH"), wanted);
    }

    #[test]
    fn one_register_has_a_byte_order_alone() {
        assert_eq!(laid_out(*b"AB"), [*b"AB", *b"AB", *b"BA", *b"BA"]);
    }

    #[test]
    fn the_default_is_high_word_first() {
        assert_eq!(Order::default(), Order::Abcd);
    }
}
