//! The state of one run: memory, objects, time, and the calls that have not returned yet.

use super::memory::Memory;
use super::pool::{Pool, Records};
use super::port::Port;
use mbm_c::*;
use std::cell::{Cell, RefCell};
use std::collections::HashMap;
use std::ops::Deref;
use std::sync::atomic::{AtomicU64, Ordering};

/// The number of API calls of all inputs so far.
pub static CALLS: AtomicU64 = AtomicU64::new(0);

thread_local! {
    /// The state of the current run. Hooks use it because their context may be NULL.
    static CURRENT: Cell<*const World> = const { Cell::new(std::ptr::null()) };
}

/// The greatest number of hook calls within one call at the top level. A call that makes more
/// is assumed never to end.
const MOST_HOOKS: u32 = 300_000;
/// The greatest number of API calls of one input. It limits the time of a run.
const MOST_CALLS: u32 = 4_000;

/// What a hook may do with the object whose call it interrupts.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Grant {
    /// Nothing: calls are refused.
    Nothing,
    /// Everything.
    All,
}

/// A call that has not returned yet.
struct Frame {
    object: *const u8,
    grant: Cell<Grant>,
}

/// The state of one run.
pub struct World {
    /// Makes one step. Hooks make steps too.
    step: fn(&World),
    memory: Memory,
    hook_calls: Cell<u32>,
    calls: Cell<u32>,
    /// The number of API calls made by hooks.
    pub inner_calls: Cell<u32>,
    pub clock: Cell<u32>,
    /// If set, the user also zeroes and refills objects that the library is using.
    pub wild: bool,
    frames: RefCell<Vec<Frame>>,
    pub ports: [Port; 4],
    pub lines: Pool<mbm_line>,
    pub nodes: Pool<mbm_node>,
    /// The line of each node that was begun.
    line_of: RefCell<HashMap<*const u8, *mut mbm_line>>,
    pub clients: Pool<mbm_client>,
    pub plans: Pool<mbm_plan>,
    /// Clients whose port a line uses, or used when it was copied.
    pub lenders: RefCell<Vec<*mut mbm_client>>,
    /// Clients with their links. They are not copied.
    pub linked: RefCell<Vec<(*mut mbm_client, *mut mbm_link)>>,
    pub requests: Pool<mbm_clientRequest>,
    pub identifications: Pool<mbm_identification>,
    pub servers: Pool<mbm_server>,
    pub gateways: Pool<mbm_gateway>,
    /// The configs of all gateways so far.
    pub configs: RefCell<Vec<mbm_gatewayConfig>>,
    pub sniffers: Pool<mbm_sniffer>,
    pub rings: Pool<mbm_ring>,
    pub dma_rings: Pool<mbm_dmaRing>,
    pub traces: Pool<mbm_trace>,
    pub events: Pool<mbm_event>,
    pub views: Pool<mbm_registers>,
    pub packets: Pool<mbm_packet>,
    /// Arrays of units, and their lengths.
    pub units: RefCell<Vec<(*mut mbm_unit, u8)>>,
    pub records: Records,
    /// The unit that answers clients' requests over the ports.
    pub device: Cell<*mut mbm_unit>,
}

impl World {
    /// The state for an input, which must outlive it.
    pub fn new(data: &[u8], step: fn(&World)) -> Box<World> {
        // SAFETY: `run` drops the world before the input.
        let data: &'static [u8] = unsafe { std::mem::transmute(data) };
        let (head, input) = data.split_at(data.len().min(2));
        let seed = head.iter().fold(0x9E37_79B9_7F4A_7C15, |seed: u64, byte| {
            seed.rotate_left(8) ^ u64::from(*byte)
        });
        let world = Box::new(World {
            step,
            memory: Memory::new(input, seed),
            hook_calls: Cell::new(0),
            calls: Cell::new(0),
            inner_calls: Cell::new(0),
            clock: Cell::new(if seed & 4 == 0 {
                1000
            } else {
                0u32.wrapping_sub(100_000)
            }),
            wild: seed & 3 == 3,
            frames: RefCell::default(),
            ports: std::array::from_fn(Port::new),
            lines: Pool::new(),
            nodes: Pool::new(),
            line_of: RefCell::default(),
            clients: Pool::new(),
            plans: Pool::new(),
            lenders: RefCell::default(),
            linked: RefCell::default(),
            requests: Pool::new(),
            identifications: Pool::new(),
            servers: Pool::new(),
            gateways: Pool::new(),
            configs: RefCell::default(),
            sniffers: Pool::new(),
            rings: Pool::new(),
            dma_rings: Pool::new(),
            traces: Pool::new(),
            events: Pool::new(),
            views: Pool::new(),
            packets: Pool::new(),
            units: RefCell::default(),
            records: Default::default(),
            device: Cell::new(std::ptr::null_mut()),
        });
        CURRENT.set(&raw const *world);
        world
    }

    /// The state of the current run, for hooks.
    pub fn current<'a>() -> &'a World {
        // SAFETY: hooks run only while `run` holds a world.
        unsafe { &*CURRENT.get() }
    }

    /// True if the run is over.
    pub fn is_over(&self) -> bool {
        self.is_used_up() || self.calls.get() >= MOST_CALLS
    }

    /// The line of a node; NULL if the node was not begun.
    pub fn line_of(&self, node: *const mbm_node) -> *mut mbm_line {
        self.line_of_object(node.cast())
    }

    fn line_of_object(&self, object: *const u8) -> *mut mbm_line {
        let lines = self.line_of.borrow();
        lines.get(&object).copied().unwrap_or(std::ptr::null_mut())
    }

    /// The node on whose behalf the running hook was called, if there is one. Chosen by some of
    /// the steps in hooks, which would rarely pick it.
    pub fn calling_node(&self) -> Option<*mut mbm_node> {
        if !self.is_inside() || self.random().is_multiple_of(2) {
            return None;
        }
        let object = self.frames.borrow().last()?.object;
        let mut nodes = self.nodes.all().into_iter();
        nodes.find(|node| node.cast_const().cast() == object)
    }

    /// Notes that a node was begun on a line, or on none.
    pub fn set_line_of(&self, node: *const mbm_node, line: *mut mbm_line) {
        self.line_of.borrow_mut().insert(node.cast(), line);
    }

    /// True if a hook is running that may do nothing with the object. A call of a node keeps its
    /// line, too.
    pub fn is_locked(&self, object: *const u8) -> bool {
        let frames = self.frames.borrow();
        let mut own = frames.iter().filter(|frame| {
            frame.object == object
                || self.line_of_object(frame.object).cast_const().cast() == object
        });
        !object.is_null() && own.any(|frame| frame.grant.get() == Grant::Nothing)
    }

    /// True if no call is running, or only such whose hooks may do everything.
    pub fn is_free(&self) -> bool {
        let frames = self.frames.borrow();
        frames.iter().all(|frame| frame.grant.get() == Grant::All)
    }

    /// True if a hook is running.
    pub fn is_inside(&self) -> bool {
        self.depth.get() > 0
    }

    /// Called before each API call.
    pub fn before<T>(&self, object: *const T) {
        CALLS.fetch_add(1, Ordering::Relaxed);
        self.calls.set(self.calls.get() + 1);
        if self.depth.get() == 0 {
            self.hook_calls.set(0);
        } else {
            self.inner_calls.set(self.inner_calls.get() + 1);
        }
        self.frames.borrow_mut().push(Frame {
            object: object.cast(),
            grant: Cell::new(Grant::Nothing),
        });
    }

    /// Called after each API call.
    pub fn after(&self) {
        self.frames.borrow_mut().pop();
    }

    /// The number of hook calls within the current call at the top level.
    pub fn hooks(&self) -> u32 {
        self.hook_calls.get()
    }

    /// Called by each hook: counts the call, and sometimes calls the API.
    pub fn hook(&self, grant: Grant, times: u32) {
        let calls = self.hook_calls.get() + 1;
        self.hook_calls.set(calls);
        assert!(calls < MOST_HOOKS, "a call does not end");
        // With a probability of 1 in `times`, which falls with the number of hook calls.
        let scarce = times
            .saturating_mul(1 + self.depth.get())
            .saturating_add(calls / 8);
        let over = self.depth.get() > 2 || self.calls.get() >= MOST_CALLS;
        if over || !self.random().is_multiple_of(scarce) {
            return;
        }
        self.inside(grant, || (self.step)(self));
    }

    /// Runs `action` as a hook.
    pub fn inside<T>(&self, grant: Grant, action: impl FnOnce() -> T) -> T {
        let top = self.frames.borrow().len() - 1;
        let was = self.frames.borrow()[top].grant.replace(grant);
        self.depth.set(self.depth.get() + 1);
        let done = action();
        self.depth.set(self.depth.get() - 1);
        self.frames.borrow()[top].grant.set(was);
        done
    }
}

impl Deref for World {
    type Target = Memory;

    fn deref(&self) -> &Memory {
        &self.memory
    }
}
