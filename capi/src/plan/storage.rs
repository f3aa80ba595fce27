//! The object that C calls a plan.

use core::ffi::c_void;

/// A plan: a table of fields that a client reads from units again and again.
///
/// You own the storage. Initialise it with MBM_INIT. Call mbm_plan_begin first. Use it from
/// the thread that uses its client, and never from an interrupt. It stays where it is until
/// mbm_plan_end.
#[repr(C)]
pub struct mbm_plan {
    /// Private.
    pointers: [*mut c_void; 3],
    /// Private.
    words: [u32; 4],
}
