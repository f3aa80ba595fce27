//! Words and bits as the caller holds them, bytes as the wire carries them.

pub mod bits;
pub mod order;
pub mod registers;
pub mod value;
pub mod view;
