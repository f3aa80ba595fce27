//! Moving a client's requests on, and giving them up.

use super::{
    calls, client, mbm_client, mbm_clientRequest, now, on_line, pointers, Ascii, AsciiLine, Kind,
    Lent, Line, Object, Rtu, RtuLine, TcpIp, TcpLine,
};
use crate::client::Job as _;
use crate::error::Status;

/// Moves all requests on, without waiting, and calls `done` of those that have
/// ended, of at most 17 in one call.
///
/// Call it as often as you like; mbm_client_pollDelay tells when the next call
/// is due.
///
/// @param client  the object
/// @return MBM_PENDING while requests wait or are under way, MBM_OK if there are
///         none, MBM_BUSY from within `done` and while the line is lent;
///         MBM_INVALID_ARGUMENT or MBM_NOT_INITIALISED
#[no_mangle]
pub unsafe extern "C" fn mbm_client_poll(client: *mut mbm_client) -> u8 {
    // SAFETY: as the header demands.
    unsafe {
        pointers::with(client, |object| match (*object).polling {
            true => Status::BUSY,
            false => (calls(object).poll)(client),
        })
    }
}

/// # Safety
/// As for [`now`].
#[cfg_attr(not(target_os = "none"), inline(never))]
unsafe fn poll_delay<L: Kind>(object: *mut Object) -> u32 {
    // SAFETY: as the caller promises.
    unsafe {
        let now = now::<L>(object);
        client::<L>(object).poll_delay(now)
    }
}

/// How long mbm_client_poll will find nothing to do unless a byte arrives, so
/// that a program may wait for one in select, or sleep, until then. Bytes are taken
/// only while a request is pending: with none, wait for something else.
///
/// @param client  the object
/// @return microseconds; 0 means poll now, and is returned within a hook of the port;
///         0xFFFFFFFF that there is no request; 1000
///         while a TCP port does not take what is to be sent: to poll sooner, wait
///         for that too, as mbm_tcp_wait does
#[no_mangle]
pub unsafe extern "C" fn mbm_client_pollDelay(client: *mut mbm_client) -> u32 {
    // SAFETY: as the header demands.
    unsafe {
        match pointers::check(client) {
            Status::OK => pointers::calling(client, || {
                let object = pointers::object(client);
                match calls(object).kind {
                    Line::Rtu => poll_delay::<RtuLine>(object),
                    Line::Ascii => poll_delay::<AsciiLine>(object),
                    Line::Tcp => poll_delay::<TcpLine>(object),
                }
            }),
            Status::BUSY => 0,
            _ => u32::MAX,
        }
    }
}

/// How many requests wait or are under way.
///
/// @param client  the object
/// @return 0 to 16
#[no_mangle]
pub unsafe extern "C" fn mbm_client_pending(client: *const mbm_client) -> u8 {
    // SAFETY: as the header demands.
    unsafe {
        pointers::ask(
            client,
            0,
            |object| on_line!(object, client => client.pending() as u8),
        )
    }
}

/// Gives a request up. It is yours again at once, with the status MBM_CANCELLED;
/// `done` is not called. It may have reached the device, and may still be answered.
///
/// @param client   the object
/// @param request  a request that this client was given
/// @return MBM_OK; MBM_NOT_PENDING, with nothing changed, for a request that has
///         ended already or was never queued here; MBM_INVALID_ARGUMENT or
///         MBM_NOT_INITIALISED
#[no_mangle]
pub unsafe extern "C" fn mbm_client_cancel(
    client: *mut mbm_client,
    request: *mut mbm_clientRequest,
) -> u8 {
    // SAFETY: as the header demands.
    unsafe {
        pointers::with(client, |object| match Lent::new(request) {
            None => Status::INVALID_ARGUMENT,
            Some(request) => {
                let cancel =
                    || on_line!(object, client => client.cancel(|job| *job == request)).is_none();
                match pointers::calling(client, cancel) {
                    true => Status::NOT_PENDING,
                    false => Status::OK,
                }
            }
        })
    }
}

/// The transaction identifier on the wire: that of the TCP frame in which the request
/// was sent last. The client chooses it, another one for each frame, also for a retry.
///
/// @param request  a request, pending or ended
/// @return the identifier; 0 in other framings, for a request that was never sent, and
///         for NULL. 0 is also an identifier
#[no_mangle]
pub unsafe extern "C" fn mbm_client_wireTransaction(request: *const mbm_clientRequest) -> u16 {
    // SAFETY: as the header demands: NULL, or a request that is zeroed or was used.
    unsafe { Lent::new(request.cast_mut()).map_or(0, |request| request.ticket().wire()) }
}
