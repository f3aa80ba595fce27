//! `mbm_client_*`: the client that never waits, for C.

mod begin;
mod kind;
mod line;
mod poll;
mod request;
mod requests;
mod settings;

pub use begin::*;
pub use line::*;
pub use poll::*;
pub use request::mbm_clientRequest;
pub use requests::*;
pub use settings::*;

use super::pointers::{self, CObject};
use super::port;
use super::storage::mbm_counters;
use core::ffi::c_void;
use core::slice::{from_raw_parts, from_raw_parts_mut};
use kind::{Kind, Lines};
use mbm::client::{Means, Policy, Shared, Unit};
use mbm::engine::{Counter, Storage};
use mbm::error::Status;
use request::Lent;

/// The most requests that wait or are under way in one client.
pub const MBM_CLIENT_DEPTH: u8 = 16;

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
    /// Not for you.
    pointers: [*mut c_void; 46],
    /// Not for you.
    words: [u32; 24],
}

/// What lies behind an `mbm_client`.
#[repr(C)]
pub(super) struct Object {
    mark: u8,
    polling: bool,
    kind: *const Kind,
    shared: Shared<Lent, DEPTH>,
    line: Lines,
}

const _: () = {
    let room = size_of::<mbm_client>();
    let used = size_of::<Object>();
    assert!(align_of::<mbm_client>() >= align_of::<Object>());
    assert!(used <= room);
    // Hiding the fields may waste 5 % where RAM is scarce.
    assert!(size_of::<usize>() > 4 || (room - used) * 20 <= room);
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
unsafe fn shared<'a>(object: *mut Object) -> &'a mut Shared<Lent, DEPTH> {
    // SAFETY: as the caller promises.
    unsafe { &mut (*object).shared }
}

/// How long a request waits to be asked again, if it is. (A pointer, as [`Treatment`].)
type Again = fn(&mut LentByC, &Policy, retries: u8, Status) -> Option<u32>;

/// How a unit is treated as its record says. (Behind a pointer, so that firmware
/// without records carries none of it.)
struct Treatment {
    rest: fn(&mut LentByC, unit: u8, now: u32) -> u32,
    note: fn(&mut LentByC, unit: u8, told: Told, now: u32),
}

/// How a request to a unit ended, and whether it is asked again.
struct Told {
    status: Status,
    again: bool,
}

/// What the begin functions and settings lend.
#[repr(C)]
struct LentByC {
    frame: *mut u8,
    outgoing: *mut u8,
    counters: *mut mbm_counters,
    units: *mut Unit,
    treatment: Option<&'static Treatment>,
    again: Option<Again>,
    random: Option<unsafe extern "C" fn(context: *mut c_void) -> u32>,
    random_context: *mut c_void,
    frame_bytes: u16,
    outgoing_bytes: u16,
    unit_count: u8,
}

// SAFETY, of all functions here: each pointer is NULL, or what the function of
// the header that set it demands, valid for as long as the object is used; what
// is NULL has no length, and each is lent for as long as `self` is borrowed.
//
// Nothing is checked here, for its bytes: engine and TCP line keep every index within
// `room`. `c-tests/test_client_buffers.c` holds them to that under AddressSanitizer.
impl Storage for LentByC {
    type Count = u16;

    fn room(&self) -> u16 {
        self.frame_bytes
    }

    #[inline(always)]
    fn byte(&self, index: u16) -> u8 {
        // SAFETY: below `frame_bytes`, see above.
        unsafe { *self.frame.add(index.into()) }
    }

    #[inline(always)]
    fn set_byte(&mut self, index: u16, byte: u8) {
        // SAFETY: below `frame_bytes`, see above.
        unsafe { *self.frame.add(index.into()) = byte }
    }

    #[inline(always)]
    fn slice(&self, index: u16, count: u16) -> &[u8] {
        // SAFETY: up to `frame_bytes`, see above.
        unsafe { from_raw_parts(self.frame.add(index.into()), count.into()) }
    }

    #[inline(always)]
    fn bytes(&mut self, index: u16, count: u16) -> &mut [u8] {
        // SAFETY: up to `frame_bytes`, see above.
        unsafe { from_raw_parts_mut(self.frame.add(index.into()), count.into()) }
    }

    fn set_aside(&mut self, count: u16) {
        // SAFETY: up to `frame_bytes`, see above.
        self.frame = unsafe { self.frame.add(count.into()) };
        self.frame_bytes -= count;
    }

    fn take_back(&mut self, count: u16) {
        // SAFETY: as many as were set aside.
        self.frame = unsafe { self.frame.sub(count.into()) };
        self.frame_bytes += count;
    }

    #[cfg_attr(all(feature = "counters", target_os = "none"), inline(never))]
    fn count(&mut self, counter: Counter, more: u16) {
        if cfg!(feature = "counters") && !self.counters.is_null() {
            // SAFETY: see above, and mbm_counters are integers in a row, in the
            // order of `Counter`.
            unsafe {
                let counter = self.counters.cast::<u32>().add(counter as usize);
                *counter = (*counter).wrapping_add(more.into());
            }
        }
    }
}

impl Means for LentByC {
    fn outgoing(&mut self) -> &mut [u8] {
        // SAFETY: see above; a TCP client is begun with one, no other asks for it.
        unsafe { from_raw_parts_mut(self.outgoing, self.outgoing_bytes.into()) }
    }

    fn to_send(&mut self, from: u16, to: u16) -> &mut [u8] {
        // SAFETY: see above; the client keeps its places within the buffer.
        unsafe { from_raw_parts_mut(self.outgoing.add(from.into()), (to - from).into()) }
    }

    fn units(&mut self) -> &mut [Unit] {
        if self.units.is_null() {
            return &mut [];
        }
        // SAFETY: see above.
        unsafe { from_raw_parts_mut(self.units, self.unit_count.into()) }
    }

    fn rest(&mut self, unit: u8, now: u32) -> u32 {
        match self.treatment {
            Some(treatment) => (treatment.rest)(self, unit, now),
            None => 0,
        }
    }

    fn note(&mut self, unit: u8, status: Status, again: bool, now: u32) {
        if let Some(treatment) = self.treatment {
            (treatment.note)(self, unit, Told { status, again }, now);
        }
    }

    fn again(&mut self, policy: &Policy, retries: u8, status: Status) -> Option<u32> {
        self.again
            .and_then(|again| again(self, policy, retries, status))
    }

    fn random(&mut self) -> u32 {
        match self.random {
            // SAFETY: the hook keeps the contract of mbm_client_setJitter.
            Some(random) => unsafe { random(self.random_context) },
            None => 0,
        }
    }
}
