//! The state of one life: its lines, requests, masters, plan and gateway, and what they have
//! pending.

use super::bound::Limits;
use crate::api::world::World;
use mbm_c::*;
use std::cell::{Cell, RefCell};
use std::collections::{BTreeMap, BTreeSet, VecDeque};

pub const LINES: usize = 3;
pub const JOBS: usize = 24;
/// The first address that stands for a request. Lower addresses are those of the plan.
pub const FIRST_ID: u16 = 0x1000;

thread_local! {
    static CURRENT: Cell<*const Life> = const { Cell::new(std::ptr::null()) };
}

pub const CONNECTIONS: usize = 2;
/// Places for requests.
pub const PLACES: u64 = 6;

pub const FIELDS: usize = 5;
pub const REQUESTS: usize = 2;
/// A client on a line, with its storage.
pub struct Line {
    pub client: Cell<*mut mbm_client>,
    pub link: Cell<*mut mbm_link>,
    pub wire: Wire,
    pub has_link: Cell<bool>,
    /// Requests wait while the link is down.
    pub keeps: Cell<bool>,
    /// A connection is made for any time.
    pub connects_for_ever: Cell<bool>,
    /// The client is suspended, and the index of the master that has its line.
    pub is_suspended: Cell<bool>,
    pub borrower: Cell<Option<usize>>,
    pub limits: Cell<Limits>,
    /// For how long the client could use its line so far, in microseconds.
    pub awake: Cell<u64>,
    /// The buffers of the client. It gets others when it begins again, and these are released.
    pub buffers: RefCell<[Box<[u8]>; 2]>,
}

/// A master that uses the port of a client: a line with two nodes, and its pending request.
pub struct Master {
    pub line: *mut mbm_line,
    pub nodes: [*mut mbm_node; 2],
    pub pending: Cell<Option<(u16, u64)>>,
    /// The index of the node whose request is pending.
    pub asker: Cell<usize>,
    /// The index of the simulated line.
    pub at: Cell<usize>,
}

/// A request of the program.
pub struct Job {
    /// Another one for each request, so that the one before is released.
    pub request: Cell<*mut mbm_clientRequest>,
    /// Its data, and those of the response.
    pub words: RefCell<[Box<[u16]>; 2]>,
    pub line: Cell<usize>,
    pub id: Cell<u16>,
    /// `awake` of the line when it was queued; `None` if it has ended.
    pub since: Cell<Option<u64>>,
}

/// The state of one life.
pub struct Life {
    /// Makes one call or a few that belong together.
    pub step: fn(&Life),
    pub w: Box<World>,
    pub now: Cell<u64>,
    /// What the clock has jumped by, and whether it may jump on.
    pub jumped: Cell<u32>,
    pub may_jump: Cell<bool>,
    pub lines: Vec<Line>,
    pub masters: Vec<Master>,
    pub jobs: Vec<Job>,
    pub gateway: GatewaySide,
    pub plan: PlanSide,
    /// Bytes that no device sent have arrived.
    pub is_forged: Cell<bool>,
    /// The requests that are pending.
    pub live: RefCell<BTreeSet<u16>>,
    pub next_id: Cell<u16>,
    /// How many functions of the program are running, called by the library.
    pub inside: Cell<u32>,
    /// How often in a row nothing was to be waited for.
    pub at_once: Cell<u32>,
}

/// A line, from the client's port to the device.
pub struct Wire {
    pub framing: Cell<u8>,
    /// Bytes can be read and written; or the connection is being made.
    pub is_open: Cell<bool>,
    pub is_opening: Cell<bool>,
    /// The most bytes that the port takes at a time.
    pub takes: Cell<u16>,
    pub flushes: Cell<bool>,
    pub device: Cell<u8>,
    /// The received bytes that the client has not read.
    pub ring: *mut mbm_ring,
    /// The replies that the device will send, and when.
    pub replies: RefCell<VecDeque<(u64, Vec<u8>)>>,
    /// The transaction identifier of the last frame.
    pub transaction: Cell<u16>,
    /// The bytes of a frame that is not complete, and the requests that were pending at its first
    /// byte.
    pub partial: RefCell<Vec<u8>>,
    pub pending: RefCell<BTreeSet<u16>>,
}

/// The other end of a connection.
#[derive(Default)]
pub struct Socket {
    pub is_lost: Cell<bool>,
    pub takes: Cell<u16>,
    /// The requests that the gateway has not read, and its responses that are not whole yet.
    pub inbox: RefCell<VecDeque<u8>>,
    pub responses: RefCell<Vec<u8>>,
    /// The line of each request that was not answered, and `awake` of that line when it was
    /// made.
    pub asked: RefCell<BTreeMap<u16, (usize, u64)>>,
}

/// The gateway and its connections.
pub struct GatewaySide {
    pub gateway: *mut mbm_gateway,
    pub config: *mut mbm_gatewayConfig,
    pub is_begun: Cell<bool>,
    pub sockets: [Socket; CONNECTIONS],
}

/// The plan, and when each field had news last: `awake` of its line.
pub struct PlanSide {
    pub plan: *mut mbm_plan,
    /// With which it divides its reads; NULL if it does not.
    pub splitting: Cell<*mut mbm_planSplitting>,
    /// A bit for each field whose first register the devices lack.
    pub lacks: Cell<u32>,
    pub line: Cell<usize>,
    pub is_begun: Cell<bool>,
    pub news: [Cell<u64>; FIELDS],
}

impl Life {
    /// The state for an input, which must outlive it.
    pub fn new(data: &[u8], step: fn(&Life)) -> Box<Life> {
        let w = World::new(data, |_| {});
        let lines = (0..LINES).map(|_| {
            let (ring, bytes) = (w.zeroed(), w.noise(1024));
            call!(&w, mbm_ring_begin(ring, bytes, 1024));
            Line {
                client: Cell::new(new()),
                link: Cell::new(new()),
                wire: Wire::new(ring),
                has_link: Cell::new(false),
                keeps: Cell::new(false),
                connects_for_ever: Cell::new(false),
                is_suspended: Cell::new(false),
                borrower: Cell::new(None),
                limits: Cell::new(Limits::DEFAULT),
                awake: Cell::new(0),
                buffers: RefCell::default(),
            }
        });
        let masters = (0..2).map(|_| Master {
            line: w.zeroed(),
            nodes: [w.zeroed(), w.zeroed()],
            pending: Cell::new(None),
            asker: Cell::new(0),
            at: Cell::new(0),
        });
        let jobs = (0..JOBS).map(|_| Job {
            request: Cell::new(new()),
            words: RefCell::default(),
            line: Cell::new(0),
            id: Cell::new(0),
            since: Cell::new(None),
        });
        let (lines, masters, jobs) = (lines.collect(), masters.collect(), jobs.collect());
        let (gateway, plan) = (GatewaySide::new(&w), PlanSide::new(&w));
        let life = Box::new(Life {
            step,
            // The clock wraps during the life.
            now: Cell::new(u64::from(u32::MAX) - 3_000_000),
            jumped: Cell::new(0),
            may_jump: Cell::new(w.byte() & 3 == 0),
            lines,
            masters,
            jobs,
            gateway,
            plan,
            is_forged: Cell::new(false),
            live: RefCell::default(),
            next_id: Cell::new(FIRST_ID),
            inside: Cell::new(0),
            at_once: Cell::new(0),
            w,
        });
        CURRENT.set(&raw const *life);
        life
    }

    /// The life that runs, for hooks.
    pub fn current<'a>() -> &'a Life {
        // SAFETY: hooks run only while `run` holds a life.
        unsafe { &*CURRENT.get() }
    }

    /// Any of the lines.
    pub fn line(&self) -> usize {
        usize::from(self.w.byte()) % LINES
    }

    /// The address of the next request.
    pub fn id(&self) -> u16 {
        let id = self.next_id.get();
        self.next_id.set(id + 1);
        id
    }

    /// Notes that a request is pending.
    pub fn begins(&self, id: u16) {
        assert!(self.live.borrow_mut().insert(id));
    }

    /// Notes that a request has ended.
    pub fn ends(&self, id: u16) {
        assert!(
            self.live.borrow_mut().remove(&id),
            "request {id:#x} ended twice"
        );
    }

    /// Runs a function of the program that the library calls.
    pub fn inside(&self, action: impl FnOnce()) {
        self.inside.set(self.inside.get() + 1);
        // From here on, choices are random: the input is for the calls of the program.
        self.w.depth.set(self.w.depth.get() + 1);
        action();
        self.w.depth.set(self.w.depth.get() - 1);
        self.inside.set(self.inside.get() - 1);
    }

    /// Sometimes makes a call from within a function that may call everything but poll.
    pub fn callback(&self) {
        if self.inside.get() < 2 && self.w.random().is_multiple_of(3) {
            self.inside(|| (self.step)(self));
        }
    }

    /// True if the client of a line may use it: the time counts for its requests.
    pub fn is_awake(&self, line: &Line) -> bool {
        let state = call!(&self.w, mbm_link_state(line.link.get()));
        let waits = match state {
            _ if !line.has_link.get() => false,
            MBM_LINK_IS_DOWN => line.keeps.get(),
            MBM_LINK_IS_CONNECTING => line.keeps.get() || line.connects_for_ever.get(),
            _ => false,
        };
        !line.is_suspended.get() && !waits
    }

    /// The master that has a line, if its client is suspended.
    pub fn borrower(&self, wire: &Wire) -> Option<Option<&Master>> {
        let line = self
            .lines
            .iter()
            .find(|line| std::ptr::eq(&line.wire, wire))?;
        let master = || line.borrower.get().map(|index| &self.masters[index]);
        line.is_suspended.get().then(master)
    }

    /// The longest time for which a request of a line may be pending.
    pub fn bound(&self, line: &Line) -> u64 {
        // The queue, a master that had the line before, and the requests of the gateway.
        line.limits
            .get()
            .request(u64::from(MBM_CLIENT_DEPTH) + 2 + PLACES)
    }
}

impl Drop for Life {
    fn drop(&mut self) {
        for line in &self.lines {
            // SAFETY: `new` made them; nothing uses them any more.
            unsafe {
                drop(Box::from_raw(line.client.get()));
                drop(Box::from_raw(line.link.get()));
            }
        }
        for job in &self.jobs {
            // SAFETY: as above.
            drop(unsafe { Box::from_raw(job.request.get()) });
        }
    }
}

/// A zeroed object on the heap, which ends before the life does.
pub fn new<T>() -> *mut T {
    // SAFETY: zero is a valid value of every object.
    Box::into_raw(Box::new(unsafe { std::mem::zeroed() }))
}

impl Wire {
    pub fn new(ring: *mut mbm_ring) -> Wire {
        Wire {
            framing: Cell::new(0),
            is_open: Cell::new(true),
            is_opening: Cell::new(false),
            takes: Cell::new(u16::MAX),
            flushes: Cell::new(true),
            device: Cell::new(0),
            ring,
            replies: RefCell::default(),
            transaction: Cell::new(0),
            partial: RefCell::default(),
            pending: RefCell::default(),
        }
    }
}

impl GatewaySide {
    pub fn new(w: &World) -> GatewaySide {
        GatewaySide {
            gateway: w.zeroed(),
            config: w.zeroed(),
            is_begun: Cell::new(false),
            sockets: Default::default(),
        }
    }

    pub fn is_begun(&self) -> bool {
        self.is_begun.get()
    }
}

impl PlanSide {
    pub fn new(w: &World) -> PlanSide {
        PlanSide {
            plan: w.zeroed(),
            splitting: Cell::new(std::ptr::null_mut()),
            lacks: Cell::new(0),
            line: Cell::new(0),
            is_begun: Cell::new(false),
            news: Default::default(),
        }
    }

    /// True if the plan uses this client.
    pub fn has(&self, client: *mut mbm_client) -> bool {
        let line = &Life::current().lines[self.line.get()];
        self.is_begun.get() && line.client.get() == client
    }
}
