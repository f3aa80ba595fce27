//! The begin functions of the client, one for each framing, and the settings of one framing.

use super::kind;
use super::object::{
    mbm_client, queue, transport, LinkedKind, SerialTransport, TcpTransport, TransportKind,
};
use super::tolerance::allowed;
use crate::framing::{is_delimiter, MBM_FRAMING_ASCII, MBM_FRAMING_RTU, MBM_FRAMING_TCP};
use crate::pointers::{self, CObject};
use crate::port::{countable, mbm_port};
use core::ptr::null_mut;
use mbm::error::Status;

/// Begins a client of one kind of transport. A client that was begun before first gives up
/// its requests.
unsafe fn begin(
    pointer: *mut mbm_client,
    port: *const mbm_port,
    frame: *mut u8,
    frame_bytes: u16,
    kind: &'static TransportKind,
) -> u8 {
    // Zero is a valid value of every field except `kind`, which is set before it is used.
    let status = match port.as_ref() {
        Some(port)
            if !frame.is_null()
                && frame_bytes >= u16::from(kind.min_frame_bytes)
                && port.is_complete() =>
        {
            let status = give_up(pointer);
            if status != Status::NOT_INITIALISED {
                return status.code();
            }
            let object = pointers::object(pointer);
            (*object).kind = kind;
            (*object).queue.connected = true;
            (*kind.port(object)).copy(port);
            let storage = kind.storage(object);
            storage.frame = frame;
            storage.frame_bytes = countable(frame_bytes);
            pointers::with_hooks(pointer, || (kind.start)(object));
            Status::OK
        }
        _ => Status::INVALID_ARGUMENT,
    };
    status.code()
}

/// If the storage is a client, gives up its requests and zeroes the storage. Returns
/// [`Status::NOT_INITIALISED`] if the storage is zeroed now, otherwise the status that says
/// why the client cannot be begun.
unsafe fn give_up(client: *mut mbm_client) -> Status {
    // While `release` calls hooks, the mark refuses their calls on the object, and no reference
    // into it lives. Zero is a valid value of every field except `kind`, which is set before it
    // is used.
    let status = pointers::check(client);
    if status == Status::OK {
        let object = pointers::object(client);
        if (*object).queue.suspended {
            return Status::BUSY;
        }
        mbm_client::mark(client).write(pointers::IN_HOOK);
        ((*(*object).kind).release)(object, None);
        queue(object).cancel_all();
        if (*object).linked {
            (*(*object).kind.cast::<LinkedKind>().cast_mut()).client = null_mut();
        }
    } else if status != Status::NOT_INITIALISED {
        return status;
    }
    pointers::zero(client);
    Status::NOT_INITIALISED
}

functions! {
    (client: *mut mbm_client)

    /// Begins a client of a serial line with RTU frames (serial line guide V1.02, 2.5.1).
    ///
    /// This and the other mbm_client_begin functions may be called again at any time, also with
    /// another framing. Then the client gives up all pending requests as mbm_client_cancel does:
    /// their status is MBM_CANCELLED and `done` is not called. All settings return to their
    /// defaults. A call that is refused changes nothing.
    ///
    /// @param port        the port, which is copied; read, write and micros must not be NULL
    /// @param frame       the buffer of one frame, valid for as long as the client is used
    /// @param frameBytes  bytes of `frame`, at least 8; 256 hold any frame
    /// @return a status; MBM_BUSY also while the client is suspended
    fn mbm_client_beginRtu(port: *const mbm_port, frame: *mut u8, frameBytes: u16)
        = begin(port, frame, frameBytes, &kind::RTU);

    /// Begins a client of a serial line with ASCII frames (serial line guide V1.02, 2.5.2). It
    /// keeps no gap between frames. If no character arrives for one second, the client discards
    /// an incomplete frame.
    ///
    /// @param frameBytes  bytes of `frame`, at least 17; 513 hold any frame
    /// @return as mbm_client_beginRtu
    fn mbm_client_beginAscii(port: *const mbm_port, frame: *mut u8, frameBytes: u16)
        = begin(port, frame, frameBytes, &kind::ASCII);
}

/// Sets the character that ends ASCII frames after CR, instead of LF, in both
/// directions. Use it for devices that were set to another character by function 08 with
/// sub-function 03 (V1.1b3, 6.8.1). A device still ends its response to that request with
/// the old character: call this function when the request has ended, for example in its
/// `done`.
///
/// @param client     the object, begun with mbm_client_beginAscii
/// @param character  1 to 127, except CR, the colon and hexadecimal digits
/// @return a status; MBM_BUSY while a request is in flight
#[no_mangle]
pub unsafe extern "C" fn mbm_client_setDelimiter(client: *mut mbm_client, character: u8) -> u8 {
    pointers::with(client, |object| {
        if (*(*object).kind).framing != MBM_FRAMING_ASCII || !is_delimiter(character) {
            return Status::INVALID_ARGUMENT;
        }
        if !queue(object).is_idle() {
            return Status::BUSY;
        }
        transport::<SerialTransport>(object)
            .request()
            .set_ascii(character);
        Status::OK
    })
}

functions! {
    (client: *mut mbm_client)

    /// Begins a client that sends RTU frames through a TCP stream, for converters that pass
    /// bytes from TCP to a serial line unchanged. It keeps no gap and does not broadcast.
    ///
    /// @return as mbm_client_beginRtu
    fn mbm_client_beginRtuOverTcp(port: *const mbm_port, frame: *mut u8, frameBytes: u16)
        = begin(port, frame, frameBytes, &kind::RTU_OVER_TCP);
}

/// Begins a client of a TCP stream with frames that have the MBAP header (messaging on
/// TCP/IP guide V1.0b, 3.1.3). One request is in flight at a time, unless mbm_client_setInFlight
/// allows more. The client matches responses to requests by the transaction identifier, in any
/// order.
///
/// @param incoming       the buffer of received bytes, valid for as long as the client is used
/// @param incomingBytes  bytes of `incoming`, at least 9; 260 hold any frame. A larger buffer takes
///                       more responses from one read
/// @param outgoing       the buffer of bytes to send, valid for as long as the client is used
/// @param outgoingBytes  bytes of `outgoing`, at least 12; 260 hold any frame. A larger buffer
///                       collects more requests for one write
/// @return as mbm_client_beginRtu
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
    let status = begin(client, port, incoming, incomingBytes, &kind::TCP);
    if status == Status::OK.code() {
        let storage = &mut transport::<TcpTransport>(pointers::object(client)).storage;
        storage.outgoing = outgoing;
        storage.outgoing_bytes = countable(outgoingBytes);
    }
    status
}

/// Sets how many requests may be in flight at once on TCP. More are faster, if the server accepts
/// them (NumberMaxOfServerTransaction of the messaging on TCP/IP guide V1.0b, 1 to 16). Many take
/// one at a time: they drop a request that arrives before they have answered the last one, or
/// in one segment with another. The queue always holds 16.
///
/// @param most  1 (the default) to 16. On a serial line and in RTU over TCP only 1 is accepted, as
///              with mbm_client_setMessageWait and MBM_ACCEPT_TRANSACTION
#[no_mangle]
pub unsafe extern "C" fn mbm_client_setInFlight(client: *mut mbm_client, most: u8) -> u8 {
    pointers::with(client, |object| match ((*(*object).kind).framing, most) {
        (MBM_FRAMING_TCP, 1..=super::MBM_CLIENT_DEPTH) => {
            allowed(transport::<TcpTransport>(object).set_in_flight(most))
        }
        (MBM_FRAMING_RTU | MBM_FRAMING_ASCII, 1) => Status::OK,
        _ => Status::INVALID_ARGUMENT,
    })
}
