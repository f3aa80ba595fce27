//! `mbm_plan_*`: a table of fields that is read from units again and again, for C.

mod begin;
mod constants;
mod object;
mod poll;
mod setup;
mod storage;
mod values;

pub use begin::*;
pub use constants::*;
pub use poll::*;
pub use setup::*;
pub use storage::*;
pub use values::*;
