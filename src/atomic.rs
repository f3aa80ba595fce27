//! The atomics of the ring. `tests/ring_orders.rs` compiles `ring.rs` with others of
//! these names, which try every order in which the two sides may run.

#[cfg(not(target_pointer_width = "16"))]
pub use core::sync::atomic::AtomicU16 as AtomicPlace;
#[cfg(target_pointer_width = "16")]
pub use core::sync::atomic::AtomicU8 as AtomicPlace;
pub use core::sync::atomic::{AtomicU8, Ordering};
