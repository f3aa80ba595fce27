//! Reading and writing of big-endian numbers with bounds checks. Nothing here can panic.

use crate::error::Error;
use core::cell::Cell;

/// Moves the bytes from the index `from` to the end to the front of `bytes`.
pub fn move_to_front(bytes: &mut [u8], from: usize) {
    let cells = Cell::from_mut(bytes).as_slice_of_cells();
    move_items(cells, cells.get(from..).unwrap_or_default());
}

/// Moves items forward in a slice that holds both stretches. It is inlined, which is smaller
/// where firmware has one call.
#[inline(always)]
pub(crate) fn move_items<T: Copy>(to: &[Cell<T>], from: &[Cell<T>]) {
    for (to, from) in to.iter().zip(from) {
        to.set(from.get());
    }
}

/// Copies items, as many as both slices have.
#[inline(always)]
pub(crate) fn copy<T: Copy>(to: &mut [T], from: &[T]) {
    for (to, from) in to.iter_mut().zip(from) {
        *to = *from;
    }
}

/// Reads a byte slice from its front.
#[derive(Clone, Copy, Debug)]
pub struct Reader<'a> {
    rest: &'a [u8],
}

impl<'a> Reader<'a> {
    /// A reader of `bytes`.
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

    /// The next `count` bytes.
    pub fn take(&mut self, count: usize) -> Option<&'a [u8]> {
        let (first, rest) = self.rest.split_at_checked(count)?;
        self.rest = rest;
        Some(first)
    }

    /// All remaining bytes. The reader is empty afterwards.
    pub fn rest(&mut self) -> &'a [u8] {
        core::mem::take(&mut self.rest)
    }

    /// How many bytes remain.
    pub const fn length(&self) -> usize {
        self.rest.len()
    }

    /// True if no bytes remain.
    pub const fn is_empty(&self) -> bool {
        self.rest.is_empty()
    }
}

/// Writes to a byte slice from its front. If something does not fit, [`Writer::finish`]
/// returns an error.
#[derive(Debug)]
pub struct Writer<'a> {
    bytes: &'a mut [u8],
    length: usize,
}

impl<'a> Writer<'a> {
    /// A writer to `bytes`.
    pub const fn new(bytes: &'a mut [u8]) -> Self {
        Writer { bytes, length: 0 }
    }

    /// Writes all of `bytes`.
    pub fn put(&mut self, bytes: &[u8]) {
        let end = self.length.saturating_add(bytes.len());
        if let Some(space) = self.bytes.get_mut(self.length..end) {
            for (place, byte) in space.iter_mut().zip(bytes) {
                *place = *byte;
            }
        }
        self.length = end;
    }

    /// Writes a byte.
    pub fn u8(&mut self, byte: u8) {
        self.put(&[byte]);
    }

    /// Writes two bytes, high byte first.
    pub fn u16(&mut self, word: u16) {
        self.put(&word.to_be_bytes());
    }

    /// Writes the number of bytes as one byte, then the bytes.
    pub fn counted(&mut self, bytes: &[u8]) {
        self.u8(bytes.len() as u8);
        self.put(bytes);
    }

    /// Number of bytes written so far, including those that did not fit.
    pub const fn length(&self) -> usize {
        self.length
    }

    /// Returns the number of bytes written.
    ///
    /// # Errors
    /// [`Error::BufferTooSmall`] if they did not all fit.
    pub fn finish(self) -> Result<usize, Error> {
        if self.length <= self.bytes.len() {
            Ok(self.length)
        } else {
            Err(Error::BufferTooSmall)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reader_reads_big_endian_and_returns_none_at_the_end() {
        let mut reader = Reader::new(&[1, 2, 3, 4, 5]);
        assert_eq!(reader.u16(), Some(0x0102));
        assert_eq!(reader.u8(), Some(3));
        assert_eq!(reader.take(3), None);
        assert_eq!(reader.take(1), Some(&[4][..]));
        assert_eq!(reader.u16(), None);
        assert_eq!(reader.rest(), [5]);
        assert!(reader.is_empty());
        assert_eq!(reader.u8(), None);
    }

    #[test]
    fn writer_reports_that_bytes_did_not_fit() {
        let mut bytes = [0; 3];
        let mut writer = Writer::new(&mut bytes);
        writer.u16(0x0102);
        writer.u8(3);
        assert_eq!(writer.finish(), Ok(3));
        assert_eq!(bytes, [1, 2, 3]);

        let mut writer = Writer::new(&mut bytes);
        writer.u16(0x0A0B);
        writer.u16(0x0C0D);
        writer.u8(9);
        assert_eq!(writer.finish(), Err(Error::BufferTooSmall));
        assert_eq!(bytes, [0x0A, 0x0B, 3]);
    }
}
