//! Conversion between words and bits in the caller's memory and data bytes on the wire.

pub mod bits;
pub mod order;
pub mod value;
pub mod view;

pub use order::Order;
pub use view::Registers;
