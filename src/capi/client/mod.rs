//! `mbm_client_*`: the client that never waits, for C.

mod begin;
mod line;
mod request;
mod requests;
mod settings;

pub use begin::*;
pub use line::*;
pub use request::mbm_clientRequest;
pub use requests::*;
pub use settings::*;

use super::client_pointers as pointers;
use super::port::mbm_port;
use super::storage::mbm_counters;
use crate::client::{self as core_client, Client, Job, Means, Policy, Serial, Tcp, Ticket, Unit};
use crate::error::Status;
use crate::frame::{ascii_window, rtu, Search};
use crate::port::Port;
use crate::transaction::{Counter, Settings, Storage};
use core::ffi::c_void;
use core::slice::from_raw_parts_mut;
use request::Lent;

/// The most requests that wait or are under way in one client.
pub const MBM_CLIENT_DEPTH: u8 = 16;

const DEPTH: usize = MBM_CLIENT_DEPTH as usize;

/// Marks an object that was begun; zeroed storage does not carry it.
const BEGUN: u8 = 0x43;

/// A client of one serial line or one TCP stream: up to 16 requests are queued,
/// mbm_client_poll moves them on, and nothing ever waits.
///
/// Storage is yours and must be zero before first use, which a static object is.
/// One of the mbm_client_begin functions comes first. Not re-entrant: use one
/// object from one thread and never from an interrupt; several objects are
/// independent of each other.
#[repr(C)]
pub struct mbm_client {
    /// Not for you.
    pointers: [*mut c_void; 46],
    /// Not for you.
    words: [u32; 20],
}

/// What a client of a serial line in RTU frames, one in ASCII frames and one of
/// a TCP stream are.
type Rtu = Client<Serial<mbm_port, LentByC, Lent, rtu::Window>, Lent, DEPTH>;
type Ascii = Client<Serial<mbm_port, LentByC, Lent, ascii_window::Window>, Lent, DEPTH>;
type TcpIp = Client<Tcp<mbm_port, LentByC>, Lent, DEPTH>;

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
    /// Says whether this object was begun, without looking at anything else.
    ///
    /// # Safety
    /// `object` points to storage of an object, zeroed or begun.
    pub(super) unsafe fn is_begun(object: *const Object) -> bool {
        // SAFETY: the storage is zeroed or written, so readable.
        unsafe { (&raw const (*object).mark).read() == BEGUN }
    }

    fn calls(&self) -> &'static Calls {
        // SAFETY: an object that is begun has them, from constants.
        unsafe { &*self.calls }
    }
}

/// What differs from one kind of line to the next; firmware carries what its
/// mbm_client_begin function names. What is called seldom is not here, so that it
/// is carried only by who calls it: see [`on_line`].
struct Calls {
    kind: Line,
    poll: unsafe fn(*mut Object) -> Status,
    queue: fn(&mut Object, Lent) -> Status,
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

impl Kind for Serial<mbm_port, LentByC, Lent, rtu::Window> {
    const CALLS: Calls = calls::<Self>(Line::Rtu);

    fn parts(&mut self) -> LineParts<'_> {
        parts_of(self)
    }
}

impl Kind for Serial<mbm_port, LentByC, Lent, ascii_window::Window> {
    const CALLS: Calls = calls::<Self>(Line::Ascii);

    fn parts(&mut self) -> LineParts<'_> {
        parts_of(self)
    }
}

fn parts_of<W: Search>(line: &mut Serial<mbm_port, LentByC, Lent, W>) -> LineParts<'_> {
    let engine = line.transaction();
    (&mut engine.settings, &mut engine.storage, &mut engine.port)
}

impl Kind for Tcp<mbm_port, LentByC> {
    const CALLS: Calls = calls::<Self>(Line::Tcp);

    fn parts(&mut self) -> LineParts<'_> {
        (&mut self.settings, &mut self.means, &mut self.port)
    }
}

const fn calls<L: Kind>(kind: Line) -> Calls {
    Calls {
        kind,
        poll: poll::<L>,
        queue: queue::<L>,
    }
}

/// The client in an object, whose calls are those of `L`.
fn client<L>(object: &mut Object) -> &mut Client<L, Lent, DEPTH> {
    // SAFETY: a begun object has the client in it that its calls are for.
    unsafe { &mut *(&raw mut object.client).cast() }
}

/// What clients of every line have in common.
fn common(object: &mut Object) -> &mut Client<(), Lent, DEPTH> {
    // SAFETY: as `client`; the line is the last of its fields, whose order is C's.
    unsafe { &mut *(&raw mut object.client).cast() }
}

/// Does something with the client in an object, whatever its line.
macro_rules! on_line {
    ($object:expr, $client:ident => $action:expr) => {
        match $object.calls().kind {
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

/// Polls, and calls `done` of those that ended.
///
/// # Safety
/// `pointer` is an object that is begun, as a client of `L`; nothing else uses it,
/// but for what `done` calls.
unsafe fn poll<L: Kind>(pointer: *mut Object) -> Status {
    // SAFETY: begun; no reference lives while `done` is called, for that may use
    // the object.
    unsafe {
        let object = &mut *pointer;
        let client = client::<L>(object);
        if client.is_lent() {
            return Status::BUSY;
        }
        let now = client.line.parts().2.micros();
        object.polling = true;
        for turn in 0..MBM_CLIENT_DEPTH + 1 {
            match self::client::<L>(&mut *pointer).poll(now, turn == 0) {
                Some(request) => request.call(),
                None => break,
            }
        }
        let object = &mut *pointer;
        object.polling = false;
        match self::client::<L>(object).pending() {
            0 => Status::OK,
            _ => Status::PENDING,
        }
    }
}

fn queue<L: Kind>(object: &mut Object, request: Lent) -> Status {
    match client::<L>(object).queue(request) {
        Ok(()) => Status::PENDING,
        Err(refused) => refused.ticket().status,
    }
}

/// The parts of the client in an object.
#[cfg_attr(target_os = "none", inline(never))]
fn parts(object: &mut Object) -> Parts<'_> {
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

/// Says whether a request is asked again. (A pointer, as [`Treatment`].)
type Again = fn(&mut LentByC, &Policy, &mut Ticket, Status, now: u32) -> bool;

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

    fn again(&mut self, policy: &Policy, ticket: &mut Ticket, status: Status, now: u32) -> bool {
        match self.again {
            Some(again) => again(self, policy, ticket, status, now),
            None => false,
        }
    }

    fn random(&mut self) -> u32 {
        match self.random {
            // SAFETY: the hook keeps the contract of mbm_client_setJitter.
            Some(random) => unsafe { random(self.random_context) },
            None => 0,
        }
    }
}

/// Moves all requests on, without waiting, and calls `done` of those that have
/// ended, of at most 17 in one call.
///
/// Call it as often as you like; mbm_client_pollDelay tells when the next call
/// is due.
///
/// @param client  the object
/// @return MBM_PENDING while requests wait or are under way, MBM_OK if there are
///         none, MBM_BUSY from within `done` and while the line is lent;
///         MBM_INVALID_ARGUMENT or MBM_NOT_INITIALISED
#[no_mangle]
pub unsafe extern "C" fn mbm_client_poll(client: *mut mbm_client) -> u8 {
    // SAFETY: as the header demands. No reference lives while `done` is called,
    // for it may use the object.
    unsafe {
        let status = pointers::check(client);
        if status != Status::OK {
            return status.code();
        }
        let object = pointers::object(client);
        if object.polling {
            return Status::BUSY.code();
        }
        let poll = object.calls().poll;
        poll(object).code()
    }
}

#[cfg_attr(not(target_os = "none"), inline(never))]
fn poll_delay<L: Kind>(client: &mut Client<L, Lent, DEPTH>) -> u32 {
    let now = client.line.parts().2.micros();
    client.poll_delay(now)
}

/// How long mbm_client_poll will find nothing to do unless a byte arrives, so
/// that a program may wait for one in select, or sleep, until then. Bytes are taken
/// only while a request is pending: with none, wait for something else.
///
/// @param client  the object
/// @return microseconds; 0 means poll now, 0xFFFFFFFF that there is no request; 1000
///         while a TCP port does not take what is to be sent: to poll sooner, wait
///         for that too, as mbm_tcp_wait does
#[no_mangle]
pub unsafe extern "C" fn mbm_client_pollDelay(client: *const mbm_client) -> u32 {
    // SAFETY: as the header demands.
    unsafe {
        pointers::ask(
            client,
            u32::MAX,
            |object| on_line!(object, client => poll_delay(client)),
        )
    }
}

/// How many requests wait or are under way.
///
/// @param client  the object
/// @return 0 to 16
#[no_mangle]
pub unsafe extern "C" fn mbm_client_pending(client: *const mbm_client) -> u8 {
    // SAFETY: as the header demands.
    unsafe {
        pointers::ask(
            client,
            0,
            |object| on_line!(object, client => client.pending() as u8),
        )
    }
}

/// Gives a request up. It is yours again at once, with the status MBM_CANCELLED;
/// `done` is not called. It may have reached the device, and may still be answered.
///
/// @param client   the object
/// @param request  a request that this client was given
/// @return MBM_OK; MBM_NOT_PENDING, with nothing changed, for a request that has
///         ended already or was never queued here; MBM_INVALID_ARGUMENT or
///         MBM_NOT_INITIALISED
#[no_mangle]
pub unsafe extern "C" fn mbm_client_cancel(
    client: *mut mbm_client,
    request: *mut mbm_clientRequest,
) -> u8 {
    // SAFETY: as the header demands.
    unsafe {
        pointers::with(client, |object| match Lent::new(request) {
            None => Status::INVALID_ARGUMENT,
            Some(request) => match on_line!(object, client => client.cancel(|job| *job == request))
            {
                None => Status::NOT_PENDING,
                Some(_) => Status::OK,
            },
        })
    }
}

/// The transaction identifier on the wire: that of the TCP frame in which the request
/// was sent last. The client chooses it, another one for each frame, also for a retry.
///
/// @param request  a request, pending or ended
/// @return the identifier; 0 in other framings, for a request that was never sent, and
///         for NULL. 0 is also an identifier
#[no_mangle]
pub unsafe extern "C" fn mbm_client_wireTransaction(request: *const mbm_clientRequest) -> u16 {
    // SAFETY: as the header demands: NULL, or a request that is zeroed or was used.
    unsafe { Lent::new(request.cast_mut()).map_or(0, |request| request.ticket().wire()) }
}
