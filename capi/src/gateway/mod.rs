//! `mbm_gateway_*`: from Modbus TCP connections to the lines of clients.

mod connection;
mod parts;
mod settings;
mod storage;

pub use connection::*;
pub use parts::*;
pub use settings::*;

use crate::pointers::{self, c_object, CObject, BEGUN};
use core::ffi::c_void;
use mbm::error::Status;
use mbm::gateway::Gateway;
use storage::Parts;

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

type Core = Gateway<Parts>;

/// The real content of an `mbm_gateway`.
#[repr(C)]
pub(super) struct Object {
    core: Core,
    mark: u8,
}

c_object! { mbm_gateway, *mut Core, core }

/// Begins a gateway without connections.
///
/// You may call it again at any time, also with another config. The gateway then gives up all
/// connections and their requests; it cancels those that a line has, and its settings return
/// to their defaults. A call that is refused changes nothing.
///
/// @param config  the parts of the gateway. All memory that it points to must stay valid, and
///                must be used by this gateway only, for as long as the gateway is used; lines,
///                connections and requests are initialised with MBM_INIT
/// @return a status; MBM_INVALID_ARGUMENT for fewer requests than connections, a route to a line
///         that does not exist or to a unit id above 255, unless it is MBM_GATEWAY_UNIT_0, and
///         a line without client;
///         MBM_NOT_INITIALISED if the client of a line was not begun; MBM_BUSY also from within a
///         hook of a client of its lines
#[no_mangle]
pub unsafe extern "C" fn mbm_gateway_begin(
    gateway: *mut mbm_gateway,
    config: *const mbm_gatewayConfig,
) -> u8 {
    if config.is_null() {
        return Status::INVALID_ARGUMENT.code();
    }
    let status = match check(&*config) {
        Status::OK => give_up(gateway),
        refused => refused,
    };
    if status == Status::OK {
        // Zero is a valid value of every field of the object.
        let core = &mut *pointers::object(gateway);
        let parts = &mut core.storage;
        copy(&mut parts.config, &*config);
        (parts.serve, parts.forward_declared) = (None, None);
        for index in 0..parts.config.requestCount {
            // The client of the line that had it, if any, has it no more.
            let place: *mut mbm_gatewayRequest = parts.config.requests.add(index.into());
            (*place).request.status = Status::OK.code();
            (*place).request.done = None;
        }
        core.reset();
        mbm_gateway::mark(gateway).write(BEGUN);
    }
    status.code()
}

/// Copies a config. (The assignment of the whole struct calls memcpy, which most firmware does
/// not need otherwise.)
fn copy(to: &mut mbm_gatewayConfig, from: &mbm_gatewayConfig) {
    to.routes = from.routes;
    to.lines = from.lines;
    to.connections = from.connections;
    to.requests = from.requests;
    to.requestCount = from.requestCount;
    to.routeCount = from.routeCount;
    to.lineCount = from.lineCount;
    to.connectionCount = from.connectionCount;
}

/// [`Status::OK`] if a gateway can consist of these parts.
unsafe fn check(config: &mbm_gatewayConfig) -> Status {
    if config.routes.is_null()
        || config.connections.is_null()
        || config.requests.is_null()
        || config.lines.is_null() && config.lineCount > 0
        || config.routeCount == 0
        || config.connectionCount == 0
        || config.lineCount >= MBM_GATEWAY_LOCAL
        || config.requestCount < config.connectionCount.into()
        || config.requestCount == u16::MAX
        || !config
            .routes()
            .iter()
            .all(|route| route.is_valid(config.lineCount))
    {
        return Status::INVALID_ARGUMENT;
    }
    config.check_clients()
}

/// Gives up the connections of a gateway that was begun before.
unsafe fn give_up(gateway: *mut mbm_gateway) -> Status {
    match pointers::check(gateway) {
        Status::OK => {}
        Status::NOT_INITIALISED => return Status::OK,
        refused => return refused,
    }
    let core: *mut Core = pointers::object(gateway);
    if (*core).storage.config.check_clients() == Status::BUSY {
        return Status::BUSY;
    }
    pointers::with_hooks(gateway, || {
        for connection in 0..(*core).storage.config.connectionCount {
            (*core).close(connection);
        }
    });
    Status::OK
}

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
