//! Polling a gateway.

use super::object::mbm_gateway;
use crate::pointers;
use mbm::error::Status;

/// Polls the clients of all lines, receives requests, passes them on, and sends responses.
/// Never waits.
///
/// Call it often. You need not poll the clients of the lines; you may.
///
/// @return a status; MBM_BUSY also from within a hook of a port of its lines
#[no_mangle]
pub unsafe extern "C" fn mbm_gateway_poll(gateway: *mut mbm_gateway) -> u8 {
    // No reference includes the mark.
    pointers::with(gateway, |core| {
        if (*core).storage.config.check_clients() == Status::BUSY {
            return Status::BUSY;
        }
        pointers::with_hooks(gateway, || (*core).poll());
        Status::OK
    })
}

/// Returns for how long mbm_gateway_poll will have nothing to do, unless a byte arrives on a
/// line whose client has requests, or on a connection that the gateway reads (see
/// mbm_gateway_isReading), or a connection is lost.
///
/// @return microseconds; 0 means poll now, also from within a hook of the gateway; 0xFFFFFFFF means
///         that no request is pending. While a connection does not accept a response, and while a
///         function of the gateway's own units returns MBM_REPLY_PENDING, it is at most 1000
#[no_mangle]
pub unsafe extern "C" fn mbm_gateway_pollDelay(gateway: *mut mbm_gateway) -> u32 {
    // No reference includes the mark.
    match pointers::check(gateway) {
        Status::OK => {
            let core = pointers::object(gateway);
            pointers::with_hooks(gateway, || (*core).poll_delay())
        }
        Status::BUSY => 0,
        _ => u32::MAX,
    }
}
