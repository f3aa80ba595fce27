//! Words and bits as the caller holds them, bytes as the wire carries them.

pub mod bits;
pub mod order;
pub mod registers;
pub mod value;
pub mod view;

/// Writes words as data bytes; told how many items they are, modulo 256.
pub type Send = fn(bytes: &mut [u8], words: &[u16], quantity: u8);

/// Fills words from data bytes; told how many items they are, modulo 256.
pub type Take = fn(words: &mut [u16], bytes: &[u8], quantity: u8);
