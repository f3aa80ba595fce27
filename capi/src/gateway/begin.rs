//! Beginning a gateway.

use super::object::{mbm_gateway, Core};
use super::parts::{mbm_gatewayConfig, mbm_gatewayRequest};
use crate::pointers::{self, CObject, BEGUN};
use mbm::error::Status;

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
///         that does not exist or to a unit id above 255, and a line without client;
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
///
/// # Safety
/// Each pointer is NULL, or points to as many items as its count says.
unsafe fn check(config: &mbm_gatewayConfig) -> Status {
    if config.routes.is_null()
        || config.connections.is_null()
        || config.requests.is_null()
        || config.lines.is_null() && config.lineCount > 0
        || config.routeCount == 0
        || config.connectionCount == 0
        || config.lineCount >= super::MBM_GATEWAY_LOCAL
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
///
/// # Safety
/// `gateway` is NULL, or storage of a gateway, zeroed or begun.
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
