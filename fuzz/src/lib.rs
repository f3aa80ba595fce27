//! Shared by the fuzz targets: a reader for inputs, simple versions of the code under test,
//! requests, and the bytes that may arrive after them.

pub mod api;
pub mod asked;
#[path = "../../tests/common/frame.rs"]
pub mod frame;
pub mod lengths;
pub mod naive;
pub mod search;
pub mod seeds;
pub mod stream;
pub mod targets;

/// Reads a fuzz input from its front; returns zeros after its end.
pub struct Input<'a>(pub &'a [u8]);

impl<'a> Input<'a> {
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    pub fn u8(&mut self) -> u8 {
        match self.0.split_first() {
            Some((first, rest)) => {
                self.0 = rest;
                *first
            }
            None => 0,
        }
    }

    pub fn u16(&mut self) -> u16 {
        u16::from_be_bytes([self.u8(), self.u8()])
    }

    /// The next `count` bytes, or fewer at the end of the input.
    pub fn take(&mut self, count: usize) -> &'a [u8] {
        let (front, rest) = self.0.split_at(count.min(self.0.len()));
        self.0 = rest;
        front
    }

    /// A count of 8 bits, and that many bytes.
    pub fn counted(&mut self) -> &'a [u8] {
        let count = self.u8();
        self.take(count.into())
    }
}

/// The words as bytes, high byte first.
pub fn be(words: &[u16]) -> Vec<u8> {
    words.iter().flat_map(|word| word.to_be_bytes()).collect()
}
