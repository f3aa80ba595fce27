//! `mbm_server_*`: a server on a line or connection, for C.
//!
//! What the unsafe functions in this folder demand: `service` is the head of the record to which the
//! function casts it, `pdu` has the length and the space that `info` gives, and pointers to a unit,
//! a record or a table are not NULL, unless they come from C.

mod begin;
mod buffers;
mod callbacks;
mod cells;
mod custom;
mod diagnostics;
mod files;
mod hooks;
mod identity;
mod records;
mod respond;
mod table_hooks;
mod tables;
mod units;

pub use begin::*;
pub use callbacks::*;
pub use custom::*;
pub use diagnostics::*;
pub use files::*;
pub use hooks::*;
pub use identity::*;
pub use records::*;
pub use respond::*;
pub use table_hooks::*;
pub use tables::*;
pub use units::*;

use super::pointers::{c_object, check, check_once, object, with_hooks, CObject, BEGUN, IN_HOOK};
use super::port;
use buffers::{Core, ServerBuffers};
use core::ffi::c_void;
use core::slice::{from_raw_parts, from_raw_parts_mut};
use mbm::engine::Storage;
use mbm::error::Status;
use mbm::pdu::custom::Rule;
use mbm::server::{Reply, ServerStorage};

/// A Modbus server on one serial line or one connection.
///
/// You provide the storage. Initialise it with MBM_INIT. A server serves units. Several
/// servers may share units: for example, a server on a serial line and four servers on TCP
/// connections are five servers with the same units. Use a server and its units from one
/// thread, and never from an interrupt. Use all servers that share units from the same thread.
///
/// mbm_server_poll calls your hooks and your functions. If they call a function on the
/// server that is being polled, it returns MBM_BUSY and changes nothing; call it after
/// mbm_server_poll has returned. They may call functions on other servers, and the
/// mbm_unit_serve functions on any unit.
#[repr(C)]
pub struct mbm_server {
    /// Private.
    pointers: [*mut c_void; 16],
    /// Private.
    words: [u32; 10],
}

/// The real content of an `mbm_server`.
#[repr(C)]
struct Object {
    // The mark is first: one instruction of a microcontroller then reaches it.
    mark: u8,
    core: Core,
}

impl Storage for ServerBuffers {
    type Count = usize;

    fn capacity(&self) -> usize {
        self.bytes.into()
    }

    fn byte(&self, index: usize) -> u8 {
        // SAFETY: as for `slice`.
        unsafe { *self.frame.add(index) }
    }

    fn set_byte(&mut self, index: usize, byte: u8) {
        // SAFETY: as for `slice`.
        unsafe { *self.frame.add(index) = byte }
    }

    fn slice(&self, index: usize, count: usize) -> &[u8] {
        debug_assert!(index + count <= self.bytes.into());
        // SAFETY: begin requires a buffer of `bytes` bytes that is valid for as long as the
        // object is used, and refuses NULL. The core keeps the contract of `Storage`: indexes come from the counts
        // that the port returned, which the core limits to the buffer.
        unsafe { from_raw_parts(self.frame.add(index), count) }
    }

    fn bytes(&mut self, index: usize, count: usize) -> &mut [u8] {
        debug_assert!(index + count <= self.bytes.into());
        // SAFETY: as for `slice`.
        unsafe {
            core::hint::assert_unchecked(!self.frame.is_null());
            from_raw_parts_mut(self.frame.add(index), count)
        }
    }

    fn move_down(&mut self, from: usize, count: usize) {
        // SAFETY: as for `slice`.
        unsafe {
            let (mut to, mut left) = (self.frame, count);
            while left != 0 {
                *to = *to.add(from);
                to = to.add(1);
                left -= 1;
            }
        }
    }
}

impl ServerStorage for ServerBuffers {
    fn serves(&self, unit: u8) -> bool {
        // SAFETY: as for `rule`.
        unsafe { units::have(self.units, self.count, unit) }
    }

    fn rule(&self, function: u8) -> Option<Rule> {
        // SAFETY: begin requires `count` units that are valid for as long as the
        // object is used.
        unsafe { custom::rule(self.units, self.count, function) }
    }
}

c_object! { mbm_server, *mut Core, core }

/// Polls the server, without waiting: receives bytes, carries out a complete request, and
/// sends the response.
///
/// Call it often: at least once per character time of the line if nothing else buffers
/// received bytes. On a serial line the response starts with the first call after the
/// line has been silent for t3.5.
///
/// @return a status; MBM_LINK_LOST if the port reported that the connection is lost: close it;
///         MBM_MALFORMED_FRAME if the bytes received over TCP are not Modbus: close the connection
#[no_mangle]
pub unsafe extern "C" fn mbm_server_poll(server: *mut mbm_server) -> u8 {
    let status = check_once(server);
    if status != Status::OK {
        return status.code();
    }
    let mark = mbm_server::mark(server);
    mark.write(IN_HOOK);
    let status = poll(object(server), mark);
    // If a hook zeroed the object, its mark stays zero.
    mark.write(mark.read() & BEGUN);
    status.code()
}

/// Receives bytes, and serves and answers the requests among them.
///
/// # Safety
/// `core` belongs to an object that was begun. The mark of the object is `IN_HOOK`, so
/// no function of this file uses the object meanwhile.
unsafe fn poll(core: *mut Core, mark: *const u8) -> Status {
    // Units and the clock are code of the program; no reference to the core lives while they run.
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
    (*core).go_on()
}

/// Returns how long the program may sleep before the next mbm_server_poll, unless bytes
/// arrive earlier. Do not sleep longer: while a response leaves on a serial line, the driver would
/// go off late.
///
/// @return microseconds. 0: poll now; a call from within a hook of this server returns 0 too.
///         0xFFFFFFFF: sleep until the port has bytes to read; also for NULL and for a server that
///         was never begun. After a response on a serial line it is first the time in which an echo
///         may arrive. 1000: a function of yours has returned MBM_REPLY_PENDING, or a connection
///         does not accept the response yet; the server receives no bytes meanwhile, so do not wait
///         for one, but poll earlier if you know that the function or the connection is ready.
///         Afterwards, and after a begin function, it is 0 until mbm_server_poll has read the port,
///         so bytes that arrived meanwhile need not end a sleep
#[no_mangle]
pub unsafe extern "C" fn mbm_server_pollDelay(server: *const mbm_server) -> u32 {
    // No reference lives while the clock is read.
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
