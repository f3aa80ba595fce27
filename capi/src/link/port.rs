//! The port of a client that has a link. It calls the hooks of the port that the client had
//! before. If they report that the link is lost, the link notes it and the client learns
//! nothing: so its requests that were not sent yet can wait.

use super::object::Object;
use crate::client::object as client;
use crate::node::mbm_node;
use crate::port::{mbm_port, passing_hooks};
use core::ffi::c_void;

/// The port for the client of `link`. It has the optional hooks that the client's own port
/// has.
///
/// # Safety
/// `link` is being begun, and has the client's own port.
pub(super) unsafe fn port(link: *mut Object) -> mbm_port {
    let own = &(*link).port;
    mbm_port {
        context: link.cast(),
        read: Some(read),
        write: Some(write),
        micros: Some(micros),
        flush: own.flush.map(|_| flush as _),
        preTransmission: own.preTransmission.map(|_| pre_transmission as _),
        postTransmission: own.postTransmission.map(|_| post_transmission as _),
        idle: own.idle.map(|_| idle as _),
    }
}

// SAFETY, of all functions here: only the port that `port` returned names them, so `context`
// is a link that is begun, and the hooks that they call are those of a complete port.

unsafe extern "C" fn read(context: *mut c_void, bytes: *mut u8, capacity: u16) -> i16 {
    // SAFETY: see above. The core of the link is not used while the hook runs.
    unsafe {
        let count = moved(context, |own| {
            own.read.unwrap_unchecked()(own.context, bytes, capacity)
        });
        if count > 0 {
            let link = context.cast::<Object>();
            (*link).has_read = true;
            (*link).core.note_received();
        }
        count
    }
}

unsafe extern "C" fn write(context: *mut c_void, bytes: *const u8, length: u16) -> i16 {
    // SAFETY: see above.
    unsafe {
        (*context.cast::<Object>()).core.is_vain = false;
        moved(context, |own| {
            own.write.unwrap_unchecked()(own.context, bytes, length)
        })
    }
}

/// Moves bytes, if the link is up. A link that is lost moves no bytes. Only a master to which
/// the client gave the line learns that the link is lost.
///
/// # Safety
/// As above.
unsafe fn moved(context: *mut c_void, action: impl FnOnce(&mbm_port) -> i16) -> i16 {
    let link = context.cast::<Object>();
    // SAFETY: see above. The core of the link is not used while the hook runs.
    unsafe {
        if (*link).core.is_up() {
            let count = action(&(*link).port);
            if count >= 0 {
                return count;
            }
            (*link).core.is_lost = true;
        }
        match client::queue((*link).kind.client.cast()).suspended {
            true => -1,
            false => 0,
        }
    }
}

/// The client's own port.
///
/// # Safety
/// As above.
unsafe fn own(context: *mut c_void) -> *const mbm_port {
    &raw const (*context.cast::<Object>()).port
}

passing_hooks!(own);

unsafe extern "C" fn post_transmission(context: *mut c_void) {
    let port = own(context);
    if let Some(hook) = (*port).postTransmission {
        hook((*port).context);
    }
}
