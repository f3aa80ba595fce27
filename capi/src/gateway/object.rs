//! The gateway object.

use super::storage::Parts;
use crate::pointers::c_object;
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

c_object! { mbm_gateway, *mut Core, core }
