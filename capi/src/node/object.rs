//! The storage of a node. The port's hook `idle` uses it too.

use core::ffi::c_void;

/// A node: a device on a line, as the master sees it, with the words of its requests and
/// replies.
///
/// You own the storage. Initialise it with MBM_INIT (`mbm_node meter = MBM_INIT;`) and call
/// mbm_node_begin before all else. Nodes of different lines are independent of each other. One
/// node of a line may have a pending request; a request of another one returns MBM_BUSY
/// meanwhile. A non-blocking request that was not sent yet, because its unit may still answer
/// one that was cancelled, gives way to another node's: its status becomes MBM_CANCELLED. Use a
/// line and its nodes from one thread only, and never from an interrupt. mbm_port says which
/// functions the hooks of the port may call.
///
/// A call that is refused changes nothing. Exceptions are the functions that make a request,
/// as mbm_node_readCoils describes.
#[repr(C)]
pub struct mbm_node {
    /// Private.
    pointers: [*mut c_void; 5],
    /// Private.
    words: [u32; 4],
}
