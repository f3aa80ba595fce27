//! The client object and the transport in it.

use super::request::RequestPtr;
use super::storage::ClientBuffers;
use super::MBM_CLIENT_DEPTH;
use crate::line::mbm_line;
use crate::pointers::c_object;
use crate::port::mbm_port;
use core::ffi::c_void;
use core::mem::ManuallyDrop;
use mbm::client::{RequestQueue, Serial, Tcp, TolerantTcp};
use mbm::engine::Settings;

pub(super) const DEPTH: usize = MBM_CLIENT_DEPTH as usize;

/// A client of one serial line or one TCP stream. It queues up to 16 requests.
/// mbm_client_poll sends and receives; no function ever waits.
///
/// You own the storage. Initialise it with MBM_INIT. Call one of the mbm_client_begin
/// functions first. Use an object from one thread only, and never from an interrupt. Several
/// objects are independent of each other.
///
/// The `done` function of a request may call every function on the client that calls it,
/// except mbm_client_poll, which then returns MBM_BUSY. A hook of the port, and the `random`
/// function of mbm_client_setJitter, must not use the client: each function returns MBM_BUSY
/// and changes nothing, and a getter returns its value for an object that was never begun.
#[repr(C)]
pub struct mbm_client {
    /// Private.
    pointers: [*mut c_void; 63],
    /// Private.
    words: [u32; 22],
}

/// The fields in the storage of an `mbm_client`.
#[repr(C)]
pub struct Object {
    mark: u8,
    pub(super) polling: bool,
    /// `kind` is the first field of a [`LinkedKind`].
    pub(crate) linked: bool,
    pub(crate) kind: *const TransportKind,
    /// The line that uses the port while the client is suspended; NULL if none does.
    pub(super) borrower: *mut mbm_line,
    pub(crate) queue: RequestQueue<RequestPtr, DEPTH>,
    pub(super) transport: Transports,
}

c_object! { mbm_client, *mut Object }

/// The queue of a client, which every kind of transport uses. It does not include the mark.
///
/// # Safety
/// `object` is begun, and nothing else uses its client while the reference lives.
pub(crate) unsafe fn queue<'a>(object: *mut Object) -> &'a mut RequestQueue<RequestPtr, DEPTH> {
    &mut (*object).queue
}

pub(super) type SerialTransport = Serial<mbm_port, ClientBuffers, RequestPtr>;
pub(super) type TcpTransport = Tcp<mbm_port, ClientBuffers>;
/// It begins as a [`TcpTransport`].
pub(super) type TolerantTransport = TolerantTcp<mbm_port, ClientBuffers>;

/// Storage of a transport of any kind.
#[repr(C)]
pub(super) union Transports {
    serial: ManuallyDrop<SerialTransport>,
    tcp: ManuallyDrop<TcpTransport>,
    tolerant: ManuallyDrop<TolerantTransport>,
}

/// As [`Transport::advance`].
pub(crate) type Advance = unsafe fn(*mut Object, now: u32, fresh: bool) -> Option<RequestPtr>;

/// The functions and numbers in which the kinds of transport differ.
#[repr(C)]
pub(crate) struct TransportKind {
    pub(crate) advance: Advance,
    /// As [`Transport::release`].
    pub(crate) release: unsafe fn(*mut Object, Option<&RequestPtr>),
    /// Completes the begin function of a client.
    pub(crate) start: unsafe fn(*mut Object),
    /// The offsets, in bytes, of port, settings and buffers in an object.
    pub(crate) port: u16,
    pub(crate) settings: u16,
    pub(crate) storage: u16,
    /// The offset of the units that owe replies; 0 if the transport has none.
    pub(crate) late_units: u16,
    /// The minimum size of the frame buffer, in bytes.
    pub(crate) min_frame_bytes: u8,
    pub(crate) framing: u8,
}

/// The kind of a client that has a link: the functions of the link, and the numbers of the
/// client's transport.
#[repr(C)]
pub(crate) struct LinkedKind {
    pub(crate) kind: TransportKind,
    /// Microseconds until the next poll is due; `delay` is that of the transport.
    pub(crate) delay: unsafe fn(*mut Object, now: u32, delay: u32) -> u32,
    /// The client; NULL once it was begun again, because the link may then outlive it.
    pub(crate) client: *mut mbm_client,
    /// The client's transport, as if it had no link.
    pub(crate) transport: *const TransportKind,
}

// The functions demand that `object` is of this kind.
impl TransportKind {
    pub(crate) unsafe fn port(&self, object: *mut Object) -> *mut mbm_port {
        object.byte_add(self.port.into()).cast()
    }

    pub(crate) unsafe fn settings<'a>(&self, object: *mut Object) -> &'a mut Settings {
        // The offset is that of the settings.
        &mut *object.byte_add(self.settings.into()).cast()
    }

    pub(crate) unsafe fn storage<'a>(&self, object: *mut Object) -> &'a mut ClientBuffers {
        // The offset is that of the storage.
        &mut *object.byte_add(self.storage.into()).cast()
    }
}

/// The transport of an object.
///
/// # Safety
/// `object` is a client with a transport of the type `T`, and nothing else uses the
/// transport while the reference lives.
pub(super) unsafe fn transport<'a, T>(object: *mut Object) -> &'a mut T {
    &mut *(&raw mut (*object).transport).cast()
}

/// Evaluates an expression with the transport of an object, of either type. Only functions
/// that few programs call use it, so most images contain the code of one transport.
/// Unsafe as [`transport`] is.
macro_rules! on_transport {
    ($object:expr, $transport:ident => $action:expr) => {
        match (*(*$object).kind).framing {
            $crate::framing::MBM_FRAMING_TCP => {
                let $transport = $crate::client::object::transport::<TcpTransport>($object);
                $action
            }
            _ => {
                let $transport = $crate::client::object::transport::<SerialTransport>($object);
                $action
            }
        }
    };
}
pub(super) use on_transport;
