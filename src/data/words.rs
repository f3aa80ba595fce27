//! 16-bit words of the caller and data bytes of a PDU.
//!
//! Registers travel high byte first. Coils and discrete inputs travel packed,
//! least significant bit first, so 16 of them fill a word low byte first.

/// Which byte of a word is the first on the wire.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Order {
    /// Registers.
    HighFirst,
    /// Packed bits.
    LowFirst,
}

/// The byte that stands at `index` when `words` are sent; `None` past the end.
pub fn byte(words: &[u16], index: usize, order: Order) -> Option<u8> {
    let word = *words.get(index >> 1)?;
    Some(if is_high(index, order) {
        word >> 8
    } else {
        word
    } as u8)
}

/// Fills `words` from data bytes; an odd last byte is padded with zero. Bytes
/// beyond the last word are left out, so the caller checks the room first.
pub fn fill(words: &mut [u16], bytes: &[u8], order: Order) {
    for (index, byte) in bytes.iter().enumerate() {
        let Some(word) = words.get_mut(index >> 1) else {
            return;
        };
        let byte = u16::from(*byte);
        let part = if is_high(index, order) {
            byte << 8
        } else {
            byte
        };
        *word = if index & 1 == 0 { part } else { *word | part };
    }
}

/// True if the byte at `index` on the wire is the high byte of its word.
const fn is_high(index: usize, order: Order) -> bool {
    (index & 1 == 0) == matches!(order, Order::HighFirst)
}

/// The mask that keeps the used bits of the last byte of `quantity` packed bits.
pub const fn last_byte_mask(quantity: u16) -> u8 {
    match quantity & 7 {
        0 => 0xFF,
        used => (1 << used) - 1,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn registers_travel_high_byte_first() {
        let words = [0x0102, 0x0304];
        let sent: std::vec::Vec<_> = (0..5).map(|i| byte(&words, i, Order::HighFirst)).collect();
        assert_eq!(sent, [Some(1), Some(2), Some(3), Some(4), None]);
        let mut back = [0; 2];
        fill(&mut back, &[1, 2, 3, 4], Order::HighFirst);
        assert_eq!(back, words);
    }

    #[test]
    fn bits_fill_a_word_low_byte_first() {
        let words = [0x0201, 0x0003];
        let sent: std::vec::Vec<_> = (0..3).map(|i| byte(&words, i, Order::LowFirst)).collect();
        assert_eq!(sent, [Some(1), Some(2), Some(3)]);
        let mut back = [0xFFFF; 2];
        fill(&mut back, &[1, 2, 3], Order::LowFirst);
        assert_eq!(back, words);
    }

    #[test]
    fn the_mask_keeps_the_used_bits() {
        assert_eq!(last_byte_mask(1), 0x01);
        assert_eq!(last_byte_mask(7), 0x7F);
        assert_eq!(last_byte_mask(8), 0xFF);
        assert_eq!(last_byte_mask(17), 0x01);
    }
}
