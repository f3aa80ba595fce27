//! Words and bits as the caller holds them, bytes as the wire carries them.

pub mod words;
