//! The storage of a master, which ports name too.

use core::ffi::c_void;

/// A Modbus RTU master: one line, one request at a time.
///
/// Storage is yours and must be zero before first use, which a static object
/// is (`static mbm_master node;`). Settings and words want mbm_master_beginRtu or
/// mbm_master_setBuffers before them, requests want both. Use one object from one
/// thread and never from an interrupt; several objects are independent of each
/// other. Which functions the hooks of its port may call: see mbm_port.
///
/// A call that is refused changes nothing, but for what the functions that make a
/// request say of themselves, and mbm_master_send32.
#[repr(C)]
pub struct mbm_master {
    /// Private.
    pointers: [*mut c_void; 13],
    /// Private.
    words: [u32; 21],
}
