//! A client of each kind of line.

use super::kind;
use super::object::{line, mbm_client, queue, SerialTransport, TcpTransport, TransportKind};
use crate::framing::{is_delimiter, MBM_FRAMING_ASCII, MBM_FRAMING_RTU, MBM_FRAMING_TCP};
use crate::pointers::{self, CObject};
use crate::port::{countable, mbm_port};
use mbm::error::Status;

/// Makes a client of a kind of line out of storage. One that was begun before gives up its
/// requests.
///
/// # Safety
/// As the header demands of the begin functions.
#[cfg_attr(target_os = "none", inline(never))]
unsafe fn begin(
    pointer: *mut mbm_client,
    port: *const mbm_port,
    frame: *mut u8,
    frame_bytes: u16,
    kind: &'static TransportKind,
) -> u8 {
    // SAFETY: as the header demands: each is NULL or what it says, and the object is
    // storage, zeroed or begun; zero is a value of every field but for the kind, which
    // no one uses before it is set.
    let status = unsafe {
        match port.as_ref() {
            Some(port)
                if !frame.is_null()
                    && frame_bytes >= u16::from(kind.least)
                    && port.is_complete() =>
            {
                let status = give_up(pointer);
                if status != Status::NOT_INITIALISED {
                    return status.code();
                }
                let object = pointers::object(pointer);
                (*object).kind = kind;
                (*object).queue.connected = true;
                kind.settings(object).set_default_if_zero();
                (*kind.port(object)).copy(port);
                let storage = kind.storage(object);
                storage.frame = frame;
                storage.frame_bytes = countable(frame_bytes);
                pointers::with_hooks(pointer, || (kind.start)(object));
                Status::OK
            }
            _ => Status::INVALID_ARGUMENT,
        }
    };
    status.code()
}

/// Makes zeroed storage of a client again, if it is one: its requests are given up. Returns
/// [`Status::NOT_INITIALISED`] then, else the status that says why not.
///
/// # Safety
/// As for [`pointers::check`].
#[inline(always)]
unsafe fn give_up(client: *mut mbm_client) -> Status {
    // SAFETY: as the caller promises. Hooks that `release` calls may not use the object, which
    // the mark says; no reference into it lives then. Zero is a value of every field but for
    // the kind, which is set before it is used.
    unsafe {
        let status = pointers::check(client);
        if status != Status::OK {
            return status;
        }
        let object = pointers::object(client);
        if (*object).queue.suspended {
            return Status::BUSY;
        }
        mbm_client::mark(client).write(pointers::IN_HOOK);
        ((*(*object).kind).release)(object, None);
        queue(object).cancel_all();
        // Not by memset: libc's is larger than this loop, and most images have no other use
        // for it.
        let mut word = client.cast::<usize>();
        let end = client.add(1).cast::<usize>();
        loop {
            word.write_volatile(0);
            word = word.add(1);
            if word == end {
                return Status::NOT_INITIALISED;
            }
        }
    }
}

const _: () = assert!(size_of::<mbm_client>().is_multiple_of(size_of::<usize>()));

/// Makes an object a client of a serial line, in RTU frames (serial line guide
/// V1.02, 2.5.1).
///
/// This and the other mbm_client_begin functions may be called again at any time, also with
/// another framing. All pending requests are given up as by mbm_client_cancel: their status
/// is MBM_CANCELLED and `done` is not called. The settings are as at first. A call that is
/// refused changes nothing.
///
/// @param client      the object; zeroed before the first call
/// @param port        copied; read, write and micros must be there
/// @param frame       bytes of one frame, valid for as long as the client is used
/// @param frameBytes  at least 8; 256 hold any frame
/// @return MBM_OK; MBM_INVALID_ARGUMENT; MBM_BUSY from within a hook of the port, and while
///         the client is suspended
#[no_mangle]
pub unsafe extern "C" fn mbm_client_beginRtu(
    client: *mut mbm_client,
    port: *const mbm_port,
    frame: *mut u8,
    frameBytes: u16,
) -> u8 {
    // SAFETY: as the header demands.
    unsafe { begin(client, port, frame, frameBytes, &kind::RTU) }
}

/// Makes an object a client of a serial line, in ASCII frames (serial line guide
/// V1.02, 2.5.2). No gap is kept between frames; a second without a character
/// ends one that is not whole.
///
/// @param client      the object; zeroed before the first call
/// @param port        copied; read, write and micros must be there
/// @param frame       bytes of one frame, valid for as long as the client is used
/// @param frameBytes  at least 17; 513 hold any frame
/// @return MBM_OK; MBM_INVALID_ARGUMENT; MBM_BUSY from within a hook of the port, and while
///         the client is suspended
#[no_mangle]
pub unsafe extern "C" fn mbm_client_beginAscii(
    client: *mut mbm_client,
    port: *const mbm_port,
    frame: *mut u8,
    frameBytes: u16,
) -> u8 {
    // SAFETY: as the header demands.
    unsafe { begin(client, port, frame, frameBytes, &kind::ASCII) }
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
    // SAFETY: as the header demands.
    unsafe {
        pointers::with(client, |object| {
            if (*(*object).kind).framing != MBM_FRAMING_ASCII || !is_delimiter(character) {
                return Status::INVALID_ARGUMENT;
            }
            if !queue(object).is_idle() {
                return Status::BUSY;
            }
            let engine = &mut line::<SerialTransport>(object).engine;
            engine.request().set_ascii(character);
            Status::OK
        })
    }
}

/// Makes an object a client that sends RTU frames through a TCP stream, for
/// converters that pass on what they get. No gap is kept, nothing is broadcast.
///
/// @param client      the object; zeroed before the first call
/// @param port        copied; read, write and micros must be there
/// @param frame       bytes of one frame, valid for as long as the client is used
/// @param frameBytes  at least 8; 256 hold any frame
/// @return MBM_OK; MBM_INVALID_ARGUMENT; MBM_BUSY from within a hook of the port, and while
///         the client is suspended
#[no_mangle]
pub unsafe extern "C" fn mbm_client_beginRtuOverTcp(
    client: *mut mbm_client,
    port: *const mbm_port,
    frame: *mut u8,
    frameBytes: u16,
) -> u8 {
    // SAFETY: as the header demands.
    unsafe { begin(client, port, frame, frameBytes, &kind::RTU_OVER_TCP) }
}

/// Makes an object a client of a TCP stream, in frames with the MBAP header
/// (messaging on TCP/IP guide V1.0b, 3.1.3). All 16 requests may be under way at
/// once; responses are matched by their transaction id, in any order.
///
/// @param client         the object; zeroed before the first call
/// @param port           copied; read, write and micros must be there
/// @param incoming       received bytes, valid for as long as the client is used
/// @param incomingBytes  at least 9; 260 hold any frame, more take in more
///                       responses at a time
/// @param outgoing       bytes to send, valid for as long as the client is used
/// @param outgoingBytes  at least 12; 260 hold any frame, more gather more
///                       requests for one write
/// @return MBM_OK; MBM_INVALID_ARGUMENT; MBM_BUSY from within a hook of the port, and while
///         the client is suspended
#[no_mangle]
pub unsafe extern "C" fn mbm_client_beginTcp(
    client: *mut mbm_client,
    port: *const mbm_port,
    incoming: *mut u8,
    incomingBytes: u16,
    outgoing: *mut u8,
    outgoingBytes: u16,
) -> u8 {
    if outgoing.is_null() || outgoingBytes < 12 {
        return Status::INVALID_ARGUMENT.code();
    }
    // SAFETY: as the header demands.
    unsafe {
        let status = begin(client, port, incoming, incomingBytes, &kind::TCP);
        if status == Status::OK.code() {
            let storage = &mut line::<TcpTransport>(pointers::object(client)).storage;
            storage.outgoing = outgoing;
            storage.outgoing_bytes = countable(outgoingBytes);
        }
        status
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
        pointers::with(client, |object| match ((*(*object).kind).framing, most) {
            (MBM_FRAMING_TCP, 1..=super::MBM_CLIENT_DEPTH) => {
                line::<TcpTransport>(object).limit(most);
                Status::OK
            }
            (MBM_FRAMING_RTU | MBM_FRAMING_ASCII, 1) => Status::OK,
            _ => Status::INVALID_ARGUMENT,
        })
    }
}
