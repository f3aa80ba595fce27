//! The memory and the choices of one run: blocks of the heap, and numbers that the input decides.

use std::alloc::{alloc_zeroed, dealloc, Layout};
use std::cell::{Cell, RefCell};
use std::sync::atomic::{AtomicBool, Ordering};

/// Whether to print each call with its arguments and its return value.
pub static TRACE: AtomicBool = AtomicBool::new(false);

/// Blocks of the heap, and the choices of the input.
pub struct Memory {
    input: Cell<&'static [u8]>,
    seed: Cell<u64>,
    /// How many random steps follow after the end of the input.
    more: Cell<u32>,
    /// How many hooks are running, one within the other.
    pub depth: Cell<u32>,
    blocks: RefCell<Vec<(*mut u8, Layout)>>,
    /// Buffers that an object uses. Sometimes a second object gets the same one.
    pub lent: RefCell<Vec<(*mut u8, usize)>>,
}

impl Memory {
    /// Memory without blocks; `seed` decides the random numbers.
    pub fn new(input: &'static [u8], seed: u64) -> Memory {
        Memory {
            input: Cell::new(input),
            seed: Cell::new(seed),
            more: Cell::new((seed as u32 >> 3 & 3) * 50),
            depth: Cell::new(0),
            blocks: RefCell::default(),
            lent: RefCell::default(),
        }
    }

    /// True if the input has been used up. Random steps follow after its end.
    pub fn is_used_up(&self) -> bool {
        let over = self.input.get().is_empty();
        if over && self.more.get() > 0 {
            self.more.set(self.more.get() - 1);
            return false;
        }
        over
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

    /// NULL with a probability of 1 in `times`, or what `make` makes.
    pub fn null_or<T>(&self, times: usize, make: impl FnOnce() -> *mut T) -> *mut T {
        match self.rarely(times) {
            true => std::ptr::null_mut(),
            false => make(),
        }
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

    /// A unit id, most often a small one, which a unit may have.
    pub fn unit_id(&self) -> u8 {
        match self.byte() {
            byte @ 0..0xE0 => byte % 4,
            byte => byte,
        }
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
}

impl Drop for Memory {
    fn drop(&mut self) {
        for (block, layout) in self.blocks.borrow().iter() {
            // SAFETY: the block was allocated with this layout, and nothing uses it any more.
            unsafe { dealloc(*block, *layout) };
        }
    }
}
