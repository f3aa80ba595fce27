//! Writes a line of text into a buffer of the caller. `core::fmt` would add kilobytes to a
//! firmware image.

use crate::error::Error;
use crate::frame::ascii::character;

/// A line of ASCII text in a buffer. If the buffer is too small, the rest of the text is cut
/// off and [`TextWriter::finish`] returns an error. A zero byte ends the text, also if it was cut.
///
/// ```
/// use mbm::text::TextWriter;
///
/// let mut text = [0; 64];
/// let mut line = TextWriter::new(&mut text);
/// line.padded("unit", 6);
/// line.number(17);
/// line.byte(b':');
/// line.bytes(&[0x02, 0x2B]);
/// line.registers(&[0x02, 0x2B]);
/// line.bits(&[0b101], 3);
/// line.put(" ");
/// line.hex(0x0A);
/// line.hex_word(0x0B0C);
/// line.put(" ");
/// line.quoted(b"mbm");
/// let length = line.finish()?;
/// assert_eq!(&text[..length], b"unit  17: 02 2B 555 101 0A0B0C \"mbm\"");
/// # Ok::<(), mbm::Error>(())
/// ```
#[derive(Debug)]
pub struct TextWriter<'a> {
    text: &'a mut [u8],
    length: usize,
    is_cut: bool,
}

impl<'a> TextWriter<'a> {
    /// An empty line in the buffer `text`, which needs one byte more than the text has
    /// characters.
    pub const fn new(text: &'a mut [u8]) -> Self {
        TextWriter {
            text,
            length: 0,
            is_cut: false,
        }
    }

    /// Adds a character.
    pub fn byte(&mut self, byte: u8) {
        match self.text.get_mut(self.length..) {
            Some([place, _, ..]) => {
                *place = byte;
                self.length += 1;
            }
            _ => self.is_cut = true,
        }
    }

    /// Adds a string.
    pub fn put(&mut self, words: &str) {
        for byte in words.bytes() {
            self.byte(byte);
        }
    }

    /// Adds a word, and spaces after it up to `width` characters.
    pub fn padded(&mut self, word: &str, width: usize) {
        self.put(word);
        for _ in word.len()..width {
            self.byte(b' ');
        }
    }

    /// Adds a decimal number.
    pub fn number(&mut self, number: u32) {
        let mut digits = [0; 10];
        let mut rest = number;
        let mut count = 0;
        for place in digits.iter_mut().rev() {
            *place = b'0' + (rest % 10) as u8;
            rest /= 10;
            count += 1;
            if rest == 0 {
                break;
            }
        }
        for digit in digits.iter().skip(digits.len() - count) {
            self.byte(*digit);
        }
    }

    /// Adds two hexadecimal digits.
    pub fn hex(&mut self, byte: u8) {
        self.byte(character(byte >> 4));
        self.byte(character(byte & 0x0F));
    }

    /// Adds four hexadecimal digits.
    pub fn hex_word(&mut self, word: u16) {
        // With an iterator here, the compiler would no longer inline the master's iterator.
        self.hex((word >> 8) as u8);
        self.hex(word as u8);
    }

    /// Adds bytes in hexadecimal, with a space before each.
    pub fn bytes(&mut self, bytes: &[u8]) {
        for byte in bytes {
            self.byte(b' ');
            self.hex(*byte);
        }
    }

    /// Adds registers in decimal, with a space before each.
    pub fn registers(&mut self, data: &[u8]) {
        for pair in data.as_chunks().0 {
            self.byte(b' ');
            self.number(u16::from_be_bytes(*pair).into());
        }
    }

    /// Adds the first `count` bits of `data` as 0 and 1, with a space before every eight.
    pub fn bits(&mut self, data: &[u8], count: usize) {
        let mut left = count;
        for byte in data {
            if left == 0 {
                break;
            }
            self.byte(b' ');
            for bit in 0..left.min(8) {
                self.byte(b'0' + (byte >> bit & 1));
            }
            left = left.saturating_sub(8);
        }
    }

    /// Adds a text of another device, in double quotes. A double quote in it becomes a single
    /// quote, and a byte that is no printable ASCII character becomes a full stop.
    pub fn quoted(&mut self, text: &[u8]) {
        self.byte(b'"');
        for byte in text {
            self.byte(match byte {
                b'"' => b'\'',
                b' '..=b'~' => *byte,
                _ => b'.',
            });
        }
        self.byte(b'"');
    }

    /// Ends the text and returns its number of characters.
    ///
    /// # Errors
    /// [`Error::BufferTooSmall`] if the text was cut off.
    pub fn finish(self) -> Result<usize, Error> {
        if let Some(end) = self.text.get_mut(self.length) {
            *end = 0;
        } else {
            return Err(Error::BufferTooSmall);
        }
        if self.is_cut {
            Err(Error::BufferTooSmall)
        } else {
            Ok(self.length)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::string::String;

    fn text(size: usize, write: impl FnOnce(&mut TextWriter)) -> (Result<usize, Error>, String) {
        let mut buffer = std::vec![0xEE; size];
        let mut line = TextWriter::new(&mut buffer);
        write(&mut line);
        let outcome = line.finish();
        let end = buffer.iter().position(|byte| *byte == 0).unwrap_or(0);
        (outcome, String::from_utf8_lossy(&buffer[..end]).into())
    }

    #[test]
    fn numbers_are_written_in_full() {
        let (outcome, words) = text(64, |line| {
            for number in [0, 9, 10, 65_535, u32::MAX] {
                line.number(number);
                line.byte(b' ');
            }
            line.hex_word(0x0AF9);
        });
        assert_eq!(words, "0 9 10 65535 4294967295 0AF9");
        assert_eq!(outcome, Ok(words.len()));
    }

    #[test]
    fn bits_are_written_in_groups_of_eight_up_to_the_end_of_the_data() {
        let (_, words) = text(64, |line| line.bits(&[0xCD, 0x01], 10));
        assert_eq!(words, " 10110011 10");
        let (_, words) = text(64, |line| line.bits(&[0xFF], 100));
        assert_eq!(words, " 11111111");
    }

    #[test]
    fn text_that_does_not_fit_is_cut_and_still_ends_with_zero() {
        assert_eq!(text(4, |line| line.put("abc")), (Ok(3), "abc".into()));
        let short = Err(Error::BufferTooSmall);
        assert_eq!(text(3, |line| line.put("abc")), (short, "ab".into()));
        assert_eq!(text(1, |line| line.put("abc")), (short, "".into()));
        assert_eq!(text(0, |_| ()), (short, "".into()));
    }

    #[test]
    fn quoted_text_contains_only_printable_characters() {
        let (_, words) = text(64, |line| line.quoted(b"a\"b\n\xFF"));
        assert_eq!(words, "\"a'b..\"");
    }
}
