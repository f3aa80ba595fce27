//! What the fuzz targets share: an input that is taken apart, naive versions of
//! what they test, requests and the bytes that may come back.

pub mod api;
pub mod asked;
pub mod lengths;
pub mod naive;
pub mod search;
pub mod stream;

/// A fuzz input, taken from its front; zeros once it is used up.
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

    /// At most `count` bytes.
    pub fn take(&mut self, count: usize) -> &'a [u8] {
        let (front, rest) = self.0.split_at(count.min(self.0.len()));
        self.0 = rest;
        front
    }

    /// Bytes behind their count.
    pub fn counted(&mut self) -> &'a [u8] {
        let count = self.u8();
        self.take(count.into())
    }
}

/// Words as they travel.
pub fn be(words: &[u16]) -> Vec<u8> {
    words.iter().flat_map(|word| word.to_be_bytes()).collect()
}
