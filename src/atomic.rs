//! The atomic types of the ring. `tests/ring_orders.rs` compiles `ring.rs` with loom's types
//! of the same names, to try every order in which writer and reader may run.

#[cfg(not(target_pointer_width = "16"))]
pub use core::sync::atomic::AtomicU16 as AtomicPlace;
#[cfg(target_pointer_width = "16")]
pub use core::sync::atomic::AtomicU8 as AtomicPlace;
pub use core::sync::atomic::{AtomicU8, Ordering};
