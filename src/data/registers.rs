//! Registers: 16-bit words, sent with the high byte first.

/// Writes `words` as data bytes. Bytes beyond the last word do not change.
pub fn send(bytes: &mut [u8], words: &[u16]) {
    for (pair, word) in bytes.as_chunks_mut().0.iter_mut().zip(words) {
        *pair = word.to_be_bytes();
    }
}

/// Fills `words` from data bytes.
pub fn take(words: &mut [u16], bytes: &[u8]) {
    for (word, pair) in words.iter_mut().zip(bytes.as_chunks().0) {
        *word = u16::from_be_bytes(*pair);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn registers_are_sent_high_byte_first() {
        let words = [0x0102, 0x0304];
        let mut sent = [0; 4];
        send(&mut sent, &words);
        assert_eq!(sent, [1, 2, 3, 4]);
        let mut back = [0; 2];
        take(&mut back, &sent);
        assert_eq!(back, words);
    }
}
