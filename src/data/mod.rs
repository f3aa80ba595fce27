//! Conversion between words and bits in the caller's memory and data bytes on the wire.

#[doc(hidden)]
pub mod arithmetic;
pub mod bits;
pub mod clock;
pub mod date;
pub mod digits;
pub mod half;
pub mod order;
pub mod raw;
pub mod text;
pub mod types;
pub mod value;
pub mod view;

pub use order::Order;
pub use view::Registers;
