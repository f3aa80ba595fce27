//! The connections of a gateway.

use super::parts::mbm_gatewayConnection;
use super::{mbm_gateway, Core};
use crate::pointers;
use crate::port::mbm_port;
use mbm::error::Status;

/// Runs `action` on a gateway that has this place for a connection.
unsafe fn with_place(
    gateway: *mut mbm_gateway,
    connection: u8,
    action: impl FnOnce(*mut Core) -> Status,
) -> u8 {
    pointers::with(gateway, |core| {
        if connection >= (*core).storage.config.connectionCount {
            return Status::INVALID_ARGUMENT;
        }
        action(core)
    })
}

/// Reads something of a place for a connection; `otherwise` if the gateway has no such place.
unsafe fn read_place<T>(
    gateway: *const mbm_gateway,
    connection: u8,
    otherwise: T,
    getter: impl FnOnce(&mut Core) -> T,
) -> T {
    pointers::read(gateway, None, |core| {
        let is_there = connection < (*core).storage.config.connectionCount;
        is_there.then(|| getter(&mut *core))
    })
    .unwrap_or(otherwise)
}

/// Gives the gateway an accepted TCP connection. mbm_gateway_poll then reads its requests and
/// writes their responses. The gateway never opens or closes the socket itself.
///
/// @param connection  the number of a free place, below `connectionCount`
/// @param port        the connection; is copied. Its hooks read, write and micros are required. The
///                    clocks of all connections count the same time
/// @return a status; MBM_BUSY if the place has an open connection
#[no_mangle]
pub unsafe extern "C" fn mbm_gateway_open(
    gateway: *mut mbm_gateway,
    connection: u8,
    port: *const mbm_port,
) -> u8 {
    with_place(gateway, connection, |core| {
        let Some(port) = port.as_ref().filter(|port| port.is_complete()) else {
            return Status::INVALID_ARGUMENT;
        };
        if (*core).status(connection) == Status::OK {
            return Status::BUSY;
        }
        let place = (*core)
            .storage
            .config
            .connections
            .wrapping_add(connection.into());
        (*mbm_gatewayConnection::port(place)).copy(port);
        (*core).open(connection);
        Status::OK
    })
}

/// Gives up a connection and its requests. A request that a line has is cancelled: the device
/// may have received it, and the gateway discards its reply. The place is free then.
///
/// @param connection  the number of the place; nothing happens if it is free already
/// @return a status; MBM_BUSY also from within a hook of a port of its lines
#[no_mangle]
pub unsafe extern "C" fn mbm_gateway_close(gateway: *mut mbm_gateway, connection: u8) -> u8 {
    with_place(gateway, connection, |core| {
        if (*core).storage.config.check_clients() == Status::BUSY {
            return Status::BUSY;
        }
        pointers::with_hooks(gateway, || (*core).close(connection));
        Status::OK
    })
}

/// Returns the state of a connection. Call it after mbm_gateway_poll for each connection: if the
/// connection is lost, close its socket, and call mbm_gateway_close or mbm_gateway_open.
///
/// @param connection  the number of the place
/// @return MBM_OK while the connection is open; MBM_LINK_LOST if its port reported that the
///         connection is lost; MBM_MALFORMED_FRAME if it sent bytes that are not Modbus TCP;
///         MBM_NOT_INITIALISED for a free place
#[no_mangle]
pub unsafe extern "C" fn mbm_gateway_status(gateway: *const mbm_gateway, connection: u8) -> u8 {
    match pointers::check(gateway) {
        Status::OK => read_place(gateway, connection, Status::INVALID_ARGUMENT, |core| {
            core.status(connection)
        }),
        refused => refused,
    }
    .code()
}

/// Returns how many requests of a connection are pending: complete, but not answered yet.
/// The connection is not idle while it has one.
///
/// @param connection  the number of the place
/// @return the number of requests; 0 for a free place and for a number out of range
#[no_mangle]
pub unsafe extern "C" fn mbm_gateway_pending(gateway: *const mbm_gateway, connection: u8) -> u16 {
    read_place(gateway, connection, 0, |core| core.pending(connection))
}

/// Returns whether the next mbm_gateway_poll reads bytes from a connection. If not, the
/// connection has as many pending requests as it may have, and its next requests wait in its
/// socket: do not wait for bytes of it.
///
/// @param connection  the number of the place
/// @return 1 or 0
#[no_mangle]
pub unsafe extern "C" fn mbm_gateway_isReading(gateway: *const mbm_gateway, connection: u8) -> u8 {
    read_place(gateway, connection, 0, |core| {
        core.is_reading(connection).into()
    })
}
