//! The port: the functions that the C program supplies for a line.

use super::node::object::mbm_node;
use core::ffi::c_void;
use core::ptr::null;
use mbm::error::Error;
use mbm::port::{result, Port};

/// The functions that your firmware supplies: a byte stream, a clock, and optional hooks.
///
/// A line keeps a pointer to its port. The port must stay valid and unchanged for as long
/// as the line is used; it may be a constant. A client and a server copy their port.
/// `read`, `write` and `micros` must not be NULL. The other hooks may be NULL: then they are
/// not called.
///
/// A hook must not use the object that calls it. If it calls a function on that object, the
/// function returns MBM_BUSY and changes nothing; a getter returns its value for an object that
/// was never begun. For a line this rule covers the line itself and the node whose request is
/// pending; the words and the settings of that node may be used. The hook `idle` is the
/// exception: it may call every function, but one that starts a request returns MBM_BUSY.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct mbm_port {
    /// Your pointer, passed to every hook; may be NULL.
    pub context: *mut c_void,
    /// Copies up to `capacity` received bytes to `bytes`, without waiting. Returns the
    /// number of bytes, 0 if none has arrived, a negative number if the link is lost.
    pub read:
        Option<unsafe extern "C" fn(context: *mut c_void, bytes: *mut u8, capacity: u16) -> i16>,
    /// Accepts up to `length` bytes to send, without waiting until they are sent. Returns
    /// the number of bytes accepted, 0 if it can accept none now, a negative number if the
    /// link is lost.
    pub write:
        Option<unsafe extern "C" fn(context: *mut c_void, bytes: *const u8, length: u16) -> i16>,
    /// Returns the time in microseconds; it wraps at 2^32. A platform with a
    /// millisecond tick returns `tick * 1000`.
    pub micros: Option<unsafe extern "C" fn(context: *mut c_void) -> u32>,
    /// Optional: returns 1 if the last bit was sent, 0 if bits remain to be sent. It may
    /// also wait until the last bit was sent, and return 1. Without it, a line and a client
    /// that know the baud rate wait for a reply longer by the time of the request's characters,
    /// since bytes may remain to be sent after `write` has taken them.
    pub flush: Option<unsafe extern "C" fn(context: *mut c_void) -> u8>,
    /// Optional: called before the first byte of a frame is sent (RS-485 driver on).
    pub preTransmission: Option<unsafe extern "C" fn(context: *mut c_void)>,
    /// Optional: called after the last bit of a frame was sent (RS-485 driver off).
    pub postTransmission: Option<unsafe extern "C" fn(context: *mut c_void)>,
    /// Optional: called repeatedly while a blocking function of `node` waits, but never
    /// between preTransmission and postTransmission. It may sleep until a byte arrives, at
    /// most for the time that mbm_node_pollDelay(node) returns.
    pub idle: Option<unsafe extern "C" fn(context: *mut c_void, node: *mut mbm_node)>,
}

impl mbm_port {
    #[inline(always)]
    pub(super) fn is_complete(&self) -> bool {
        self.read.is_some() && self.write.is_some() && self.micros.is_some()
    }

    /// Copies another port into this one. (The assignment of the whole struct calls memcpy:
    /// that is small on an AVR and in the ROM of an ESP, but 170 bytes of libc on a
    /// Cortex-M0.)
    pub(super) fn copy(&mut self, from: &mbm_port) {
        if cfg!(any(target_arch = "avr", target_arch = "xtensa")) {
            *self = *from;
            return;
        }
        self.context = from.context;
        self.read = from.read;
        self.write = from.write;
        self.micros = from.micros;
        self.flush = from.flush;
        self.preTransmission = from.preTransmission;
        self.postTransmission = from.postTransmission;
        self.idle = from.idle;
    }
}

/// Reads the clock of a port. No reference to the port or to the object that holds it lives
/// while the hook runs.
///
/// # Safety
/// `port` points to a complete port.
pub(super) unsafe fn now(port: *const mbm_port) -> u32 {
    let (micros, context) = ((*port).micros, (*port).context);
    micros.unwrap_unchecked()(context)
}

/// The number of bytes of a buffer that are used: at most as many as the hooks of a port can
/// count in their `i16`.
pub(super) const fn countable(bytes: u16) -> u16 {
    if bytes > i16::MAX as u16 {
        i16::MAX as u16
    } else {
        bytes
    }
}

/// Hooks of a port that pass each call on to another port. `$inner` is the unsafe function that
/// finds that port by the context. No reference lives while its hook runs, which may use every
/// object.
macro_rules! passing_hooks {
    ($inner:ident) => {
        unsafe extern "C" fn micros(context: *mut c_void) -> u32 {
            let port: *const mbm_port = $inner(context);
            (*port).micros.map_or(0, |micros| micros((*port).context))
        }

        unsafe extern "C" fn flush(context: *mut c_void) -> u8 {
            let port: *const mbm_port = $inner(context);
            (*port).flush.map_or(1, |flush| flush((*port).context))
        }

        unsafe extern "C" fn pre_transmission(context: *mut c_void) {
            let port: *const mbm_port = $inner(context);
            if let Some(hook) = (*port).preTransmission {
                hook((*port).context);
            }
        }

        unsafe extern "C" fn idle(context: *mut c_void, node: *mut mbm_node) {
            let port: *const mbm_port = $inner(context);
            if let Some(hook) = (*port).idle {
                hook((*port).context, node);
            }
        }
    };
}
pub(crate) use passing_hooks;

/// The functions of [`Port`] that call the hooks of the port at `$port`.
///
/// The hooks are C functions that keep the contract of their comments. Slices are valid for their
/// length, and an i16 can count that. `read`, `write` and `micros` are called on complete ports
/// only, which have them.
macro_rules! calls_hooks {
    ($self:ident, $port:expr) => {
        fn read(&mut $self, bytes: &mut [u8]) -> Result<usize, Error> {
            result($self.read_count(bytes))
        }

        fn read_count(&mut $self, bytes: &mut [u8]) -> i16 {
            let port: *const mbm_port = $port;
            // SAFETY: see above.
            let count = unsafe {
                let read = (*port).read.unwrap_unchecked();
                read((*port).context, bytes.as_mut_ptr(), bytes.len() as u16)
            };
            count.min(bytes.len() as i16)
        }

        fn write(&mut $self, bytes: &[u8]) -> Result<usize, Error> {
            result($self.write_count(bytes))
        }

        fn write_count(&mut $self, bytes: &[u8]) -> i16 {
            let port: *const mbm_port = $port;
            // SAFETY: see above.
            let count = unsafe {
                let write = (*port).write.unwrap_unchecked();
                write((*port).context, bytes.as_ptr(), bytes.len() as u16)
            };
            count.min(bytes.len() as i16)
        }

        fn micros(&mut $self) -> u32 {
            // SAFETY: see above.
            unsafe { now($port) }
        }

        fn flush(&mut $self) -> bool {
            let port: *const mbm_port = $port;
            // SAFETY: see above.
            unsafe { (*port).flush.is_none_or(|flush| flush((*port).context) != 0) }
        }

        fn knows_when_sent(&$self) -> bool {
            let port: *const mbm_port = $port;
            // SAFETY: see above.
            unsafe { (*port).flush.is_some() }
        }

        fn pre_transmission(&mut $self) {
            let port: *const mbm_port = $port;
            // SAFETY: see above.
            unsafe {
                if let Some(hook) = (*port).preTransmission {
                    hook((*port).context)
                }
            }
        }

        fn post_transmission(&mut $self) {
            let port: *const mbm_port = $port;
            // SAFETY: see above.
            unsafe {
                if let Some(hook) = (*port).postTransmission {
                    hook((*port).context)
                }
            }
        }
    };
}

impl Port for mbm_port {
    fn is_ready(&self) -> bool {
        // The begin functions accept complete ports only.
        self.read.is_some()
    }

    calls_hooks!(self, &raw const *self);
}

/// A pointer to a port.
#[repr(transparent)]
pub(super) struct PortRef {
    port: *const mbm_port,
}

impl PortRef {
    /// A reference to a port.
    ///
    /// # Safety
    /// As for [`PortRef::set`].
    pub(super) const unsafe fn new(port: *const mbm_port) -> PortRef {
        PortRef { port }
    }

    /// Refers to a port.
    ///
    /// # Safety
    /// The port is complete, and does not change for as long as this refers to it.
    pub(super) unsafe fn set(&mut self, port: *const mbm_port) {
        self.port = port;
    }

    /// The port; NULL for none.
    pub(super) const fn get(&self) -> *const mbm_port {
        self.port
    }

    /// Refers to no port, if it refers to `port`.
    pub(super) fn clear_if(&mut self, port: *const mbm_port) {
        if self.port == port {
            self.port = null();
        }
    }

    /// Calls the hook `idle`.
    ///
    /// # Safety
    /// `this` refers to a port. No reference to the object that holds `this` lives, because
    /// the hook may use that object.
    pub(super) unsafe fn idle(this: *const PortRef, node: *mut mbm_node) {
        if let Some(idle) = (*(*this).port).idle {
            idle((*(*this).port).context, node);
        }
    }
}

// The port is complete, as PortRef::set demands. The engine calls no hook if the port is not ready.
impl Port for PortRef {
    fn is_ready(&self) -> bool {
        !self.port.is_null()
    }

    calls_hooks!(self, self.port);
}
