//! The settings of a node.

use super::mbm_node;
use crate::line::Core;
use crate::pointers::{change, read, with};
use mbm::error::Status;

/// Sets the unit to which the master sends later requests.
///
/// @param unit  the unit identifier, 1 to 247; 0 is broadcast. The master also sends to 248 to
///              255, which the standard reserves
#[no_mangle]
pub unsafe extern "C" fn mbm_node_setSlaveID(node: *mut mbm_node, unit: u8) -> u8 {
    change(node, |node| node.core.set_unit(unit))
}

/// Returns the unit to which the master sends requests.
///
/// @return the unit identifier, 1 by default; 0 for an object that was never begun
#[no_mangle]
pub unsafe extern "C" fn mbm_node_getSlaveID(node: *const mbm_node) -> u8 {
    read(node, 0, |node| node.core.unit())
}

/// Sets the response timeout: the maximum time from the last bit of the request to the last
/// byte of the reply.
///
/// @param timeoutMs  milliseconds, 0 to 1000000 (16 minutes); the default is 2000
#[no_mangle]
pub unsafe extern "C" fn mbm_node_setResponseTimeout(node: *mut mbm_node, timeoutMs: u32) -> u8 {
    with(node, |node| {
        node.words.response_timeout.set_timeout(timeoutMs).into()
    })
}

/// Switches between blocking and non-blocking mode. In blocking mode, the default, a function
/// that makes a request returns when the request has ended. In non-blocking mode it returns
/// MBM_PENDING at once, and you call mbm_node_poll until the request has ended.
///
/// @param on  1 blocking, 0 non-blocking; it applies from the next request on
#[no_mangle]
pub unsafe extern "C" fn mbm_node_setBlocking(node: *mut mbm_node, on: u8) -> u8 {
    change(node, |node| node.words.is_non_blocking = on == 0)
}

/// Accepts replies of devices that deviate from the standard. It has these effects:
/// - The master accepts a reply with the right unit, function and CRC although it repeats
///   another address, value or quantity, or carries more or fewer data than were requested.
///   It accepts such a reply at the end of the response timeout, if no right reply has
///   arrived. mbm_node_available returns the number of words that arrived.
/// - A read of more words than the response words hold succeeds and fills all of them.
///   (If the reply is longer than the frame buffer, no noise may have arrived before it.)
/// - The master also sends requests that read to unit 0, and accepts a reply from unit 0.
///
/// Set a short response timeout (mbm_node_setResponseTimeout) if the device deviates in
/// every reply.
///
/// @param on  0 (the default) or 1
/// @return a status; MBM_BUSY while a request is pending
#[no_mangle]
pub unsafe extern "C" fn mbm_node_setLenient(node: *mut mbm_node, on: u8) -> u8 {
    with(node, |node| {
        if node.core.is_pending() {
            return Status::BUSY;
        }
        node.lenient = Core::lenient(on != 0);
        Status::OK
    })
}
