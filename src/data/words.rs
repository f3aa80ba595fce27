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

/// Writes `words` as data bytes; bytes for which there is no word stay.
pub fn send(bytes: &mut [u8], words: &[u16], order: Order) {
    let (pairs, odd) = bytes.as_chunks_mut();
    let odd_word = words.get(pairs.len());
    for (pair, word) in pairs.iter_mut().zip(words) {
        *pair = in_order(*word, order).to_be_bytes();
    }
    if let (Some(place), Some(word)) = (odd.first_mut(), odd_word) {
        [*place, _] = in_order(*word, order).to_be_bytes();
    }
}

/// Fills `words` from data bytes; an odd last byte is padded with zero. Bytes
/// beyond the last word are left out, so the caller checks the room first.
pub fn fill(words: &mut [u16], bytes: &[u8], order: Order) {
    let (pairs, odd) = bytes.as_chunks();
    for (word, pair) in words.iter_mut().zip(pairs) {
        *word = in_order(u16::from_be_bytes(*pair), order);
    }
    if let (Some(byte), Some(word)) = (odd.first(), words.get_mut(pairs.len())) {
        *word = in_order(u16::from_be_bytes([*byte, 0]), order);
    }
}

/// A word with its bytes as `order` has them on the wire.
const fn in_order(word: u16, order: Order) -> u16 {
    match order {
        Order::HighFirst => word,
        Order::LowFirst => word.swap_bytes(),
    }
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
        let mut sent = [0; 4];
        send(&mut sent, &words, Order::HighFirst);
        assert_eq!(sent, [1, 2, 3, 4]);
        let mut back = [0; 2];
        fill(&mut back, &sent, Order::HighFirst);
        assert_eq!(back, words);
    }

    #[test]
    fn bits_fill_a_word_low_byte_first() {
        let words = [0x0201, 0x0003];
        let mut sent = [0; 3];
        send(&mut sent, &words, Order::LowFirst);
        assert_eq!(sent, [1, 2, 3]);
        let mut back = [0xFFFF; 2];
        fill(&mut back, &sent, Order::LowFirst);
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
