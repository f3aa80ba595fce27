//! Conversion between words and bits in the caller's memory and data bytes on the wire.

// For the crate mbm-c; it may change in any version.
#[doc(hidden)]
pub mod arithmetic;
pub mod bits;
pub mod clock;
pub mod date;
pub(crate) mod digits;
pub(crate) mod half;
pub mod order;
pub mod raw;
pub mod text;
pub mod types;
pub mod value;
pub mod view;

pub use order::Order;
pub use value::Value;
pub use view::Registers;
