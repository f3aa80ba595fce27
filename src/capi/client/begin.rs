//! A client of each kind of line.

use super::{client, mbm_client, pointers, Kind, Lent, LentByC, Object};
use super::{Ascii, Rtu, TcpIp};
use crate::capi::frame::{MBM_FRAMING_ASCII, MBM_FRAMING_RTU, MBM_FRAMING_TCP};
use crate::capi::port::{countable, mbm_port};
use crate::client::{Line, Serial, Tcp, ASCII_SILENCE, STREAM_SILENCE};
use crate::error::Status;
use crate::frame::{ascii, ascii_window, rtu, Search};

/// The least that a frame buffer may have for ASCII: the shortest request and response,
/// a function code and two words.
const LEAST_ASCII: u16 = 17;

/// Makes a client of a kind of line out of storage.
///
/// # Safety
/// As the header demands of the begin functions.
unsafe fn begin<L: Kind>(
    pointer: *mut mbm_client,
    port: *const mbm_port,
    frame: *mut u8,
    frame_bytes: u16,
) -> Status {
    if pointer.is_null() || port.is_null() || frame.is_null() || frame_bytes < 8 {
        return Status::INVALID_ARGUMENT;
    }
    // SAFETY: not NULL, so a port.
    let port = unsafe { &*port };
    if !port.is_complete() {
        return Status::INVALID_ARGUMENT;
    }
    // SAFETY: not NULL, so storage of an object, zeroed or begun; zero is a value
    // of every field but for the calls, which no one uses before they are set.
    unsafe {
        if pointers::check(pointer) != Status::NOT_INITIALISED {
            return Status::BUSY;
        }
        let object = pointers::object(pointer);
        (*object).calls = &L::CALLS;
        let client = client::<L>(object);
        client.preset();
        let (settings, means, place) = client.line.parts();
        settings.preset();
        place.copy(port);
        means.frame = frame;
        means.frame_bytes = countable(frame_bytes);
        Object::mark(pointer).write(Object::BEGUN);
    }
    Status::OK
}

/// As [`begin`], for the lines of [`Serial`].
unsafe fn begin_serial<W: Search + 'static>(
    pointer: *mut mbm_client,
    port: *const mbm_port,
    frame: *mut u8,
    frame_bytes: u16,
    broadcasts: bool,
    silence: Option<u32>,
) -> u8
where
    Serial<mbm_port, LentByC, Lent, W>: Kind,
{
    // SAFETY: as the header demands.
    unsafe {
        let status = begin::<Serial<mbm_port, LentByC, Lent, W>>(pointer, port, frame, frame_bytes);
        if status != Status::OK {
            return status.code();
        }
        let object = pointers::object(pointer);
        let line = &mut client::<Serial<mbm_port, LentByC, Lent, W>>(object).line;
        line.set_broadcasts(broadcasts);
        let engine = line.transaction();
        if let Some(silence) = silence {
            engine.settings.gap = 0;
            engine.settings.silence = silence;
        }
        pointers::calling(pointer, || engine.line_used());
        Status::OK.code()
    }
}

/// Makes an object a client of a serial line, in RTU frames (serial line guide
/// V1.02, 2.5.1).
///
/// @param client      the object, zeroed
/// @param port        copied; read, write and micros must be there
/// @param frame       bytes of one frame, valid for as long as the client is used
/// @param frameBytes  at least 8; 256 hold any frame
/// @return MBM_OK, MBM_BUSY with nothing changed if it was begun already (to begin
///         anew, zero it while nothing is pending), or MBM_INVALID_ARGUMENT
#[no_mangle]
pub unsafe extern "C" fn mbm_client_beginRtu(
    client: *mut mbm_client,
    port: *const mbm_port,
    frame: *mut u8,
    frameBytes: u16,
) -> u8 {
    // SAFETY: as the header demands.
    unsafe { begin_serial::<rtu::Window>(client, port, frame, frameBytes, true, None) }
}

/// Makes an object a client of a serial line, in ASCII frames (serial line guide
/// V1.02, 2.5.2). No gap is kept between frames; a second without a character
/// ends one that is not whole.
///
/// @param client      the object, zeroed
/// @param port        copied; read, write and micros must be there
/// @param frame       bytes of one frame, valid for as long as the client is used
/// @param frameBytes  at least 17; 513 hold any frame
/// @return MBM_OK, MBM_BUSY with nothing changed if it was begun already (to begin
///         anew, zero it while nothing is pending), or MBM_INVALID_ARGUMENT
#[no_mangle]
pub unsafe extern "C" fn mbm_client_beginAscii(
    client: *mut mbm_client,
    port: *const mbm_port,
    frame: *mut u8,
    frameBytes: u16,
) -> u8 {
    let silence = Some(ASCII_SILENCE);
    if frameBytes < LEAST_ASCII {
        return Status::INVALID_ARGUMENT.code();
    }
    // SAFETY: as the header demands.
    unsafe {
        let status =
            begin_serial::<ascii_window::Window>(client, port, frame, frameBytes, true, silence);
        if status == Status::OK.code() {
            let object = pointers::object(client);
            (*object).framing = MBM_FRAMING_ASCII;
            *delimiter(object) = ascii::END;
        }
        status
    }
}

/// What ends the frames of an ASCII client.
///
/// # Safety
/// As for [`client`].
unsafe fn delimiter<'a>(object: *mut Object) -> &'a mut u8 {
    // SAFETY: as the caller promises.
    let ascii: &mut Ascii = unsafe { client(object) };
    &mut ascii.line.transaction().search().delimiter
}

/// Sets the character that ends ASCII frames behind CR, in place of LF, in both
/// directions; for devices that were told another one (function 08 with
/// sub-function 03, V1.1b3, 6.8.1). That request is answered with the old one: call
/// this when it has ended, for example from its `done`.
///
/// @param client     the object, begun with mbm_client_beginAscii
/// @param character  1 to 127, but CR, the colon and hexadecimal digits
/// @return MBM_OK; MBM_BUSY while a request is under way; MBM_INVALID_ARGUMENT, also
///         for a client of another framing; MBM_NOT_INITIALISED
#[no_mangle]
pub unsafe extern "C" fn mbm_client_setDelimiter(client: *mut mbm_client, character: u8) -> u8 {
    let part_of_a_frame = character.is_ascii_hexdigit() || matches!(character, b':' | b'\r');
    // SAFETY: as the header demands.
    unsafe {
        pointers::with(client, |object| {
            if (*object).framing != MBM_FRAMING_ASCII
                || !(1..=127).contains(&character)
                || part_of_a_frame
            {
                return Status::INVALID_ARGUMENT;
            }
            let ascii: &mut Ascii = super::client(object);
            if !ascii.line.is_idle() {
                return Status::BUSY;
            }
            *delimiter(object) = character;
            Status::OK
        })
    }
}

/// Makes an object a client that sends RTU frames through a TCP stream, for
/// converters that pass on what they get. No gap is kept, nothing is broadcast.
///
/// @param client      the object, zeroed
/// @param port        copied; read, write and micros must be there
/// @param frame       bytes of one frame, valid for as long as the client is used
/// @param frameBytes  at least 8; 256 hold any frame
/// @return MBM_OK, MBM_BUSY with nothing changed if it was begun already (to begin
///         anew, zero it while nothing is pending), or MBM_INVALID_ARGUMENT
#[no_mangle]
pub unsafe extern "C" fn mbm_client_beginRtuOverTcp(
    client: *mut mbm_client,
    port: *const mbm_port,
    frame: *mut u8,
    frameBytes: u16,
) -> u8 {
    let silence = Some(STREAM_SILENCE);
    // SAFETY: as the header demands.
    unsafe { begin_serial::<rtu::Window>(client, port, frame, frameBytes, false, silence) }
}

/// Makes an object a client of a TCP stream, in frames with the MBAP header
/// (messaging on TCP/IP guide V1.0b, 3.1.3). All 16 requests may be under way at
/// once; responses are matched by their transaction id, in any order.
///
/// @param client         the object, zeroed
/// @param port           copied; read, write and micros must be there
/// @param incoming       received bytes, valid for as long as the client is used
/// @param incomingBytes  at least 9; 260 hold any frame, more take in more
///                       responses at a time
/// @param outgoing       bytes to send, valid for as long as the client is used
/// @param outgoingBytes  at least 12; 260 hold any frame, more gather more
///                       requests for one write
/// @return MBM_OK, MBM_BUSY with nothing changed if it was begun already (to begin
///         anew, zero it while nothing is pending), or MBM_INVALID_ARGUMENT
#[no_mangle]
pub unsafe extern "C" fn mbm_client_beginTcp(
    client: *mut mbm_client,
    port: *const mbm_port,
    incoming: *mut u8,
    incomingBytes: u16,
    outgoing: *mut u8,
    outgoingBytes: u16,
) -> u8 {
    if incomingBytes < 9 || outgoing.is_null() || outgoingBytes < 12 {
        return Status::INVALID_ARGUMENT.code();
    }
    // SAFETY: as the header demands.
    unsafe {
        let status = begin::<Tcp<mbm_port, LentByC>>(client, port, incoming, incomingBytes);
        if status == Status::OK {
            let object = pointers::object(client);
            (*object).framing = MBM_FRAMING_TCP;
            let tcp: &mut TcpIp = super::client(object);
            tcp.line.limit(super::MBM_CLIENT_DEPTH);
            tcp.line.means.outgoing = outgoing;
            tcp.line.means.outgoing_bytes = countable(outgoingBytes);
        }
        status.code()
    }
}

/// Sets how many requests are under way at once on TCP, for servers that take fewer
/// at a time (NumberMaxOfServerTransaction of the messaging on TCP/IP guide V1.0b, 1 to
/// 16); some drop what comes in one segment with another request. The queue holds 16 in any case.
///
/// @param client  the object
/// @param most    1 to 16, which is so at first; on a serial line, and in RTU over
///                TCP, 1
/// @return MBM_OK, MBM_INVALID_ARGUMENT or MBM_NOT_INITIALISED
#[no_mangle]
pub unsafe extern "C" fn mbm_client_setInFlight(client: *mut mbm_client, most: u8) -> u8 {
    // SAFETY: as the header demands.
    unsafe {
        pointers::with(client, |object| match ((*object).framing, most) {
            (MBM_FRAMING_TCP, 1..=super::MBM_CLIENT_DEPTH) => {
                let tcp: &mut TcpIp = super::client(object);
                tcp.line.limit(most);
                Status::OK
            }
            (MBM_FRAMING_RTU | MBM_FRAMING_ASCII, 1) => Status::OK,
            _ => Status::INVALID_ARGUMENT,
        })
    }
}

const _: () = assert!(size_of::<Rtu>() <= size_of::<super::Either>());
