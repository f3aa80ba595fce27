//! The client's link: lost and opened again, suspended and resumed.

use super::object::{mbm_client, on_transport, queue, SerialTransport, TcpTransport};
use crate::framing::MBM_FRAMING_RTU;
use crate::line::{self, mbm_line};
use crate::pointers;
use core::ffi::c_void;
use mbm::client::Transport as _;
use mbm::error::Status;

/// Your hooks that close a link and open it again, for mbm_link_begin and
/// mbm_client_reconnect.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct mbm_linkHooks {
    /// Your pointer, passed to all hooks; may be NULL.
    pub context: *mut c_void,
    /// Optional: closes the link, if it is open.
    pub disconnect: Option<unsafe extern "C" fn(context: *mut c_void)>,
    /// Optional for mbm_client_reconnect: opens the link without waiting. Returns MBM_OK if the
    /// link is open, MBM_PENDING if the connection is still being made and the port accepts no
    /// bytes yet, or another status.
    pub connect: Option<unsafe extern "C" fn(context: *mut c_void) -> u8>,
    /// For mbm_link_begin only; optional if `connect` never returns MBM_PENDING. Returns MBM_OK
    /// if the link is open, MBM_PENDING while the connection is still being made, or another
    /// status.
    pub status: Option<unsafe extern "C" fn(context: *mut c_void) -> u8>,
}

/// Closes the link and opens it again. The client discards an incomplete response. Requests
/// in flight end with MBM_LINK_LOST at the next calls of mbm_client_poll. Requests
/// that were not sent yet are sent over the new link.
///
/// @param link  your hooks, used during this call only; NULL if you have opened the link again
///              already
/// @return what `connect` returns, or MBM_OK without `connect`; MBM_BUSY while the client is
///         suspended
#[no_mangle]
pub unsafe extern "C" fn mbm_client_reconnect(
    client: *mut mbm_client,
    link: *const mbm_linkHooks,
) -> u8 {
    // No reference to the client lives while the hooks of the link are called.
    let status = pointers::with(client, |object| {
        if queue(object).suspended {
            return Status::BUSY;
        }
        let release = (*(*object).kind).release;
        pointers::with_hooks(client, || release(object, None));
        queue(object).interrupt();
        queue(object).connected = true;
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

/// Returns whether the link works, as far as the client knows.
///
/// If `connect` of mbm_client_reconnect returned MBM_PENDING, this function returns 0 until
/// a reply arrives. Do not reconnect again while the connection is still being made. The
/// port knows whether it is: for example, call mbm_tcp_isConnected.
///
/// @return 0 after a request ended with MBM_LINK_LOST, until a reply or an exception arrives or
///         mbm_client_reconnect returns MBM_OK; otherwise 1, also before the first request. With a
///         link: 0 from each loss of it until it is open again
#[no_mangle]
pub unsafe extern "C" fn mbm_client_isConnected(client: *const mbm_client) -> u8 {
    pointers::read(client, 0, |object| queue(object).connected.into())
}

/// Suspends the client, so that a line can use its port. The client's requests wait until
/// mbm_client_resume. Until then the line uses the client's storage, and the client remembers
/// the line: keep both.
///
/// @param client  the object. If `line` is not NULL, it must use RTU or RTU over TCP
/// @param line    a line, which then uses the client's port; NULL if you use the wire in another
///                way
/// @return a status; MBM_BUSY if a request is in flight or the client is suspended already
#[no_mangle]
pub unsafe extern "C" fn mbm_client_suspend(client: *mut mbm_client, line: *mut mbm_line) -> u8 {
    let status = pointers::with(client, |object| {
        if !line.is_null() {
            if (*(*object).kind).framing != MBM_FRAMING_RTU {
                // A line uses RTU frames only.
                return Status::INVALID_ARGUMENT;
            }
            match pointers::check(line) {
                Status::OK if pointers::object(line).is_pending() => return Status::BUSY,
                Status::OK | Status::NOT_INITIALISED => {}
                refused => return refused,
            }
        }
        if !on_transport!(object, transport => transport.suspend(&mut (*object).queue)) {
            return Status::BUSY;
        }
        (*object).borrower = line;
        if !line.is_null() {
            let _ = line::prepare(line);
            let port = (*(*object).kind).port(object);
            pointers::object(line).port.set(port);
        }
        Status::OK
    });
    if status == Status::OK.code() && !line.is_null() {
        pointers::with_hooks(client, || line::with_hooks(line, line::Core::line_used));
    }
    status
}

/// Resumes the client. The line then has no port: requests of its nodes return
/// MBM_NOT_INITIALISED. A line that was begun on another port meanwhile keeps that port.
///
/// @param line  the line that was passed to mbm_client_suspend; NULL if none was
/// @return a status; MBM_BUSY while a request of the line is pending; MBM_INVALID_ARGUMENT if the
///         client was not suspended, and for any other line
#[no_mangle]
pub unsafe extern "C" fn mbm_client_resume(client: *mut mbm_client, line: *mut mbm_line) -> u8 {
    pointers::with(client, |object| {
        if !queue(object).suspended || (*object).borrower != line {
            return Status::INVALID_ARGUMENT;
        }
        match pointers::check(line) {
            Status::OK => {
                let core = pointers::object(line);
                if core.is_pending() {
                    return Status::BUSY;
                }
                core.port.clear_if((*(*object).kind).port(object));
            }
            Status::BUSY => return Status::BUSY,
            // There is no line, or it was zeroed.
            _ => {}
        }
        queue(object).suspended = false;
        Status::OK
    })
}
