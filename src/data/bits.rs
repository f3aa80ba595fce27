//! Coils and discrete inputs: packed, least significant bit first, so 16 of
//! them fill a word low byte first.

/// Writes the bits of `words` as data bytes, the unused ones of the last byte
/// zero; bytes for which there is no word stay.
pub fn send(bytes: &mut [u8], words: &[u16], quantity: u8) {
    for (pair, word) in bytes.chunks_mut(2).zip(words) {
        for (byte, half) in pair.iter_mut().zip(word.to_le_bytes()) {
            *byte = half;
        }
    }
    if let Some(last) = bytes.last_mut() {
        *last &= mask(quantity & 7) as u8;
    }
}

/// Fills `words` from data bytes, the unused bits of the last word zero.
pub fn take(words: &mut [u16], bytes: &[u8], quantity: u8) {
    for (word, pair) in words.iter_mut().zip(bytes.chunks(2)) {
        *word = pair
            .iter()
            .rfold(0, |high, byte| high << 8 | u16::from(*byte));
    }
    if let Some(last) = words.last_mut() {
        *last &= mask(quantity & 15);
    }
}

/// Keeps the bits used of the last item; 0 used bits are all of them.
const fn mask(used: u8) -> u16 {
    match used {
        0 => 0xFFFF,
        used => (1 << used) - 1,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bits_fill_a_word_low_byte_first() {
        let words = [0x0201, 0x0003];
        let mut sent = [0; 3];
        send(&mut sent, &words, 24);
        assert_eq!(sent, [1, 2, 3]);
        let mut back = [0xFFFF; 2];
        take(&mut back, &sent, 24);
        assert_eq!(back, words);
    }

    #[test]
    fn the_mask_keeps_the_used_bits() {
        assert_eq!(mask(1), 0x01);
        assert_eq!(mask(7), 0x7F);
        assert_eq!(mask(0) as u8, 0xFF);
        assert_eq!(mask(17 & 15), 0x01);
    }
}
