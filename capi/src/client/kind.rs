//! The kinds of transport of the client, as tables. Only the mbm_client_begin functions use
//! the tables, so firmware contains the code of the kinds that it begins, and of no others.

#[cfg(not(any(target_os = "none", mbm_firmware)))]
use super::object::mbm_client;
use super::object::{line, Object, SerialTransport, TcpTransport, TransportKind};
use super::request::RequestPtr;
use super::storage::ClientBuffers;
use crate::framing::{MBM_FRAMING_ASCII, MBM_FRAMING_RTU, MBM_FRAMING_TCP};
use crate::port::mbm_port;
use core::mem::offset_of;
use mbm::client::{ClientEngine, Transport};
#[cfg(not(any(target_os = "none", mbm_firmware)))]
use mbm::error::Status;

const LINE: usize = offset_of!(Object, line);

const fn serial(start: unsafe fn(*mut Object), framing: u8, least: u8) -> TransportKind {
    type Engine = ClientEngine<mbm_port, ClientBuffers, RequestPtr>;
    let engine = LINE + offset_of!(SerialTransport, engine);
    TransportKind {
        #[cfg(any(target_os = "none", mbm_firmware))]
        advance: advance::<SerialTransport>,
        #[cfg(not(any(target_os = "none", mbm_firmware)))]
        poll: poll::<SerialTransport>,
        release: release::<SerialTransport>,
        start,
        port: (engine + offset_of!(Engine, port)) as u16,
        settings: (engine + offset_of!(Engine, settings)) as u16,
        storage: (engine + offset_of!(Engine, storage)) as u16,
        least,
        framing,
    }
}

pub(super) static RTU: TransportKind = serial(start_rtu, MBM_FRAMING_RTU, 8);
pub(super) static RTU_OVER_TCP: TransportKind = serial(start_stream, MBM_FRAMING_RTU, 8);
/// The shortest request and response, a function code and two words, are 17 characters.
pub(super) static ASCII: TransportKind = serial(start_ascii, MBM_FRAMING_ASCII, 17);
pub(super) static TCP: TransportKind = TransportKind {
    #[cfg(any(target_os = "none", mbm_firmware))]
    advance: advance::<TcpTransport>,
    #[cfg(not(any(target_os = "none", mbm_firmware)))]
    poll: poll::<TcpTransport>,
    release: release::<TcpTransport>,
    start: start_tcp,
    port: (LINE + offset_of!(TcpTransport, port)) as u16,
    settings: (LINE + offset_of!(TcpTransport, settings)) as u16,
    storage: (LINE + offset_of!(TcpTransport, storage)) as u16,
    least: 9,
    framing: MBM_FRAMING_TCP,
};

/// # Safety
/// As for [`turns`](super::poll::turns), with a client of the kind `L`.
#[cfg(not(any(target_os = "none", mbm_firmware)))]
unsafe fn poll<L: Transport<RequestPtr>>(client: *mut mbm_client) -> Status {
    // SAFETY: as the caller promises.
    unsafe { super::poll::turns(client, advance::<L>) }
}

/// # Safety
/// As for [`line`].
unsafe fn advance<L: Transport<RequestPtr>>(
    object: *mut Object,
    now: u32,
    fresh: bool,
) -> Option<RequestPtr> {
    // SAFETY: as the caller promises; line and the rest are apart.
    unsafe { line::<L>(object).advance(&mut (*object).queue, now, fresh) }
}

/// # Safety
/// As for [`line`].
unsafe fn release<L: Transport<RequestPtr>>(object: *mut Object, request: Option<&RequestPtr>) {
    // SAFETY: as the caller promises.
    unsafe { line::<L>(object).release(request) }
}

/// # Safety
/// As for [`line`].
unsafe fn start_rtu(object: *mut Object) {
    // SAFETY: as the caller promises.
    unsafe {
        (*object).queue.has_broadcast = true;
        line::<SerialTransport>(object).engine.line_used();
    }
}

/// # Safety
/// As for [`line`].
unsafe fn start_stream(object: *mut Object) {
    // SAFETY: as the caller promises.
    unsafe {
        let line = line::<SerialTransport>(object);
        line.set_stream();
        line.engine.line_used();
    }
}

/// # Safety
/// As for [`line`].
unsafe fn start_ascii(object: *mut Object) {
    // SAFETY: as the caller promises.
    unsafe {
        start_rtu(object);
        line::<SerialTransport>(object).set_ascii();
    }
}

/// # Safety
/// As for [`line`].
unsafe fn start_tcp(object: *mut Object) {
    // SAFETY: as the caller promises.
    unsafe {
        (*object).queue.has_transaction_ids = true;
        line::<TcpTransport>(object).limit(super::MBM_CLIENT_DEPTH);
    }
}
