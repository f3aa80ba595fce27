//! The object that C calls a client, and the line in it.

use super::request::RequestPtr;
use super::storage::ClientBuffers;
use super::MBM_CLIENT_DEPTH;
use crate::pointers::CObject;
use crate::port::mbm_port;
use core::ffi::c_void;
use core::mem::ManuallyDrop;
use mbm::client::{RequestQueue, Serial, Tcp};
use mbm::engine::Settings;
#[cfg(not(any(target_os = "none", mbm_firmware)))]
use mbm::error::Status;

const DEPTH: usize = MBM_CLIENT_DEPTH as usize;

/// A client of one serial line or one TCP stream: up to 16 requests are queued,
/// mbm_client_poll moves them on, and nothing ever waits.
///
/// Storage is yours and must be zero before first use, which a static object is.
/// One of the mbm_client_begin functions comes first. Use one object from one
/// thread and never from an interrupt; several objects are independent of each
/// other.
///
/// A `done` function may call every function on the client that calls it, but
/// mbm_client_poll, which returns MBM_BUSY. A hook of the port, and the `random`
/// function of mbm_client_setJitter, may call none: each returns MBM_BUSY and
/// changes nothing, and a getter returns what it returns for an object that was
/// never begun.
#[repr(C)]
pub struct mbm_client {
    /// Private.
    pointers: [*mut c_void; 46],
    /// Private.
    words: [u32; 24],
}

/// What lies behind an `mbm_client`.
#[repr(C)]
pub struct Object {
    mark: u8,
    pub(super) polling: bool,
    pub(super) kind: *const TransportKind,
    pub(super) queue: RequestQueue<RequestPtr, DEPTH>,
    pub(super) line: Transports,
}

const _: () = {
    let space = size_of::<mbm_client>();
    let used = size_of::<Object>();
    assert!(align_of::<mbm_client>() >= align_of::<Object>());
    assert!(used <= space);
    // Hiding the fields may waste 5 % where RAM is scarce.
    assert!(size_of::<usize>() > 4 || (space - used) * 20 <= space);
};

// SAFETY: the mark is a field of its own.
unsafe impl CObject for mbm_client {
    // Hooks run while the client is in use, and may hand it to functions of this
    // library, which then look at the mark: no reference covers that.
    type Access<'a> = *mut Object;

    unsafe fn mark(client: *const mbm_client) -> *mut u8 {
        // SAFETY: as the caller promises; every object is writable storage.
        unsafe { &raw mut (*client.cast::<Object>().cast_mut()).mark }
    }

    unsafe fn access<'a>(client: *mut mbm_client) -> Self::Access<'a> {
        client.cast()
    }
}

/// What clients of every line have in common. The mark stands outside of it.
///
/// # Safety
/// `object` is begun, and nothing else uses its client while the reference lives.
pub(super) unsafe fn queue<'a>(object: *mut Object) -> &'a mut RequestQueue<RequestPtr, DEPTH> {
    // SAFETY: as the caller promises.
    unsafe { &mut (*object).queue }
}

pub(super) type SerialTransport = Serial<mbm_port, ClientBuffers, RequestPtr>;
pub(super) type TcpTransport = Tcp<mbm_port, ClientBuffers>;

/// Room for the line of any kind.
#[repr(C)]
pub(super) union Transports {
    serial: ManuallyDrop<SerialTransport>,
    tcp: ManuallyDrop<TcpTransport>,
}

/// As [`Transport::advance`].
pub(super) type Advance = unsafe fn(*mut Object, now: u32, fresh: bool) -> Option<RequestPtr>;

/// What differs from one kind of line to the next.
pub(super) struct TransportKind {
    #[cfg(any(target_os = "none", mbm_firmware))]
    pub(super) advance: Advance,
    /// As [`turns`](super::poll::turns).
    #[cfg(not(any(target_os = "none", mbm_firmware)))]
    pub(super) poll: unsafe fn(*mut mbm_client) -> Status,
    /// As [`Transport::release`].
    pub(super) release: unsafe fn(*mut Object, Option<&RequestPtr>),
    /// Completes a client that was just begun.
    pub(super) start: unsafe fn(*mut Object),
    /// Where in an object its port, its settings and what is lent to it stand.
    pub(super) port: u16,
    pub(super) settings: u16,
    pub(super) storage: u16,
    /// The least that the frame buffer has.
    pub(super) least: u8,
    pub(super) framing: u8,
}

impl TransportKind {
    /// # Safety
    /// As for [`line`], of this kind.
    pub(super) unsafe fn port(&self, object: *mut Object) -> *mut mbm_port {
        // SAFETY: as the caller promises.
        unsafe { object.byte_add(self.port.into()).cast() }
    }

    /// # Safety
    /// As for [`line`], of this kind.
    pub(super) unsafe fn settings<'a>(&self, object: *mut Object) -> &'a mut Settings {
        // SAFETY: as the caller promises; every kind has settings there.
        unsafe { &mut *object.byte_add(self.settings.into()).cast() }
    }

    /// # Safety
    /// As for [`line`], of this kind.
    pub(super) unsafe fn storage<'a>(&self, object: *mut Object) -> &'a mut ClientBuffers {
        // SAFETY: as the caller promises; every kind has it there.
        unsafe { &mut *object.byte_add(self.storage.into()).cast() }
    }
}

/// The line of an object.
///
/// # Safety
/// `object` is a client of the kind `L`, and nothing else uses its line while the
/// reference lives.
pub(super) unsafe fn line<'a, L>(object: *mut Object) -> &'a mut L {
    // SAFETY: as the caller promises.
    unsafe { &mut *(&raw mut (*object).line).cast() }
}

/// Does something with the line of an object, whatever its kind. Only functions that few
/// programs call use it, so most images carry the code of one kind of line.
/// Unsafe as [`line`] is.
macro_rules! on_transport {
    ($object:expr, $line:ident => $action:expr) => {
        match (*(*$object).kind).framing {
            $crate::framing::MBM_FRAMING_TCP => {
                let $line = $crate::client::object::line::<TcpTransport>($object);
                $action
            }
            _ => {
                let $line = $crate::client::object::line::<SerialTransport>($object);
                $action
            }
        }
    };
}
pub(super) use on_transport;
