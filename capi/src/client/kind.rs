//! The kinds of line that C has, as tables. Firmware carries the code of those whose
//! mbm_client_begin function it calls, for nothing else names their tables.

#[cfg(not(any(target_os = "none", mbm_firmware)))]
use super::object::mbm_client;
use super::object::{line, Kind, Object, SerialLine, TcpLine};
use super::request::Lent;
use super::storage::LentByC;
use crate::framing::{MBM_FRAMING_ASCII, MBM_FRAMING_RTU, MBM_FRAMING_TCP};
use crate::port::mbm_port;
use core::mem::offset_of;
use mbm::client::{ClientEngine, Line};
#[cfg(not(any(target_os = "none", mbm_firmware)))]
use mbm::error::Status;

const LINE: usize = offset_of!(Object, line);

const fn serial(start: unsafe fn(*mut Object), framing: u8, least: u8) -> Kind {
    type Engine = ClientEngine<mbm_port, LentByC, Lent>;
    let engine = LINE + offset_of!(SerialLine, engine);
    Kind {
        #[cfg(any(target_os = "none", mbm_firmware))]
        advance: advance::<SerialLine>,
        #[cfg(not(any(target_os = "none", mbm_firmware)))]
        poll: poll::<SerialLine>,
        release: release::<SerialLine>,
        start,
        port: (engine + offset_of!(Engine, port)) as u16,
        settings: (engine + offset_of!(Engine, settings)) as u16,
        means: (engine + offset_of!(Engine, storage)) as u16,
        least,
        framing,
    }
}

pub(super) static RTU: Kind = serial(start_rtu, MBM_FRAMING_RTU, 8);
pub(super) static RTU_OVER_TCP: Kind = serial(start_stream, MBM_FRAMING_RTU, 8);
/// The shortest request and response, a function code and two words, are 17 characters.
pub(super) static ASCII: Kind = serial(start_ascii, MBM_FRAMING_ASCII, 17);
pub(super) static TCP: Kind = Kind {
    #[cfg(any(target_os = "none", mbm_firmware))]
    advance: advance::<TcpLine>,
    #[cfg(not(any(target_os = "none", mbm_firmware)))]
    poll: poll::<TcpLine>,
    release: release::<TcpLine>,
    start: start_tcp,
    port: (LINE + offset_of!(TcpLine, port)) as u16,
    settings: (LINE + offset_of!(TcpLine, settings)) as u16,
    means: (LINE + offset_of!(TcpLine, means)) as u16,
    least: 9,
    framing: MBM_FRAMING_TCP,
};

/// # Safety
/// As for [`turns`](super::poll::turns), with a client of the kind `L`.
#[cfg(not(any(target_os = "none", mbm_firmware)))]
unsafe fn poll<L: Line<Lent>>(client: *mut mbm_client) -> Status {
    // SAFETY: as the caller promises.
    unsafe { super::poll::turns(client, advance::<L>) }
}

/// # Safety
/// As for [`line`].
unsafe fn advance<L: Line<Lent>>(object: *mut Object, now: u32, fresh: bool) -> Option<Lent> {
    // SAFETY: as the caller promises; line and the rest are apart.
    unsafe { line::<L>(object).advance(&mut (*object).shared, now, fresh) }
}

/// # Safety
/// As for [`line`].
unsafe fn release<L: Line<Lent>>(object: *mut Object, job: Option<&Lent>) {
    // SAFETY: as the caller promises.
    unsafe { line::<L>(object).release(job) }
}

/// # Safety
/// As for [`line`].
unsafe fn start_rtu(object: *mut Object) {
    // SAFETY: as the caller promises.
    unsafe {
        (*object).shared.broadcasts = true;
        line::<SerialLine>(object).engine.line_used();
    }
}

/// # Safety
/// As for [`line`].
unsafe fn start_stream(object: *mut Object) {
    // SAFETY: as the caller promises.
    unsafe {
        let line = line::<SerialLine>(object);
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
        line::<SerialLine>(object).set_ascii();
    }
}

/// # Safety
/// As for [`line`].
unsafe fn start_tcp(object: *mut Object) {
    // SAFETY: as the caller promises.
    unsafe {
        (*object).shared.has_ids = true;
        line::<TcpLine>(object).limit(super::MBM_CLIENT_DEPTH);
    }
}
