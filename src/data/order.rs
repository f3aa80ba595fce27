//! The order of a value's bytes in registers.

/// The order in which a device sends the bytes of a value. A is the most significant byte. The
/// least significant one is D in two registers and H in four. The first four orders are named by
/// what they make of two registers; they order four registers in the same way. The last four are
/// named by what they make of four registers, which they order by halves of two.
///
/// The standard defines the byte order of one register, high byte first. It defines no
/// order for values of several registers, so devices use each of these.
///
/// ```
/// use mbm::data::{Order, Registers};
///
/// // The low word comes first.
/// let response = Registers::new(&[0x8000_u16, 0x4366][..], 0, Order::Cdab)?;
/// assert_eq!(response.get(0), Ok(230.5_f32));
/// assert!(Order::Cdab.low_word_first() && !Order::Cdab.swaps_bytes());
/// # Ok::<(), mbm::Error>(())
/// ```
// The number of an order is its mask for eight bytes: 1 swaps the bytes of each register, 2 the
// registers of each half, 4 the halves.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub enum Order {
    /// High word first, high byte first. Most devices use this order.
    #[default]
    Abcd = 0,
    /// Low word first, high byte first.
    Cdab = 6,
    /// High word first, low byte first.
    Badc = 1,
    /// Low word first, low byte first.
    Dcba = 7,
    /// Four registers, low half first; each half as in [`Order::Abcd`]. A value of two registers
    /// is such a half.
    Efghabcd = 4,
    /// Four registers, high half first; each half as in [`Order::Cdab`].
    Cdabghef = 2,
    /// Four registers, low half first; each half as in [`Order::Badc`].
    Fehgbadc = 5,
    /// Four registers, high half first; each half as in [`Order::Dcba`].
    Dcbahgfe = 3,
}

impl Order {
    /// All orders; the first four are those that differ for two registers.
    pub const ALL: [Order; 8] = [
        Order::Abcd,
        Order::Cdab,
        Order::Badc,
        Order::Dcba,
        Order::Efghabcd,
        Order::Cdabghef,
        Order::Fehgbadc,
        Order::Dcbahgfe,
    ];

    /// True if the low byte of each register comes first.
    pub const fn swaps_bytes(self) -> bool {
        self as u8 & 1 != 0
    }

    /// True if the least significant of two registers comes first.
    pub const fn low_word_first(self) -> bool {
        self as u8 & 2 != 0
    }

    /// The mask that converts byte positions of a value of `size` bytes (2, 4 or 8). The
    /// byte at position `n` of the value, counted from the most significant byte, is byte
    /// `n ^ mask` on the wire.
    // For the C API; it may change in any version.
    #[doc(hidden)]
    pub const fn mask(self, size: usize) -> usize {
        self as usize & size.wrapping_sub(1)
    }

    /// Where register `nth` of a value of `count` registers (1 to 4) is among them. Register 0 is the
    /// most significant. `None` if the order does not say it: one by halves, for three registers.
    // For the C API; it may change in any version.
    #[doc(hidden)]
    pub const fn place(self, nth: u16, count: u16) -> Option<u16> {
        let words = self as u16 >> 1;
        if count == 3 {
            return match words {
                0 => Some(nth),
                3 => 2u16.checked_sub(nth),
                _ => None,
            };
        }
        Some(nth ^ (words & (count - 1)))
    }
}

/// The byte at the index `place` of words, the high byte of each word first; `None` past the end.
pub(super) fn byte_of(words: &[u16], place: usize) -> Option<u8> {
    let [high, low] = words.get(place / 2)?.to_be_bytes();
    Some(if place.is_multiple_of(2) { high } else { low })
}

/// Sets the byte that [`byte_of`] returns; does nothing past the end.
pub(super) fn set_byte_of(words: &mut [u16], place: usize, value: u8) {
    if let Some(word) = words.get_mut(place / 2) {
        let [high, low] = word.to_be_bytes();
        *word = u16::from_be_bytes(if place.is_multiple_of(2) {
            [value, low]
        } else {
            [high, value]
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn laid_out<const N: usize>(value: [u8; N]) -> [[u8; N]; 8] {
        Order::ALL.map(|order| core::array::from_fn(|place| value[place ^ order.mask(N)]))
    }

    #[test]
    fn the_name_of_each_order_is_the_order_of_the_bytes() {
        assert_eq!(
            laid_out(*b"ABCD")[..4],
            [*b"ABCD", *b"CDAB", *b"BADC", *b"DCBA"]
        );
    }

    #[test]
    fn a_value_of_two_registers_is_ordered_as_one_half_is() {
        assert_eq!(
            laid_out(*b"ABCD")[4..],
            [*b"ABCD", *b"CDAB", *b"BADC", *b"DCBA"]
        );
    }

    #[test]
    fn three_registers_have_no_halves() {
        let places = |order: Order| [0, 1, 2].map(|nth| order.place(nth, 3));
        for order in [Order::Abcd, Order::Badc] {
            assert_eq!(places(order), [Some(0), Some(1), Some(2)]);
        }
        for order in [Order::Cdab, Order::Dcba] {
            assert_eq!(places(order), [Some(2), Some(1), Some(0)]);
        }
        for order in &Order::ALL[4..] {
            assert_eq!(places(*order), [None; 3]);
        }
    }

    #[test]
    fn registers_are_where_their_bytes_are() {
        for order in Order::ALL {
            for count in [1, 2, 4] {
                for nth in 0..count {
                    let byte = usize::from(2 * nth) ^ (order.mask(usize::from(2 * count)) & 6);
                    assert_eq!(order.place(nth, count).map(usize::from), Some(byte / 2));
                }
            }
        }
    }

    #[test]
    fn four_registers_are_ordered_as_two_are() {
        let wanted = [*b"ABCDEFGH", *b"GHEFCDAB", *b"BADCFEHG", *b"HGFEDCBA"];
        assert_eq!(laid_out(*b"ABCDEFGH")[..4], wanted);
    }

    #[test]
    fn four_registers_are_ordered_by_halves_too() {
        let wanted = [*b"EFGHABCD", *b"CDABGHEF", *b"FEHGBADC", *b"DCBAHGFE"];
        assert_eq!(laid_out(*b"ABCDEFGH")[4..], wanted);
    }

    #[test]
    fn a_value_of_one_register_has_only_a_byte_order() {
        let wanted = [*b"AB", *b"AB", *b"BA", *b"BA"];
        assert_eq!(laid_out(*b"AB")[..4], wanted);
        assert_eq!(laid_out(*b"AB")[4..], wanted);
    }

    #[test]
    fn the_default_is_high_word_first() {
        assert_eq!(Order::default(), Order::Abcd);
    }
}
