//! The state of one run: memory, the choices of the input, time, and the calls that have not
//! returned yet.

use super::ports::Port;
use mbm_c::*;
use std::alloc::{alloc_zeroed, dealloc, Layout};
use std::cell::{Cell, RefCell};
use std::sync::atomic::{AtomicBool, AtomicPtr, AtomicU64, Ordering};

/// The number of API calls of all inputs so far.
pub static CALLS: AtomicU64 = AtomicU64::new(0);
/// Whether to print each call with its arguments and its return value.
pub static TRACE: AtomicBool = AtomicBool::new(false);
/// The state of the current run. Hooks use it because their context may be NULL.
static CURRENT: AtomicPtr<World> = AtomicPtr::new(std::ptr::null_mut());

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

/// Objects of one type, each in its own block of the heap.
pub struct Pool<T>(RefCell<Vec<*mut T>>);

impl<T> Pool<T> {
    pub const fn new() -> Self {
        Pool(RefCell::new(Vec::new()))
    }

    /// All objects.
    pub fn all(&self) -> Vec<*mut T> {
        self.0.borrow().clone()
    }

    /// One of the objects, a new zeroed one, a copy of one, or NULL.
    pub fn pick(&self, w: &World) -> *mut T {
        let choice = w.byte();
        let count = self.0.borrow().len();
        match choice {
            0xF8.. => std::ptr::null_mut(),
            0xF4..0xF8 if count > 0 && count < 8 => self.copy(w),
            0xF0..0xF4 if count < 6 => self.make(w),
            _ if count == 0 => self.make(w),
            _ => self.0.borrow()[usize::from(choice) % count],
        }
    }

    /// Adds a zeroed object.
    pub fn make(&self, w: &World) -> *mut T {
        let new = w.zeroed::<T>();
        self.0.borrow_mut().push(new);
        new
    }

    /// The newest object, or NULL.
    pub fn any(&self) -> *mut T {
        self.0
            .borrow()
            .last()
            .copied()
            .unwrap_or(std::ptr::null_mut())
    }

    /// Adds an object, up to 64.
    pub fn keep(&self, other: *mut T) {
        let mut all = self.0.borrow_mut();
        if all.len() < 64 {
            all.push(other);
        }
    }

    /// Adds a copy of one of the objects.
    fn copy(&self, w: &World) -> *mut T {
        let from = {
            let all = self.0.borrow();
            all[w.below(all.len())]
        };
        let new = self.make(w);
        w.note(|| format!("memcpy({new:?}, {from:?}, {})", size_of::<T>()));
        // SAFETY: both blocks have this size.
        unsafe { std::ptr::copy_nonoverlapping(from, new, 1) };
        new
    }
}

/// The state of one run.
pub struct World {
    input: Cell<&'static [u8]>,
    seed: Cell<u64>,
    /// How many random steps follow after the end of the input.
    more: Cell<u32>,
    depth: Cell<u32>,
    hook_calls: Cell<u32>,
    calls: Cell<u32>,
    /// The number of API calls made by hooks.
    pub inner_calls: Cell<u32>,
    pub clock: Cell<u32>,
    /// If set, the user also zeroes and refills objects that the library is using.
    pub wild: bool,
    blocks: RefCell<Vec<(*mut u8, Layout)>>,
    frames: RefCell<Vec<Frame>>,
    pub ports: [Port; 4],
    pub masters: Pool<mbm_master>,
    turn: Cell<*mut mbm_turn>,
    pub clients: Pool<mbm_client>,
    /// Clients whose port a master uses, or used when it was copied.
    pub lenders: RefCell<Vec<*mut mbm_client>>,
    pub requests: Pool<mbm_clientRequest>,
    pub servers: Pool<mbm_server>,
    pub sniffers: Pool<mbm_sniffer>,
    pub rings: Pool<mbm_ring>,
    pub events: Pool<mbm_event>,
    pub views: Pool<mbm_registers>,
    pub packets: Pool<mbm_packet>,
    /// Arrays of units, and their lengths.
    pub units: RefCell<Vec<(*mut mbm_unit, u8)>>,
    pub records: super::records::Records,
    /// Buffers that an object uses. Sometimes a second object gets the same one.
    pub lent: RefCell<Vec<(*mut u8, usize)>>,
    /// The unit that answers clients' requests over the ports.
    pub device: Cell<*mut mbm_unit>,
}

impl World {
    /// The state for an input, which must outlive it.
    pub fn new(data: &[u8]) -> Box<World> {
        // SAFETY: `run` drops the world before the input.
        let data: &'static [u8] = unsafe { std::mem::transmute(data) };
        let (head, input) = data.split_at(data.len().min(2));
        let seed = head.iter().fold(0x9E37_79B9_7F4A_7C15, |seed: u64, byte| {
            seed.rotate_left(8) ^ u64::from(*byte)
        });
        let world = Box::new(World {
            input: Cell::new(input),
            seed: Cell::new(seed),
            more: Cell::new((seed as u32 >> 3 & 3) * 50),
            depth: Cell::new(0),
            hook_calls: Cell::new(0),
            calls: Cell::new(0),
            inner_calls: Cell::new(0),
            clock: Cell::new(if seed & 4 == 0 {
                1000
            } else {
                0u32.wrapping_sub(100_000)
            }),
            wild: seed & 3 == 3,
            blocks: RefCell::default(),
            frames: RefCell::default(),
            ports: std::array::from_fn(Port::new),
            masters: Pool::new(),
            turn: Cell::new(std::ptr::null_mut()),
            clients: Pool::new(),
            lenders: RefCell::default(),
            requests: Pool::new(),
            servers: Pool::new(),
            sniffers: Pool::new(),
            rings: Pool::new(),
            events: Pool::new(),
            views: Pool::new(),
            packets: Pool::new(),
            units: RefCell::default(),
            records: Default::default(),
            lent: RefCell::default(),
            device: Cell::new(std::ptr::null_mut()),
        });
        CURRENT.store((&raw const *world).cast_mut(), Ordering::Relaxed);
        world
    }

    /// The state of the current run, for hooks.
    pub fn current<'a>() -> &'a World {
        // SAFETY: hooks run only while `run` holds a world.
        unsafe { &*CURRENT.load(Ordering::Relaxed) }
    }

    /// True if the run is over. Random steps follow after the end of the input.
    pub fn is_over(&self) -> bool {
        let over = self.input.get().is_empty();
        if over && self.more.get() > 0 {
            self.more.set(self.more.get() - 1);
            return self.calls.get() >= MOST_CALLS;
        }
        over || self.calls.get() >= MOST_CALLS
    }

    /// The next byte of the input. After its end, and in hooks, a random byte: hooks are called
    /// so often that they would use up the input.
    pub fn byte(&self) -> u8 {
        if self.depth.get() > 0 {
            return self.random() as u8;
        }
        match self.input.get().split_first() {
            Some((first, rest)) => {
                self.input.set(rest);
                *first
            }
            None => self.random() as u8,
        }
    }

    /// A pseudo-random number; the sequence depends on the input.
    pub fn random(&self) -> u32 {
        let mut seed = self.seed.get();
        seed ^= seed << 13;
        seed ^= seed >> 7;
        seed ^= seed << 17;
        self.seed.set(seed);
        (seed >> 24) as u32
    }

    /// A number below `count`.
    pub fn below(&self, count: usize) -> usize {
        if count > 256 {
            usize::from(u16::from_be_bytes([self.byte(), self.byte()])) % count
        } else {
            usize::from(self.byte()) % count
        }
    }

    /// True with a probability of 1 in `times` (at most 256).
    pub fn rarely(&self, times: usize) -> bool {
        self.below(times) == times - 1
    }

    /// A number of 16 bits: most often small, or near a limit.
    pub fn word(&self) -> u16 {
        let byte = self.byte();
        match byte {
            0..0xA0 => u16::from(byte) % 40,
            0xA0..0xC0 => u16::from(self.byte()),
            0xC0..0xE0 => u16::from_be_bytes([self.byte(), self.byte()]),
            _ => {
                const EDGES: [u16; 16] = [
                    0xFFFF, 0xFFFE, 0x8000, 0x7FFF, 0x7FFE, 0x0100, 0x00FF, 253, 256, 257, 260,
                    513, 2000, 2001, 125, 126,
                ];
                EDGES[usize::from(byte % 16)]
            }
        }
    }

    /// A number of 32 bits.
    pub fn long(&self) -> u32 {
        match self.byte() % 8 {
            0 => u32::MAX,
            1 => u32::MAX - u32::from(self.byte()),
            2 => 1 << (self.byte() % 32),
            3 => self.random(),
            _ => self.word().into(),
        }
    }

    /// The object through which masters take turns; sometimes NULL.
    pub fn turn(&self, byte: u8) -> *mut mbm_turn {
        if byte >= 0xF0 {
            return std::ptr::null_mut();
        }
        if self.turn.get().is_null() {
            self.turn.set(self.zeroed());
        }
        self.turn.get()
    }

    /// A zeroed block of the heap of exactly this size. For size 0, the end of a block.
    pub fn block(&self, size: usize, align: usize) -> *mut u8 {
        let used = if size == 0 { align } else { size };
        let layout = Layout::from_size_align(used, align).expect("a layout");
        // SAFETY: the size is not 0.
        let block = unsafe { alloc_zeroed(layout) };
        self.blocks.borrow_mut().push((block, layout));
        if size == 0 {
            block.wrapping_add(align)
        } else {
            block
        }
    }

    /// A zeroed block for a `T`.
    pub fn zeroed<T>(&self) -> *mut T {
        self.block(size_of::<T>(), align_of::<T>()).cast()
    }

    /// A block with this value.
    pub fn put<T>(&self, value: T) -> *mut T {
        let place = self.zeroed::<T>();
        // SAFETY: the block has the size of a `T`.
        unsafe { place.write(value) };
        place
    }

    /// A block for a `T`, filled with 0xA5. The bytes that a call does not write keep it.
    pub fn unset<T>(&self) -> *mut T {
        let place = self.zeroed::<T>();
        // SAFETY: of this size.
        unsafe { place.cast::<u8>().write_bytes(0xA5, size_of::<T>()) };
        place
    }

    /// Like `unset`, for `count` bytes.
    pub fn unset_bytes(&self, count: usize) -> *mut u8 {
        let place = self.block(count, 8);
        // SAFETY: of this size.
        unsafe { place.write_bytes(0xA5, count) };
        place
    }

    /// A block with these items.
    pub fn array<T>(&self, items: &[T]) -> *mut T {
        let place: *mut T = self.block(size_of_val(items), align_of::<T>()).cast();
        // SAFETY: the block has the size of the items; both are valid.
        unsafe { std::ptr::copy_nonoverlapping(items.as_ptr(), place, items.len()) };
        place
    }

    /// A block of `count` bytes with any content.
    pub fn noise(&self, count: usize) -> *mut u8 {
        let place = self.block(count, 2);
        let step = self.byte();
        // SAFETY: the block has this size. Only the first 300 bytes are filled, to save time.
        let bytes = unsafe { std::slice::from_raw_parts_mut(place, count) };
        for (at, byte) in bytes.iter_mut().take(300).enumerate() {
            *byte = step.wrapping_mul(at as u8);
        }
        place
    }

    /// A buffer for an object to keep: a new one, one that another object uses, or NULL.
    pub fn buffer(&self, count: usize) -> *mut u8 {
        if self.rarely(16) {
            let all = self.lent.borrow();
            let fits: Vec<_> = all.iter().filter(|(_, size)| *size >= count).collect();
            if !fits.is_empty() {
                return fits[self.below(fits.len())].0;
            }
        }
        if self.rarely(48) {
            return std::ptr::null_mut();
        }
        let place = self.noise(count);
        self.lent.borrow_mut().push((place, count));
        place
    }

    /// Prints a line if the run is traced.
    pub fn note(&self, text: impl FnOnce() -> String) {
        if TRACE.load(Ordering::Relaxed) {
            let indent = "    ".repeat(self.depth.get() as usize);
            eprintln!("{indent}{}", text());
        }
    }

    /// True if a hook is running that may do nothing with the object.
    pub fn is_locked(&self, object: *const u8) -> bool {
        let frames = self.frames.borrow();
        let mut own = frames.iter().filter(|frame| frame.object == object);
        !object.is_null() && own.any(|frame| frame.grant.get() == Grant::Nothing)
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
        self.inside(grant, || super::step(self));
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

impl Drop for World {
    fn drop(&mut self) {
        for (block, layout) in self.blocks.borrow().iter() {
            // SAFETY: the block was allocated with this layout, and nothing uses it any more.
            unsafe { dealloc(*block, *layout) };
        }
    }
}
