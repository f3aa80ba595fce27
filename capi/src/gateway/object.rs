//! The gateway object.

use super::storage::Parts;
use crate::pointers::CObject;
use core::ffi::c_void;
use mbm::gateway::Gateway;

/// A gateway: takes requests from Modbus TCP connections, passes each to the line of its unit,
/// and sends the reply back. mbm_gateway_poll does all of it; no function ever waits.
///
/// You provide the storage. Initialise it with MBM_INIT. Call mbm_gateway_begin first. Use a
/// gateway, its lines' clients and its own units from one thread, and never from an interrupt.
///
/// mbm_gateway_poll calls the hooks of the connections' ports and of the lines' ports,
/// `isReady` of the lines, and the functions of the gateway's own units. If one of them calls a
/// function on the gateway, the function returns MBM_BUSY and changes nothing; a getter returns
/// its value for an object that was never begun. The same holds for the `done` function of a
/// request of your own that mbm_gateway_poll ends.
#[repr(C)]
pub struct mbm_gateway {
    /// Private.
    pointers: [*mut c_void; 13],
    /// Private.
    words: [u32; 2],
}

pub type Core = Gateway<Parts>;

/// The real content of an `mbm_gateway`.
#[repr(C)]
pub(super) struct Object {
    core: Core,
    mark: u8,
}

const _: () = {
    let space = size_of::<mbm_gateway>();
    let used = size_of::<Object>();
    assert!(align_of::<mbm_gateway>() >= align_of::<Object>());
    assert!(used <= space);
    // On a 16-bit or 32-bit machine, where RAM is scarce, at most 5 % of the storage may
    // be unused.
    assert!(size_of::<usize>() > 4 || (space - used) * 20 <= space);
};

// SAFETY: the mark is a field of its own.
unsafe impl CObject for mbm_gateway {
    // A pointer, because hooks may pass the gateway to functions of this library during a
    // poll. Those functions read the mark, which is outside of the core.
    type Access<'a> = *mut Core;

    unsafe fn mark(gateway: *const mbm_gateway) -> *mut u8 {
        // SAFETY: as the caller promises; every object is writable storage.
        unsafe { &raw mut (*gateway.cast::<Object>().cast_mut()).mark }
    }

    unsafe fn access<'a>(gateway: *mut mbm_gateway) -> Self::Access<'a> {
        // SAFETY: as the caller promises.
        unsafe { &raw mut (*gateway.cast::<Object>()).core }
    }
}
