//! A plan of fields: a constant table says which values of which units a program wants, and
//! how often. The plan groups the fields into reads and says which read is due.
//!
//! [`group`] finds the fewest reads for the table, and of these the reads with the fewest
//! registers. [`schedule`] spreads the reads over time and keeps away from units that do not
//! answer. The caller sends each read and stores its reply; [`value`] gets values out of it.
//! Nothing here sends anything or has a clock: time is an argument in milliseconds, which may
//! wrap.

pub mod conversion;
// For the C API; it may change in any version.
#[doc(hidden)]
pub mod divide;
pub mod field;
pub mod group;
pub mod limits;
mod number;
mod read;
pub mod schedule;
pub mod split;
pub mod value;
mod wide;

pub use conversion::Conversion;
pub use field::Field;
pub use limits::{ExcludedRange, Limits, ReadLimits, UnitLimits};
pub use read::{Position, Read};
