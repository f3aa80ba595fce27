//! The kinds of transport of the client, as tables. Only the mbm_client_begin functions use
//! the tables, so firmware contains the code of the kinds that it begins, and of no others.

use super::object::{transport, Object, SerialTransport, TcpTransport};
use super::object::{TolerantTransport, TransportKind};
use super::request::RequestPtr;
use crate::framing::{MBM_FRAMING_ASCII, MBM_FRAMING_RTU, MBM_FRAMING_TCP};
use core::mem::offset_of;
use mbm::client::Transport;

const TRANSPORT: usize = offset_of!(Object, transport);

const fn serial(
    start: unsafe fn(*mut Object),
    release: unsafe fn(*mut Object, Option<&RequestPtr>),
    framing: u8,
    min_frame_bytes: u8,
) -> TransportKind {
    TransportKind {
        advance: advance::<SerialTransport>,
        release,
        start,
        port: (TRANSPORT + offset_of!(SerialTransport, port)) as u16,
        settings: (TRANSPORT + offset_of!(SerialTransport, settings)) as u16,
        storage: (TRANSPORT + offset_of!(SerialTransport, storage)) as u16,
        late_units: (TRANSPORT + offset_of!(SerialTransport, late_units)) as u16,
        min_frame_bytes,
        framing,
    }
}

pub(super) static RTU: TransportKind =
    serial(start_rtu, release::<SerialTransport>, MBM_FRAMING_RTU, 8);
pub(super) static RTU_OVER_TCP: TransportKind =
    serial(start_stream, release_stream, MBM_FRAMING_RTU, 8);
/// The shortest request and response, a function code and two words, are 17 characters.
pub(super) static ASCII: TransportKind = serial(
    start_ascii,
    release::<SerialTransport>,
    MBM_FRAMING_ASCII,
    17,
);
pub(super) static TCP: TransportKind = TransportKind {
    advance: advance::<TcpTransport>,
    release: release::<TcpTransport>,
    start: start_tcp,
    port: (TRANSPORT + offset_of!(TcpTransport, port)) as u16,
    settings: (TRANSPORT + offset_of!(TcpTransport, settings)) as u16,
    storage: (TRANSPORT + offset_of!(TcpTransport, storage)) as u16,
    late_units: 0,
    min_frame_bytes: 9,
    framing: MBM_FRAMING_TCP,
};
/// A stream that is [`TCP`] until a setting makes it tolerant.
pub(super) static TOLERANT: TransportKind = TransportKind {
    advance: advance::<TolerantTransport>,
    release: release::<TolerantTransport>,
    ..TCP
};
const _: () = assert!(offset_of!(TolerantTransport, tcp) == 0);

// All functions demand that the transport of `object` has the type that they name.

unsafe fn advance<T: Transport<RequestPtr>>(
    object: *mut Object,
    now: u32,
    fresh: bool,
) -> Option<RequestPtr> {
    // The transport is apart from the queue.
    transport::<T>(object).advance(&mut (*object).queue, now, fresh)
}

unsafe fn release<T: Transport<RequestPtr>>(object: *mut Object, request: Option<&RequestPtr>) {
    transport::<T>(object).release(request)
}

unsafe fn release_stream(object: *mut Object, request: Option<&RequestPtr>) {
    release::<SerialTransport>(object, request);
    if request.is_none() {
        let line = transport::<SerialTransport>(object);
        Transport::<RequestPtr>::forget_late_replies(line);
    }
}

unsafe fn start_rtu(object: *mut Object) {
    (*object).queue.has_broadcast = true;
    transport::<SerialTransport>(object).line_used();
}

unsafe fn start_stream(object: *mut Object) {
    let transport = transport::<SerialTransport>(object);
    transport.set_stream();
    transport.line_used();
}

unsafe fn start_ascii(object: *mut Object) {
    start_rtu(object);
    transport::<SerialTransport>(object).set_ascii();
}

unsafe fn start_tcp(object: *mut Object) {
    (*object).queue.has_transaction_ids = true;
}
