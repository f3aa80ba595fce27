//! The line under a client: lost and found, lent and taken back.

use super::object::{mbm_client, on_transport, queue, SerialTransport, TcpTransport};
use crate::framing::MBM_FRAMING_RTU;
use crate::master::{self, mbm_master, Core};
use crate::pointers;
use core::ffi::c_void;
use mbm::client::Transport as _;
use mbm::error::Status;

/// What closes a link and opens it anew, for mbm_client_reconnect.
#[repr(C)]
pub struct mbm_linkHooks {
    /// Handed to both hooks. Yours, may be NULL.
    pub context: *mut c_void,
    /// Optional: closes the link, if it is open.
    pub disconnect: Option<unsafe extern "C" fn(context: *mut c_void)>,
    /// Optional: opens the link without waiting. Returns MBM_OK, MBM_PENDING if
    /// that goes on while the port takes no bytes yet, or another status.
    pub connect: Option<unsafe extern "C" fn(context: *mut c_void) -> u8>,
}

/// Closes the link and opens it anew. What was half received is forgotten, and
/// requests that were under way end with MBM_LINK_LOST at the next polls; those
/// that still waited go over the new link.
///
/// @param client  the object
/// @param link    what does it, used during this call only; NULL if that has been
///                done already
/// @return what `connect` returns, MBM_OK without it; MBM_BUSY while the line is
///         lent, MBM_INVALID_ARGUMENT or MBM_NOT_INITIALISED
#[no_mangle]
pub unsafe extern "C" fn mbm_client_reconnect(
    client: *mut mbm_client,
    link: *const mbm_linkHooks,
) -> u8 {
    // SAFETY: as the header demands. No reference to the client lives while the
    // hooks of the link are called.
    unsafe {
        let status = pointers::with(client, |object| {
            if queue(object).suspended {
                return Status::BUSY;
            }
            let release = (*(*object).kind).release;
            pointers::with_hooks(client, || release(object, None));
            queue(object).interrupt();
            Status::OK
        });
        if status != Status::OK.code() || link.is_null() {
            return status;
        }
        if let Some(disconnect) = (*link).disconnect {
            disconnect((*link).context);
        }
        let Some(connect) = (*link).connect else {
            return status;
        };
        let status = connect((*link).context);
        if status != Status::OK.code() {
            queue(pointers::object(client)).connected = false;
        }
        status
    }
}

/// Whether the link is not known to be lost.
///
/// If `connect` of mbm_client_reconnect returned MBM_PENDING, this is 0 until a reply
/// arrives. Do not reconnect again before the connection had its time: the port knows
/// better whether it is still being made, for example mbm_tcp_isConnected.
///
/// @param client  the object
/// @return 0 from a request that ended with MBM_LINK_LOST on, until a reply arrives
///         (an exception is one) or mbm_client_reconnect returns MBM_OK; 1 otherwise,
///         and also before the first request
#[no_mangle]
pub unsafe extern "C" fn mbm_client_isConnected(client: *const mbm_client) -> u8 {
    // SAFETY: as the header demands.
    unsafe { pointers::read(client, 0, |object| queue(object).connected.into()) }
}

/// Lends the line to a facade, whose functions then use the client's port; the
/// client's requests wait until mbm_client_resume. One of the two has the line
/// at any time. Until then the client's storage must stay: do not zero it.
///
/// @param client  the object; for a facade, of RTU frames on a line or over TCP
/// @param master  a facade with buffers, which gets the client's port; NULL if
///                you use the line in another way
/// @return MBM_OK; MBM_BUSY, with both unchanged, if a request is under way or the line
///         is lent already; MBM_INVALID_ARGUMENT or MBM_NOT_INITIALISED
#[no_mangle]
pub unsafe extern "C" fn mbm_client_suspend(
    client: *mut mbm_client,
    master: *mut mbm_master,
) -> u8 {
    // SAFETY: as the header demands.
    unsafe {
        let status = pointers::with(client, |object| {
            if !master.is_null() {
                if (*(*object).kind).framing != MBM_FRAMING_RTU {
                    // A facade speaks RTU.
                    return Status::INVALID_ARGUMENT;
                }
                match pointers::check(master) {
                    Status::OK if pointers::object(master).core().is_pending() => {
                        return Status::BUSY;
                    }
                    Status::OK | Status::NOT_INITIALISED => {}
                    refused => return refused,
                }
            }
            if !on_transport!(object, line => line.suspend(&mut (*object).queue)) {
                return Status::BUSY;
            }
            if !master.is_null() {
                master::prepare(master);
                let port = (*(*object).kind).port(object);
                pointers::object(master)
                    .core()
                    .port()
                    .set(port, (*port).context);
            }
            Status::OK
        });
        if status == Status::OK.code() && !master.is_null() {
            master::with_hooks(master, Core::line_used);
        }
        status
    }
}

/// Takes the line back. The facade has no port then, so that its functions refuse
/// with MBM_NOT_INITIALISED.
///
/// @param client  the object
/// @param master  as for mbm_client_suspend
/// @return MBM_OK, MBM_BUSY while the facade has a request under way,
///         MBM_INVALID_ARGUMENT if the line was not lent, MBM_NOT_INITIALISED
#[no_mangle]
pub unsafe extern "C" fn mbm_client_resume(client: *mut mbm_client, master: *mut mbm_master) -> u8 {
    // SAFETY: as the header demands.
    unsafe {
        pointers::with(client, |object| {
            if !queue(object).suspended {
                return Status::INVALID_ARGUMENT;
            }
            match pointers::check(master) {
                Status::OK => {
                    let core = pointers::object(master).core();
                    if core.is_pending() {
                        return Status::BUSY;
                    }
                    core.port().clear();
                }
                Status::BUSY => return Status::BUSY,
                // None, or none that has the port.
                _ => {}
            }
            queue(object).suspended = false;
            Status::OK
        })
    }
}
