//! Bounds-checked big-endian reading and writing. Nothing here can panic.

/// Reads from the front of a byte slice.
#[derive(Clone, Copy)]
pub struct Reader<'a> {
    rest: &'a [u8],
}

impl<'a> Reader<'a> {
    /// Reads `bytes` from its front.
    pub const fn new(bytes: &'a [u8]) -> Self {
        Reader { rest: bytes }
    }

    /// The next byte.
    pub fn u8(&mut self) -> Option<u8> {
        let (first, rest) = self.rest.split_first()?;
        self.rest = rest;
        Some(*first)
    }

    /// The next two bytes, high byte first.
    pub fn u16(&mut self) -> Option<u16> {
        let (first, rest) = self.rest.split_first_chunk()?;
        self.rest = rest;
        Some(u16::from_be_bytes(*first))
    }

    /// All that is left, which leaves nothing.
    pub fn rest(&mut self) -> &'a [u8] {
        core::mem::take(&mut self.rest)
    }

    /// True when nothing is left.
    pub const fn is_empty(&self) -> bool {
        self.rest.is_empty()
    }
}

/// Writes to the front of a byte slice. What does not fit is not written, and
/// [`Writer::finish`] tells.
pub struct Writer<'a> {
    buffer: &'a mut [u8],
    at: usize,
    fits: bool,
}

impl<'a> Writer<'a> {
    /// Writes to `buffer` from its front.
    pub fn new(buffer: &'a mut [u8]) -> Self {
        Writer {
            buffer,
            at: 0,
            fits: true,
        }
    }

    /// Appends a byte.
    pub fn u8(&mut self, value: u8) {
        match self.buffer.get_mut(self.at) {
            Some(place) => {
                *place = value;
                self.at += 1;
            }
            None => self.fits = false,
        }
    }

    /// Appends two bytes, high byte first.
    pub fn u16(&mut self, value: u16) {
        for byte in value.to_be_bytes() {
            self.u8(byte);
        }
    }

    /// Appends bytes as they are.
    pub fn bytes(&mut self, bytes: &[u8]) {
        for byte in bytes {
            self.u8(*byte);
        }
    }

    /// What has been written so far.
    pub fn written(&self) -> &[u8] {
        self.buffer.get(..self.at).unwrap_or_default()
    }

    /// How many bytes were written; `None` if some did not fit.
    pub fn finish(&self) -> Option<usize> {
        self.fits.then_some(self.at)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reader_takes_big_endian_and_ends_with_none() {
        let mut reader = Reader::new(&[1, 2, 3, 4]);
        assert_eq!(reader.u16(), Some(0x0102));
        assert_eq!(reader.u8(), Some(3));
        assert_eq!(reader.u16(), None);
        assert_eq!(reader.rest(), [4]);
        assert!(reader.is_empty());
        assert_eq!(reader.u8(), None);
    }

    #[test]
    fn writer_writes_big_endian_and_knows_what_fits() {
        let mut buffer = [0; 4];
        let mut writer = Writer::new(&mut buffer);
        writer.u8(1);
        writer.u16(0x0203);
        writer.bytes(&[4]);
        assert_eq!(writer.finish(), Some(4));
        assert_eq!(writer.written(), [1, 2, 3, 4]);
        writer.u8(5);
        assert_eq!(writer.finish(), None);
        assert_eq!(buffer, [1, 2, 3, 4]);
    }
}
