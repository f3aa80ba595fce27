//! The functions that begin a server, and its settings.

use super::buffers::Core;
use super::units::have_ids;
use super::{mbm_server, mbm_unit};
use crate::framing::MBM_MAX_TCP_FRAME;
use crate::pointers::{check, object, with_hooks, zero_on_host, CObject, BEGUN, IN_HOOK};
use crate::port::{countable, mbm_port};
use mbm::error::Status;

/// The shortest frame buffer for RTU, in bytes.
const MIN_FRAME: u16 = 16;

/// Begins a server: checks the port, the units and the buffer, then stores all of them.
/// `framing` sets the framing.
unsafe fn begin(
    server: *mut mbm_server,
    port: *const mbm_port,
    units: *mut mbm_unit,
    count: u8,
    frame: *mut u8,
    bytes: u16,
    framing: fn(&mut Core),
) -> Status {
    if server.is_null() || port.is_null() || units.is_null() || frame.is_null() || bytes < MIN_FRAME
    {
        return Status::INVALID_ARGUMENT;
    }
    // SAFETY: not NULL, so a port and the storage of an object. Zero is a valid value of
    // every field of the object.
    unsafe {
        if !(*port).is_complete() || !have_ids(units, count) {
            return Status::INVALID_ARGUMENT;
        }
        let mark = mbm_server::mark(server).read();
        if mark == IN_HOOK {
            return Status::BUSY;
        }
        if mark != BEGUN {
            zero_on_host(server);
        }
        let core = object(server);
        with_hooks(server, || {
            // The previous port must not keep its driver switched on.
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

/// As [`begin`], with a frame buffer of at least `least` bytes.
#[allow(clippy::too_many_arguments)]
#[inline(always)]
unsafe fn begin_with(
    server: *mut mbm_server,
    port: *const mbm_port,
    units: *mut mbm_unit,
    count: u8,
    frame: *mut u8,
    bytes: u16,
    least: u16,
    framing: fn(&mut Core),
) -> u8 {
    if bytes < least {
        return Status::INVALID_ARGUMENT.code();
    }
    begin(server, port, units, count, frame, bytes, framing).code()
}

functions! {
    (server: *mut mbm_server, port: *const mbm_port, units: *mut mbm_unit, count: u8,
        frame: *mut u8, bytes: u16)

    /// Begins a server for RTU on a serial line. The baud rate is unknown at first, so 4 ms
    /// of silence end a frame: see mbm_server_setBaudRate.
    ///
    /// You may call it again at any time, but not from within a hook of the server. The server then
    /// drops the request that it serves and the response that it sends; if it was sending, it calls
    /// postTransmission of the previous port to switch the driver off. A call that fails changes
    /// nothing. The function does not open the port. The units and the buffer must stay valid, at
    /// the same address, for as long as the server is used. Several servers may share units. The
    /// buffer holds no data between requests.
    ///
    /// @param port   is copied; its hooks read, write and micros are required
    /// @param units  the units to serve: one unit, or an array of units
    /// @param count  how many units
    /// @param frame  buffer for one frame, a request or a response
    /// @param bytes  size of `frame` in bytes, at least 16. MBM_MAX_FRAME holds every frame. The server
    ///               ignores a longer request, and answers exception 04 in place of a longer response
    /// @return a status; MBM_INVALID_ARGUMENT for a unit with an id above 255
    fn mbm_server_beginRtu() = begin_with(0, Core::begin_rtu);

    /// Begins a server for ASCII on a serial line (serial line guide V1.02, 2.5.2). The
    /// server drops a frame if the next character takes longer than one second.
    ///
    /// @param bytes  size of `frame` in bytes, at least 32; MBM_MAX_ASCII_FRAME holds every frame
    /// @return a status; see mbm_server_beginRtu
    fn mbm_server_beginAscii() = begin_with(2 * MIN_FRAME, Core::begin_ascii);

    /// Begins a server on an accepted TCP connection. If several requests are in the stream,
    /// the server answers them in order.
    ///
    /// @param port   see mbm_server_beginRtu; its hooks read and write the connection and give the time
    /// @param units  see mbm_server_beginRtu; the unit ids 0 and 255 address the first unit
    /// @param frame  see mbm_server_beginRtu; one for each connection
    /// @param bytes  size of `frame` in bytes, at least MBM_MAX_TCP_FRAME
    /// @return a status; see mbm_server_beginRtu
    fn mbm_server_beginTcp() = begin_with(MBM_MAX_TCP_FRAME, Core::begin_tcp);

    /// Begins a server for a stream of RTU frames without timing: a TCP connection that
    /// carries RTU, or a serial adapter that delivers bytes in blocks. The server finds the
    /// end of a frame from its bytes. After a damaged frame, half a second of silence ends
    /// the damaged bytes.
    ///
    /// @param units  see mbm_server_beginRtu; the unit ids 0 and 255 address the first unit
    /// @param frame  see mbm_server_beginRtu; one for each connection
    /// @param bytes  size of `frame` in bytes, at least 16; MBM_MAX_FRAME holds every frame
    /// @return a status; see mbm_server_beginRtu
    fn mbm_server_beginRtuOverTcp() = begin_with(0, Core::begin_rtu_over_tcp);
}

/// Sets the silence that ends a frame. In RTU it is t3.5, in ASCII the longest time
/// between two characters, in RTU over TCP the silence after a damaged frame. It has no
/// effect in TCP. The begin functions restore the default.
///
/// @param silenceUs  microseconds since the last received byte; a value above 2^31 (36 minutes)
///                   counts as 2^31
#[no_mangle]
pub unsafe extern "C" fn mbm_server_setSilence(server: *mut mbm_server, silenceUs: u32) -> u8 {
    let status = check(server);
    if status == Status::OK {
        (*object(server)).set_silence(silenceUs);
    }
    status.code()
}

/// Sets the baud rate from which an RTU server computes t3.5 (serial line guide V1.02,
/// 2.5.1.1), and how long missing bytes of a request take. It does not change the rate of the
/// line. Other framings do not use t3.5: see mbm_server_setSilence.
///
/// @param baud  bits per second; 0 if the rate is unknown, as after mbm_server_beginRtu
/// @return a status; MBM_INVALID_ARGUMENT for other framings
#[no_mangle]
pub unsafe extern "C" fn mbm_server_setBaudRate(server: *mut mbm_server, baud: u32) -> u8 {
    match check(server) {
        Status::OK if (*object(server)).is_rtu_line() => {
            (*object(server)).set_baud_rate(baud);
            Status::OK.code()
        }
        Status::OK => Status::INVALID_ARGUMENT.code(),
        refused => refused.code(),
    }
}

/// Sets how long a UART or an adapter may hold received bytes back on an RTU line: the latency
/// timer of a USB adapter, the threshold of a FIFO, the tick of a scheduler. If a request to one
/// of the units lacks bytes that its first bytes announce after t3.5, the server waits for as long
/// as the missing bytes and ten more take at the baud rate, and for this time. A longer time does
/// not delay complete requests. The begin functions restore the default.
///
/// @param latencyMs  0 to 65535 ms; 50 ms after a begin function
#[no_mangle]
pub unsafe extern "C" fn mbm_server_setReceiveLatency(
    server: *mut mbm_server,
    latencyMs: u16,
) -> u8 {
    let status = check(server);
    if status == Status::OK {
        (*object(server)).set_receive_latency(latencyMs);
    }
    status.code()
}

/// Says whether the receiver of an RTU line gets the bytes that the driver sends (a local
/// echo). Without this call the server finds out: it drops a frame that is byte for byte its
/// last response, until another frame, or none in time, has followed a response. A client whose
/// very first requests are the same write again and again, each less than 80 ms after the
/// response, then loses some of them: say that there is no echo. mbm_server_beginRtu takes the
/// answer back.
///
/// @param on  0: there is none, so no request is taken for it; anything else: there is one, even if
///            a response came without it
/// @return a status; MBM_INVALID_ARGUMENT for other framings
#[no_mangle]
pub unsafe extern "C" fn mbm_server_setEchoDiscard(server: *mut mbm_server, on: u8) -> u8 {
    match check(server) {
        Status::OK if (*object(server)).set_echo_discard(on != 0) => Status::OK.code(),
        Status::OK => Status::INVALID_ARGUMENT.code(),
        refused => refused.code(),
    }
}
