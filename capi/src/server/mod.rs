//! `mbm_server_*`: a server on a line or connection for C.

mod begin;
mod callbacks;
mod cells;
mod custom;
mod diagnostics;
mod files;
mod identity;
mod records;
mod respond;
mod tables;
mod units;

pub use begin::*;
pub use callbacks::*;
pub use custom::*;
pub use diagnostics::*;
pub use files::*;
pub use identity::*;
pub use records::*;
pub use respond::*;
pub use tables::*;
pub use units::*;

use super::pointers::{check, check_once, object, with_hooks, CObject, BEGUN, IN_HOOK};
use super::port::{self, mbm_port};
use core::ffi::c_void;
use core::slice::from_raw_parts_mut;
use mbm::error::Status;
use mbm::pdu::custom::Rule;
use mbm::server::{Reply, Server, ServerStorage, MOST_REQUESTS};
use mbm::FIRMWARE;

/// A Modbus server on one line or one connection.
///
/// Storage is yours and must be zero before first use, which a static object is
/// (`static mbm_server server;`). What it serves are units, which several
/// servers may share: one on a serial line and four TCP connections, for
/// example, are five servers with the same units. Use a server and its units from
/// one thread and never from an interrupt; servers that share units belong to one
/// thread.
///
/// Hooks and functions of yours run within mbm_server_poll. A function that they
/// call on the server that is polled returns MBM_BUSY and changes nothing: call
/// it when mbm_server_poll has returned. They may call functions on other servers,
/// and the mbm_unit_serve functions on units.
#[repr(C)]
pub struct mbm_server {
    /// Private.
    pointers: [*mut c_void; 14],
    /// Private.
    words: [u32; 8],
}

/// What lies behind an `mbm_server`.
#[repr(C)]
struct Object {
    // Where one instruction reaches it; on a host, where the core has the address
    // of the object.
    #[cfg(any(target_os = "none", mbm_firmware))]
    mark: u8,
    core: Core,
    #[cfg(not(any(target_os = "none", mbm_firmware)))]
    mark: u8,
}

pub(super) type Core = Server<mbm_port, ServerBuffers>;

const _: () = {
    let space = size_of::<mbm_server>();
    let used = size_of::<Object>();
    assert!(align_of::<mbm_server>() >= align_of::<Object>());
    assert!(used <= space);
    // Hiding the fields may waste 5 % where RAM is scarce.
    assert!(size_of::<usize>() > 4 || (space - used) * 20 <= space);
};

/// What mbm_server_beginRtu and its sisters were given.
#[repr(C)]
pub(super) struct ServerBuffers {
    bytes: u16,
    count: u8,
    frame: *mut u8,
    units: *mut mbm_unit,
}

impl ServerStorage for ServerBuffers {
    fn frame(&mut self) -> &mut [u8] {
        // SAFETY: begin demands a buffer of so many bytes for as long as the
        // object is used, and takes no NULL.
        unsafe {
            core::hint::assert_unchecked(!self.frame.is_null());
            from_raw_parts_mut(self.frame, usize::from(self.bytes))
        }
    }

    fn capacity(&mut self) -> usize {
        self.bytes.into()
    }

    fn part(&mut self, start: usize, end: usize) -> &mut [u8] {
        debug_assert!(start <= end && end <= self.bytes.into());
        // SAFETY: begin demands a buffer of so many bytes for as long as the object is
        // used, and the core keeps to the contract of `part`: places come from what a
        // port took or gave, of which more than there was room for does not count.
        unsafe { from_raw_parts_mut(self.frame.add(start), end - start) }
    }

    #[cfg_attr(target_os = "none", inline(never))]
    fn keep(&mut self, start: usize, end: usize) {
        // SAFETY: as for `part`.
        unsafe {
            let mut to = self.frame;
            let mut left = end - start;
            while left != 0 {
                *to = *to.add(start);
                to = to.add(1);
                left -= 1;
            }
        }
    }

    fn rule(&self, function: u8) -> Option<Rule> {
        // SAFETY: begin demands so many units for as long as the object is used.
        unsafe { custom::rule(self.units, self.count, function) }
    }
}

// SAFETY: the mark is a field of its own.
unsafe impl CObject for mbm_server {
    // A pointer, for while a poll is at work hooks may hand the server to functions of
    // this library. The core leaves the mark out, which those look at.
    type Access<'a> = *mut Core;

    unsafe fn mark(server: *const mbm_server) -> *mut u8 {
        // SAFETY: as the caller promises; every object is writable storage.
        unsafe { &raw mut (*server.cast::<Object>().cast_mut()).mark }
    }

    unsafe fn access<'a>(server: *mut mbm_server) -> Self::Access<'a> {
        // SAFETY: as the caller promises.
        unsafe { &raw mut (*server.cast::<Object>()).core }
    }
}

/// Moves the server on, without waiting: takes bytes in, carries a request out
/// once it is whole, sends the response.
///
/// Call it as often as you like, at least once per character time of the line
/// if nothing else buffers its bytes. On a serial line a response begins with
/// the first call after the line has been silent for t3.5.
///
/// @param server  the object
/// @return MBM_OK; MBM_LINK_LOST if the port said so, which ends a connection;
///         MBM_MALFORMED_FRAME if what came over TCP is not Modbus, so that
///         the connection is to be closed; MBM_BUSY from within a hook of this
///         server; MBM_INVALID_ARGUMENT or MBM_NOT_INITIALISED
#[no_mangle]
pub unsafe extern "C" fn mbm_server_poll(server: *mut mbm_server) -> u8 {
    // SAFETY: as the header demands.
    unsafe {
        let status = check_once(server);
        if status != Status::OK {
            return status.code();
        }
        let mark = mbm_server::mark(server);
        mark.write(IN_HOOK);
        let status = serve(object(server), mark);
        // An object that a hook zeroed stays zero.
        mark.write(mark.read() & BEGUN);
        status.code()
    }
}

/// Takes bytes in, and answers requests.
///
/// # Safety
/// The core is that of an object that is begun and whose mark says that it polls,
/// so that no function of this file uses it meanwhile.
#[inline(always)]
unsafe fn serve(core: *mut Core, mark: *const u8) -> Status {
    // SAFETY: as the caller promises. No reference to the core lives while units
    // are served, or while the clock is read: both are the caller's code.
    unsafe {
        // One request a poll is as much as a line brings.
        if FIRMWARE {
            let now = port::now(&raw const (*core).port);
            core::hint::assert_unchecked((*core).has_framing());
            let status = (*core).look(now);
            if status == Status::PENDING {
                let info = &raw const (*core).request;
                let storage = &raw const (*core).storage;
                let pdu = (*storage).frame.add((*info).head.into());
                let reply = units::serve((*storage).units, (*storage).count, info, pdu);
                core::hint::assert_unchecked(mark.read() != IN_HOOK || (*core).has_framing());
                if mark.read() != IN_HOOK || !(*core).answer_served(Reply::from_number(reply)) {
                    return Status::OK;
                }
            } else if status != Status::OK {
                return status;
            }
            return (*core).go_on();
        }
        for _ in 0..MOST_REQUESTS {
            let now = if (*core).keeps_time() {
                port::now(&raw const (*core).port)
            } else {
                0
            };
            core::hint::assert_unchecked((*core).has_framing());
            let status = (*core).look(now);
            if status != Status::PENDING {
                if status == Status::OK {
                    return (*core).go_on();
                }
                return status;
            }
            let info = &raw const (*core).request;
            let storage = &raw const (*core).storage;
            let pdu = (*storage).frame.add((*info).head.into());
            let reply = units::serve((*storage).units, (*storage).count, info, pdu);
            if mark.read() != IN_HOOK {
                return Status::OK;
            }
            if let Some(status) = (*core).finish(Reply::from_number(reply)) {
                return status;
            }
        }
    }
    Status::OK
}

/// How long mbm_server_poll will find nothing to do unless a byte arrives, so
/// that a program may sleep until then.
///
/// @param server  the object
/// @return microseconds; 0 means poll now, and is returned within a hook of this
///         server; 0xFFFFFFFF until a byte arrives; 1000
///         while a function of yours returns MBM_REPLY_PENDING or a connection does
///         not take the response: to go on sooner, poll when that has changed. No
///         byte is taken meanwhile, so do not wait for one
#[no_mangle]
pub unsafe extern "C" fn mbm_server_pollDelay(server: *const mbm_server) -> u32 {
    // SAFETY: as the header demands; no reference lives while the clock is read.
    unsafe {
        match check(server) {
            Status::OK => {
                let core = object(server);
                let now = with_hooks(server, || port::now(&raw const (*core).port));
                (*core).poll_delay(now)
            }
            Status::BUSY => 0,
            _ => u32::MAX,
        }
    }
}
