//! The storage of a line.

use core::ffi::c_void;

/// A serial line with RTU frames: a port, a frame buffer, settings, and the pending request.
/// The nodes on the line use it, one request at a time: see mbm_node.
///
/// You own the storage. Initialise it with MBM_INIT (`mbm_line line = MBM_INIT;`). Use a line
/// and its nodes from one thread only, and never from an interrupt. Several lines are
/// independent of each other. mbm_port says which functions the hooks of the port may call.
///
/// A call that is refused changes nothing.
#[repr(C)]
pub struct mbm_line {
    /// Private.
    pointers: [*mut c_void; 25],
    /// Private.
    words: [u32; 14],
}
