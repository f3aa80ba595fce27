//! The storage of a master. The port's hook `idle` uses it too.

use core::ffi::c_void;

/// A Modbus RTU master: one line, one request at a time.
///
/// You own the storage. Initialise it with MBM_INIT (`mbm_master node = MBM_INIT;`). Before
/// you use settings and words, call mbm_master_beginRtu or mbm_master_setBuffers; before you
/// make requests, call both. Use an object from one thread only, and never from an interrupt.
/// Several objects are independent of each other. mbm_port says which functions the hooks of
/// the port may call.
///
/// A call that is refused changes nothing. Exceptions are the functions that make a request,
/// as mbm_master_readCoils describes, and mbm_master_send32.
#[repr(C)]
pub struct mbm_master {
    /// Private.
    pointers: [*mut c_void; 17],
    /// Private.
    words: [u32; 21],
}
