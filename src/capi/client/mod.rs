//! `mbm_client_*`: the client that never waits, for C.

mod begin;
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

use super::client_pointers as pointers;
use super::port::{self, mbm_port};
use super::storage::mbm_counters;
use crate::client::{self as core_client, Client, Job, Means, Policy, Serial, Tcp, Unit};
use crate::error::Status;
use crate::frame::{ascii_window, rtu, Search};
use crate::transaction::{Counter, Settings, Storage};
use core::ffi::c_void;
use core::slice::from_raw_parts_mut;
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
    words: [u32; 20],
}

/// What a client of a serial line in RTU frames, one in ASCII frames and one of
/// a TCP stream are.
type Rtu = Client<RtuLine, Lent, DEPTH>;
type Ascii = Client<AsciiLine, Lent, DEPTH>;
type TcpIp = Client<TcpLine, Lent, DEPTH>;
type RtuLine = Serial<mbm_port, LentByC, Lent, rtu::Window>;
type AsciiLine = Serial<mbm_port, LentByC, Lent, ascii_window::Window>;
type TcpLine = Tcp<mbm_port, LentByC>;

/// What lies behind an `mbm_client`.
#[repr(C)]
pub(super) struct Object {
    mark: u8,
    polling: bool,
    framing: u8,
    calls: *const Calls,
    client: Either,
}

#[repr(C)]
union Either {
    rtu: core::mem::ManuallyDrop<Rtu>,
    ascii: core::mem::ManuallyDrop<Ascii>,
    tcp: core::mem::ManuallyDrop<TcpIp>,
}

const _: () = {
    let room = size_of::<mbm_client>();
    let used = size_of::<Object>();
    assert!(align_of::<mbm_client>() >= align_of::<Object>());
    assert!(used <= room);
    // Hiding the fields may waste 5 % where RAM is scarce.
    assert!(size_of::<usize>() > 4 || (room - used) * 20 <= room);
};

impl Object {
    /// Marks an object that was begun; zeroed storage does not carry it.
    pub(super) const BEGUN: u8 = 0x43;
    /// Marks an object while hooks may be called that may not use it.
    pub(super) const CALLING: u8 = 0x44;

    /// The mark in storage of an object.
    ///
    /// # Safety
    /// `client` points to storage of an object, zeroed or begun.
    pub(super) unsafe fn mark(client: *const mbm_client) -> *mut u8 {
        // SAFETY: as the caller promises; every object is writable storage.
        unsafe { &raw mut (*client.cast::<Object>().cast_mut()).mark }
    }
}

/// The calls of an object.
///
/// # Safety
/// `object` is one that is begun.
unsafe fn calls(object: *const Object) -> &'static Calls {
    // SAFETY: an object that is begun has them, from constants.
    unsafe { &*(*object).calls }
}

/// What differs from one kind of line to the next; firmware carries what its
/// mbm_client_begin function names. What is called seldom is not here, so that it
/// is carried only by who calls it: see [`on_line`].
struct Calls {
    kind: Line,
    poll: unsafe fn(*mut mbm_client) -> Status,
    queue: unsafe fn(*mut Object, Lent) -> Status,
    holds: unsafe fn(*mut Object, Lent) -> bool,
}

/// The kinds of line that C has.
#[derive(Clone, Copy)]
enum Line {
    Rtu,
    Ascii,
    Tcp,
}

/// The parts of a client that settings reach.
struct Parts<'a> {
    settings: &'a mut Settings,
    means: &'a mut LentByC,
    port: &'a mut mbm_port,
    policy: &'a mut Policy,
}

type LineParts<'a> = (&'a mut Settings, &'a mut LentByC, &'a mut mbm_port);

/// A kind of line that C has.
trait Kind: core_client::Line<Lent> + Sized + 'static {
    const CALLS: Calls;

    fn parts(&mut self) -> LineParts<'_>;
}

impl Kind for RtuLine {
    const CALLS: Calls = calls_of::<Self>(Line::Rtu);

    fn parts(&mut self) -> LineParts<'_> {
        parts_of(self)
    }
}

impl Kind for AsciiLine {
    const CALLS: Calls = calls_of::<Self>(Line::Ascii);

    fn parts(&mut self) -> LineParts<'_> {
        parts_of(self)
    }
}

fn parts_of<W: Search>(line: &mut Serial<mbm_port, LentByC, Lent, W>) -> LineParts<'_> {
    let engine = line.transaction();
    (&mut engine.settings, &mut engine.storage, &mut engine.port)
}

impl Kind for TcpLine {
    const CALLS: Calls = calls_of::<Self>(Line::Tcp);

    fn parts(&mut self) -> LineParts<'_> {
        (&mut self.settings, &mut self.means, &mut self.port)
    }
}

const fn calls_of<L: Kind>(kind: Line) -> Calls {
    Calls {
        kind,
        poll: poll::<L>,
        queue: queue::<L>,
        holds: holds::<L>,
    }
}

/// The client in an object. The mark stands outside of it.
///
/// # Safety
/// `object` is begun, with the calls of `L`, and nothing else uses its client while
/// the reference lives.
unsafe fn client<'a, L>(object: *mut Object) -> &'a mut Client<L, Lent, DEPTH> {
    // SAFETY: as the caller promises.
    unsafe { &mut *(&raw mut (*object).client).cast() }
}

/// What clients of every line have in common.
///
/// # Safety
/// As for [`client`], of any `L`.
unsafe fn common<'a>(object: *mut Object) -> &'a mut Client<(), Lent, DEPTH> {
    // SAFETY: as `client`; the line is the last of its fields, whose order is C's.
    unsafe { &mut *(&raw mut (*object).client).cast() }
}

/// Does something with the client in an object, whatever its line. Unsafe as
/// [`client`] is.
macro_rules! on_line {
    ($object:expr, $client:ident => $action:expr) => {
        match $crate::capi::client::calls($object).kind {
            Line::Rtu => {
                let $client: &mut Rtu = client($object);
                $action
            }
            Line::Ascii => {
                let $client: &mut Ascii = client($object);
                $action
            }
            Line::Tcp => {
                let $client: &mut TcpIp = client($object);
                $action
            }
        }
    };
}
use on_line;

/// The time on the clock of a client's port.
///
/// # Safety
/// As for [`client`]; no reference into the object lives, as the clock is a hook.
unsafe fn now<L: Kind>(object: *mut Object) -> u32 {
    // SAFETY: as the caller promises; the reference ends before the hook runs.
    unsafe {
        let port: *const mbm_port = client::<L>(object).line.parts().2;
        port::now(port)
    }
}

/// Polls, and calls `done` of those that ended.
///
/// # Safety
/// `pointer` is an object that is begun, as a client of `L`; no reference into it
/// lives.
unsafe fn poll<L: Kind>(pointer: *mut mbm_client) -> Status {
    let object = pointers::object(pointer);
    // SAFETY: begun; no reference lives while `done` is called, for that may use
    // the object. If it zeroed it, and perhaps began it anew, polling is over.
    unsafe {
        if client::<L>(object).is_lent() {
            return Status::BUSY;
        }
        let now = pointers::calling(pointer, || now::<L>(object));
        (*object).polling = true;
        for turn in 0..MBM_CLIENT_DEPTH + 1 {
            let poll = || client::<L>(object).poll(now, turn == 0);
            match pointers::calling(pointer, poll) {
                Some(request) => request.call(),
                None => break,
            }
            if !(*object).polling {
                return Status::OK;
            }
        }
        (*object).polling = false;
        match client::<L>(object).pending() {
            0 => Status::OK,
            _ => Status::PENDING,
        }
    }
}

/// # Safety
/// As for [`client`].
unsafe fn queue<L: Kind>(object: *mut Object, request: Lent) -> Status {
    // SAFETY: as the caller promises.
    match unsafe { client::<L>(object) }.queue(request) {
        Ok(()) => Status::PENDING,
        Err(refused) => refused.ticket().status,
    }
}

/// True if the client has this request already, whatever the request says of itself.
///
/// # Safety
/// As for [`client`].
unsafe fn holds<L: Kind>(object: *mut Object, request: Lent) -> bool {
    // SAFETY: as the caller promises.
    unsafe { client::<L>(object) }.holds(|held| *held == request)
}

/// The parts of the client in an object.
///
/// # Safety
/// As for [`client`].
#[cfg_attr(target_os = "none", inline(never))]
unsafe fn parts<'a>(object: *mut Object) -> Parts<'a> {
    // SAFETY: as the caller promises.
    unsafe {
        on_line!(object, client => {
            let (policy, line) = client.parts();
            let (settings, means, port) = Kind::parts(line);
            Parts {
                settings,
                means,
                port,
                policy,
            }
        })
    }
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
impl Storage for LentByC {
    fn frame(&mut self) -> &mut [u8] {
        // SAFETY: see above; a client is begun with a frame buffer only.
        unsafe { from_raw_parts_mut(self.frame, self.frame_bytes.into()) }
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
