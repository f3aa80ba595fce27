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
use crate::client::{Client, Job, Line, Means, Policy, Serial, Tcp, Unit};
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
    pointers: [*mut c_void; 47],
    /// Not for you.
    words: [u32; 18],
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
/// mbm_client_begin function names.
struct Calls {
    poll: fn(&mut Object, u32, bool) -> Option<Lent>,
    queue: fn(&mut Object, Lent) -> Status,
    act: fn(&mut Object, Action, u32) -> u32,
    parts: fn(&mut Object) -> Parts<'_>,
}

/// What is done to a client seldom.
enum Action {
    /// Gives the request up: 1 if it was pending.
    Cancel(Lent),
    /// How long poll will find nothing to do.
    Delay,
    /// How many requests are pending.
    Pending,
    /// 1 if the link is not known to be lost.
    IsConnected,
    /// Takes the link for a new one.
    Reconnect,
    /// 1 if the line was lent.
    Lend,
    /// 1 while the line is lent.
    IsLent,
    TakeBack,
}

/// The parts of a client that settings reach.
struct Parts<'a> {
    settings: &'a mut Settings,
    means: &'a mut LentByC,
    port: &'a mut mbm_port,
    policy: &'a mut Policy,
}

/// A kind of line that C has.
trait Kind: Line<Lent> + Sized + 'static {
    fn parts(&mut self) -> (&mut Settings, &mut LentByC, &mut mbm_port);

    const CALLS: Calls = Calls {
        poll: poll::<Self>,
        queue: queue::<Self>,
        act: act::<Self>,
        parts: parts::<Self>,
    };
}

impl<W: Search + 'static> Kind for Serial<mbm_port, LentByC, Lent, W> {
    fn parts(&mut self) -> (&mut Settings, &mut LentByC, &mut mbm_port) {
        let engine = self.transaction();
        (&mut engine.settings, &mut engine.storage, &mut engine.port)
    }
}

impl Kind for Tcp<mbm_port, LentByC> {
    fn parts(&mut self) -> (&mut Settings, &mut LentByC, &mut mbm_port) {
        (&mut self.settings, &mut self.means, &mut self.port)
    }
}

/// The client in an object, whose calls are those of `L`.
fn client<L>(object: &mut Object) -> &mut Client<L, Lent, DEPTH> {
    // SAFETY: a begun object has the client in it that its calls are for.
    unsafe { &mut *(&raw mut object.client).cast() }
}

fn poll<L: Kind>(object: &mut Object, now: u32, fresh: bool) -> Option<Lent> {
    client::<L>(object).poll(now, fresh)
}

fn queue<L: Kind>(object: &mut Object, request: Lent) -> Status {
    match client::<L>(object).queue(request) {
        Ok(()) => Status::PENDING,
        Err(refused) => refused.ticket().status,
    }
}

fn act<L: Kind>(object: &mut Object, action: Action, now: u32) -> u32 {
    let client = client::<L>(object);
    match action {
        Action::Cancel(request) => client.cancel(|job| *job == request).is_some().into(),
        Action::Delay => client.poll_delay(now),
        Action::Pending => client.pending() as u32,
        Action::IsConnected => client.is_connected().into(),
        Action::Reconnect => {
            client.reconnect();
            0
        }
        Action::Lend => client.lend().into(),
        Action::IsLent => client.is_lent().into(),
        Action::TakeBack => {
            client.take_back();
            0
        }
    }
}

fn parts<L: Kind>(object: &mut Object) -> Parts<'_> {
    let (policy, line) = client::<L>(object).parts();
    let (settings, means, port) = line.parts();
    Parts {
        settings,
        means,
        port,
        policy,
    }
}

/// What the begin functions and settings lend.
#[repr(C)]
struct LentByC {
    frame: *mut u8,
    outgoing: *mut u8,
    counters: *mut mbm_counters,
    units: *mut Unit,
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
        if self.outgoing.is_null() {
            return &mut [];
        }
        // SAFETY: see above.
        unsafe { from_raw_parts_mut(self.outgoing, self.outgoing_bytes.into()) }
    }

    fn units(&mut self) -> &mut [Unit] {
        if self.units.is_null() {
            return &mut [];
        }
        // SAFETY: see above.
        unsafe { from_raw_parts_mut(self.units, self.unit_count.into()) }
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
        let calls = object.calls();
        if object.polling || (calls.act)(object, Action::IsLent, 0) != 0 {
            return Status::BUSY.code();
        }
        object.polling = true;
        let now = (calls.parts)(object).port.micros();
        for round in 0..=MBM_CLIENT_DEPTH {
            match (calls.poll)(pointers::object(client), now, round == 0) {
                Some(request) => request.call(),
                None => break,
            }
        }
        let object = pointers::object(client);
        object.polling = false;
        if (calls.act)(object, Action::Pending, 0) == 0 {
            Status::OK.code()
        } else {
            Status::PENDING.code()
        }
    }
}

/// How long mbm_client_poll will find nothing to do unless a byte arrives, so
/// that a program may wait for one in select, or sleep, until then.
///
/// @param client  the object
/// @return microseconds; 0 means poll now, 0xFFFFFFFF that there is no request
#[no_mangle]
pub unsafe extern "C" fn mbm_client_pollDelay(client: *const mbm_client) -> u32 {
    // SAFETY: as the header demands.
    unsafe {
        pointers::ask(client, u32::MAX, |object| {
            let now = (object.calls().parts)(object).port.micros();
            (object.calls().act)(object, Action::Delay, now)
        })
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
        pointers::ask(client, 0, |object| {
            (object.calls().act)(object, Action::Pending, 0) as u8
        })
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
            Some(request) => match (object.calls().act)(object, Action::Cancel(request), 0) {
                0 => Status::NOT_PENDING,
                _ => Status::OK,
            },
        })
    }
}
