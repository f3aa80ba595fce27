//! Beginning a server, and how it behaves.

use super::{mbm_server, mbm_unit, Core};
use crate::framing::MBM_MAX_TCP_FRAME;
use crate::pointers::{check, object, with_hooks, CObject, IN_HOOK};
use crate::port::{countable, mbm_port};
use mbm::error::Status;
use mbm::time;

/// The least that a frame buffer may have for RTU.
const LEAST: u16 = 16;

/// Begins a server: port, units and a buffer are all checked, then all kept; `framing`
/// does the rest.
///
/// # Safety
/// As the header demands of each argument.
#[cfg_attr(target_os = "none", inline(never))]
unsafe fn begin(
    server: *mut mbm_server,
    port: *const mbm_port,
    units: *mut mbm_unit,
    count: u8,
    frame: *mut u8,
    bytes: u16,
    framing: fn(&mut Core),
) -> Status {
    if server.is_null() || port.is_null() || units.is_null() || frame.is_null() || bytes < LEAST {
        return Status::INVALID_ARGUMENT;
    }
    // SAFETY: not NULL, so a port, and an object of which zero is a value of
    // every field.
    unsafe {
        if !(*port).is_complete() {
            return Status::INVALID_ARGUMENT;
        }
        if mbm_server::mark(server).read() == IN_HOOK {
            return Status::BUSY;
        }
        let core = object(server);
        with_hooks(server, || {
            // The driver of the port that the object had is not left on.
            if (*core).is_sending() {
                if let Some(post) = (*core).port.postTransmission {
                    post((*core).port.context);
                }
            }
            (*core).port.copy(&*port);
            (*core).storage.frame = frame;
            (*core).storage.units = units;
            (*core).storage.bytes = countable(bytes);
            (*core).storage.count = count;
            framing(&mut *core);
        });
    }
    Status::OK
}

/// Begins to serve units on a serial line, RTU. The rate is untold, so a frame
/// ends with 4 ms of silence: see mbm_server_setBaudRate.
///
/// May be called again at any time but from within its hooks; what was under way
/// is dropped; where a response was leaving, the port that the object had is called
/// to switch its driver off. A call that is refused changes nothing. Opens nothing: the port is
/// open already. Units are yours, may be shared between
/// servers, and stay where they are for as long as the object is used, as does
/// the buffer, which keeps nothing between requests.
///
/// @param server  the object; zeroed before the first call
/// @param port    copied; read, write and micros must be there
/// @param units   what is served: one unit, or an array of them
/// @param count   how many units
/// @param frame   bytes of one frame, for requests and responses
/// @param bytes   at least 16; MBM_MAX_FRAME hold any frame. Longer
///                requests are not heard, longer responses become exception 04
/// @return MBM_OK; MBM_INVALID_ARGUMENT for a NULL pointer, a missing hook or a
///         buffer that is too short; MBM_BUSY from within a hook of this server
#[no_mangle]
pub unsafe extern "C" fn mbm_server_beginRtu(
    server: *mut mbm_server,
    port: *const mbm_port,
    units: *mut mbm_unit,
    count: u8,
    frame: *mut u8,
    bytes: u16,
) -> u8 {
    // SAFETY: as the header demands.
    unsafe { begin(server, port, units, count, frame, bytes, Core::begin_rtu) }.code()
}

/// Begins to serve units on a serial line, ASCII (serial line guide V1.02,
/// 2.5.2). A frame whose next character takes longer than a second is dropped.
///
/// @param server  see mbm_server_beginRtu
/// @param port    see mbm_server_beginRtu
/// @param units   see mbm_server_beginRtu
/// @param count   see mbm_server_beginRtu
/// @param frame   see mbm_server_beginRtu
/// @param bytes   at least 32; MBM_MAX_ASCII_FRAME hold any frame
/// @return a status; see mbm_server_beginRtu
#[no_mangle]
pub unsafe extern "C" fn mbm_server_beginAscii(
    server: *mut mbm_server,
    port: *const mbm_port,
    units: *mut mbm_unit,
    count: u8,
    frame: *mut u8,
    bytes: u16,
) -> u8 {
    if bytes < 2 * LEAST {
        return Status::INVALID_ARGUMENT.code();
    }
    // SAFETY: as the header demands.
    unsafe { begin(server, port, units, count, frame, bytes, Core::begin_ascii) }.code()
}

/// Begins to serve units on a TCP connection that was accepted. Requests that
/// wait behind one another in the stream are answered in turn.
///
/// @param server  see mbm_server_beginRtu; one for each connection
/// @param port    see mbm_server_beginRtu; read, write and clock of the connection
/// @param units   see mbm_server_beginRtu; the unit ids 0 and 255 mean the first
/// @param count   see mbm_server_beginRtu
/// @param frame   see mbm_server_beginRtu; one for each connection
/// @param bytes   at least MBM_MAX_TCP_FRAME
/// @return a status; see mbm_server_beginRtu
#[no_mangle]
pub unsafe extern "C" fn mbm_server_beginTcp(
    server: *mut mbm_server,
    port: *const mbm_port,
    units: *mut mbm_unit,
    count: u8,
    frame: *mut u8,
    bytes: u16,
) -> u8 {
    if bytes < MBM_MAX_TCP_FRAME {
        return Status::INVALID_ARGUMENT.code();
    }
    // SAFETY: as the header demands.
    unsafe { begin(server, port, units, count, frame, bytes, Core::begin_tcp) }.code()
}

/// Begins to serve units over a stream of RTU frames, in which silence tells
/// nothing: a TCP connection of RTU over TCP, or a serial adapter that hands
/// bytes over in lumps. A frame ends where its own bytes say so; behind one that
/// is damaged, half a second of silence does.
///
/// @param server  see mbm_server_beginRtu; one for each connection
/// @param port    see mbm_server_beginRtu
/// @param units   see mbm_server_beginRtu; the unit ids 0 and 255 mean the first
/// @param count   see mbm_server_beginRtu
/// @param frame   see mbm_server_beginRtu; one for each connection
/// @param bytes   at least 16; MBM_MAX_FRAME hold any frame
/// @return a status; see mbm_server_beginRtu
#[no_mangle]
pub unsafe extern "C" fn mbm_server_beginRtuOverTcp(
    server: *mut mbm_server,
    port: *const mbm_port,
    units: *mut mbm_unit,
    count: u8,
    frame: *mut u8,
    bytes: u16,
) -> u8 {
    // SAFETY: as the header demands.
    unsafe {
        begin(
            server,
            port,
            units,
            count,
            frame,
            bytes,
            Core::begin_rtu_over_tcp,
        )
    }
    .code()
}

/// Sets the silence that ends a frame: t3.5 of RTU, the time between two
/// characters of ASCII, and in RTU over TCP the silence after a damaged frame. Without
/// effect in TCP frames. mbm_server_beginRtu and its sisters set it back.
///
/// @param server        the object
/// @param silenceUs     counted from the last byte seen
/// @return MBM_OK, MBM_INVALID_ARGUMENT, MBM_NOT_INITIALISED or MBM_BUSY
#[no_mangle]
pub unsafe extern "C" fn mbm_server_setSilence(server: *mut mbm_server, silenceUs: u32) -> u8 {
    // SAFETY: as the header demands.
    unsafe {
        let status = check(server);
        if status == Status::OK {
            (*object(server)).set_silence(silenceUs);
        }
        status.code()
    }
}

/// Tells the baud rate of an RTU line, from which t3.5 follows (serial line guide
/// V1.02, 2.5.1.1). It sets nothing on the line. Other framings do not end with t3.5:
/// for the time that those wait there is mbm_server_setSilence.
///
/// @param server  the object
/// @param baud    bits per second; 0 goes back to untold
/// @return MBM_OK, MBM_INVALID_ARGUMENT for NULL and for other framings,
///         MBM_NOT_INITIALISED or MBM_BUSY
#[no_mangle]
pub unsafe extern "C" fn mbm_server_setBaudRate(server: *mut mbm_server, baud: u32) -> u8 {
    // SAFETY: as the header demands.
    unsafe {
        match check(server) {
            Status::OK if (*object(server)).is_rtu_line() => {
                (*object(server)).set_silence(time::silence(baud));
                Status::OK.code()
            }
            Status::OK => Status::INVALID_ARGUMENT.code(),
            refused => refused.code(),
        }
    }
}

/// Tells that the receiver of an RTU line hears what the driver sends, so that as
/// many bytes as were sent are dropped behind each response. mbm_server_beginRtu
/// sets it back.
///
/// @param server  the object
/// @param on      0 (at first) or 1
/// @return MBM_OK, MBM_INVALID_ARGUMENT for NULL and for other framings,
///         MBM_NOT_INITIALISED or MBM_BUSY
#[no_mangle]
pub unsafe extern "C" fn mbm_server_setEchoDiscard(server: *mut mbm_server, on: u8) -> u8 {
    // SAFETY: as the header demands.
    unsafe {
        match check(server) {
            Status::OK if (*object(server)).set_echo_discard(on != 0) => Status::OK.code(),
            Status::OK => Status::INVALID_ARGUMENT.code(),
            refused => refused.code(),
        }
    }
}
