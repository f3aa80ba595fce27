//! The port that C supplies.

use super::master::object::mbm_master;
use core::ffi::c_void;
use core::ptr::null;
use mbm::port::Port;

/// What the firmware supplies: a byte stream, a clock, and optional hooks.
///
/// A master refers to its port, which must stay valid and unchanged for as long as the
/// master is used; it may be a constant. A client and a server copy theirs. Hooks that
/// are NULL are not called; `read`, `write` and `micros` must be there.
///
/// A function that a hook calls on the object that called the hook returns
/// MBM_BUSY and changes nothing; a getter returns what it returns for an object
/// that was never begun. The hook `idle` is the exception: it may call every
/// function, and one that starts a request returns MBM_BUSY.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct mbm_port {
    /// Handed to every hook. Yours, may be NULL.
    pub context: *mut c_void,
    /// Takes up to `capacity` received bytes without waiting. Returns how
    /// many, 0 if none has arrived yet, negative if the link is lost.
    pub read:
        Option<unsafe extern "C" fn(context: *mut c_void, bytes: *mut u8, capacity: u16) -> i16>,
    /// Accepts up to `length` bytes to send without waiting for the wire.
    /// Returns how many, 0 if none just now, negative if the link is lost.
    pub write:
        Option<unsafe extern "C" fn(context: *mut c_void, bytes: *const u8, length: u16) -> i16>,
    /// A clock in microseconds that wraps at 2^32. A platform with a
    /// millisecond tick returns `tick * 1000`.
    pub micros: Option<unsafe extern "C" fn(context: *mut c_void) -> u32>,
    /// Optional: 1 once the last bit has left, 0 while bits are to come. It
    /// may wait for the last bit instead and return 1.
    pub flush: Option<unsafe extern "C" fn(context: *mut c_void) -> u8>,
    /// Optional: called before the first byte of a request (RS-485 driver on).
    pub preTransmission: Option<unsafe extern "C" fn(context: *mut c_void)>,
    /// Optional: called after the last bit of a request (RS-485 driver off).
    pub postTransmission: Option<unsafe extern "C" fn(context: *mut c_void)>,
    /// Optional: called again and again while a blocking call of `master` waits,
    /// never between preTransmission and postTransmission. It may sleep until a
    /// byte arrives, for at most the time that mbm_master_pollDelay(master)
    /// returns.
    pub idle: Option<unsafe extern "C" fn(context: *mut c_void, master: *mut mbm_master)>,
}

impl mbm_port {
    #[inline(always)]
    pub(super) fn is_complete(&self) -> bool {
        self.read.is_some() && self.write.is_some() && self.micros.is_some()
    }

    /// Becomes as another. (At once is a call of memcpy: little on an AVR, and in an
    /// ESP's ROM, but 170 bytes of libc on a Cortex-M0.)
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

/// Reads the clock of a port. No reference to the port, nor to the object that
/// holds it, lives while the hook runs.
///
/// # Safety
/// `port` points to a complete port.
#[inline(always)]
pub(super) unsafe fn now(port: *const mbm_port) -> u32 {
    // SAFETY: as the caller promises.
    unsafe {
        let (micros, context) = ((*port).micros, (*port).context);
        micros.unwrap_unchecked()(context)
    }
}

/// Bytes of a buffer that are used: more a port's hooks could not count.
pub(super) const fn countable(bytes: u16) -> u16 {
    if bytes > i16::MAX as u16 {
        i16::MAX as u16
    } else {
        bytes
    }
}

// SAFETY, here and below: the hooks are C functions that keep the contract
// that their comments state, slices are valid for their length and no longer than
// an i16 counts, and what a complete port has is called of such a port only.
impl Port for mbm_port {
    fn is_ready(&self) -> bool {
        // Begin takes complete ports only.
        self.read.is_some()
    }

    fn read(&mut self, bytes: &mut [u8]) -> i16 {
        // SAFETY: see above.
        let count = unsafe {
            let read = self.read.unwrap_unchecked();
            read(self.context, bytes.as_mut_ptr(), bytes.len() as u16)
        };
        count.min(bytes.len() as i16)
    }

    fn write(&mut self, bytes: &[u8]) -> i16 {
        // SAFETY: see above.
        let count = unsafe {
            let write = self.write.unwrap_unchecked();
            write(self.context, bytes.as_ptr(), bytes.len() as u16)
        };
        count.min(bytes.len() as i16)
    }

    fn micros(&mut self) -> u32 {
        // SAFETY: see above.
        unsafe { self.micros.unwrap_unchecked()(self.context) }
    }

    fn flush(&mut self) -> bool {
        match self.flush {
            // SAFETY: see above.
            Some(flush) => unsafe { flush(self.context) != 0 },
            None => true,
        }
    }

    fn pre_transmission(&mut self) {
        if let Some(hook) = self.preTransmission {
            // SAFETY: see above.
            unsafe { hook(self.context) }
        }
    }

    fn post_transmission(&mut self) {
        if let Some(hook) = self.postTransmission {
            // SAFETY: see above.
            unsafe { hook(self.context) }
        }
    }
}

/// A port that stays where it is, and what its hooks are handed.
#[repr(C)]
pub(super) struct PortRef {
    port: *const mbm_port,
    context: *mut c_void,
}

impl PortRef {
    /// Refers to a port.
    ///
    /// # Safety
    /// The port is complete, and stays as it is for as long as this refers to it.
    #[inline(always)]
    pub(super) unsafe fn set(&mut self, port: *const mbm_port, context: *mut c_void) {
        self.port = port;
        self.context = context;
    }

    /// Refers to no port.
    pub(super) fn clear(&mut self) {
        self.port = null();
    }

    /// Calls the hook `idle`.
    ///
    /// # Safety
    /// `this` refers to a port. No reference to what holds it lives, for the hook may
    /// use that.
    #[inline(always)]
    pub(super) unsafe fn idle(this: *const PortRef, master: *mut mbm_master) {
        // SAFETY: as the caller promises.
        unsafe {
            if let Some(idle) = (*(*this).port).idle {
                idle((*this).context, master);
            }
        }
    }
}

// The port is complete, as PortRef::set demands; the engine calls nothing of a master
// that is not ready.
impl Port for PortRef {
    fn is_ready(&self) -> bool {
        !self.port.is_null()
    }

    fn read(&mut self, bytes: &mut [u8]) -> i16 {
        // SAFETY: see above.
        let count = unsafe {
            let read = (*self.port).read.unwrap_unchecked();
            read(self.context, bytes.as_mut_ptr(), bytes.len() as u16)
        };
        count.min(bytes.len() as i16)
    }

    fn write(&mut self, bytes: &[u8]) -> i16 {
        // SAFETY: see above.
        let count = unsafe {
            let write = (*self.port).write.unwrap_unchecked();
            write(self.context, bytes.as_ptr(), bytes.len() as u16)
        };
        count.min(bytes.len() as i16)
    }

    fn micros(&mut self) -> u32 {
        // SAFETY: see above.
        unsafe { (*self.port).micros.unwrap_unchecked()(self.context) }
    }

    fn flush(&mut self) -> bool {
        // SAFETY: see above.
        unsafe {
            match (*self.port).flush {
                Some(flush) => flush(self.context) != 0,
                None => true,
            }
        }
    }

    fn pre_transmission(&mut self) {
        // SAFETY: see above.
        unsafe {
            if let Some(hook) = (*self.port).preTransmission {
                hook(self.context)
            }
        }
    }

    fn post_transmission(&mut self) {
        // SAFETY: see above.
        unsafe {
            if let Some(hook) = (*self.port).postTransmission {
                hook(self.context)
            }
        }
    }
}
