//! Pools of objects, one for each type.

use super::memory::Memory;
use mbm_c::*;
use std::cell::{Cell, RefCell};

/// Objects of one type, each in its own block of the heap.
pub struct Pool<T> {
    all: RefCell<Vec<*mut T>>,
    /// The last object that was copied, and its copy.
    last_copy: Cell<Option<(*mut T, *mut T)>>,
}

impl<T> Pool<T> {
    pub const fn new() -> Self {
        Pool {
            all: RefCell::new(Vec::new()),
            last_copy: Cell::new(None),
        }
    }

    /// All objects.
    pub fn all(&self) -> Vec<*mut T> {
        self.all.borrow().clone()
    }

    /// One of the objects, a new zeroed one, a copy of one, or NULL.
    pub fn pick(&self, memory: &Memory) -> *mut T {
        let choice = memory.byte();
        let count = self.all.borrow().len();
        match choice {
            0xF8.. => std::ptr::null_mut(),
            0xF4..0xF8 if count > 0 && count < 8 => self.copy(memory),
            0xF0..0xF4 if count < 6 => self.make(memory),
            _ if count == 0 => self.make(memory),
            _ => self.all.borrow()[usize::from(choice) % count],
        }
    }

    /// Adds a zeroed object.
    pub fn make(&self, memory: &Memory) -> *mut T {
        let new = memory.zeroed::<T>();
        self.all.borrow_mut().push(new);
        new
    }

    /// The newest object, or NULL.
    pub fn any(&self) -> *mut T {
        self.all
            .borrow()
            .last()
            .copied()
            .unwrap_or(std::ptr::null_mut())
    }

    /// Adds an object, up to 64.
    pub fn keep(&self, other: *mut T) {
        let mut all = self.all.borrow_mut();
        if all.len() < 64 {
            all.push(other);
        }
    }

    /// The object that was copied since the last call, and its copy.
    pub fn take_copy(&self) -> Option<(*mut T, *mut T)> {
        self.last_copy.take()
    }

    /// Adds a copy of one of the objects.
    fn copy(&self, memory: &Memory) -> *mut T {
        let from = {
            let all = self.all.borrow();
            all[memory.below(all.len())]
        };
        let new = self.make(memory);
        memory.note(|| format!("memcpy({new:?}, {from:?}, {})", size_of::<T>()));
        // SAFETY: both blocks have this size.
        unsafe { std::ptr::copy_nonoverlapping(from, new, 1) };
        self.last_copy.set(Some((from, new)));
        new
    }
}

/// All records of an input.
pub struct Records {
    pub registers: Pool<mbm_registerTable>,
    pub bits: Pool<mbm_bitTable>,
    pub cells: Pool<mbm_dataCallbacks>,
    pub customs: Pool<mbm_custom>,
    pub switches: Pool<mbm_functionMask>,
    pub diagnostics: Pool<mbm_diagnostics>,
    pub files: Pool<mbm_files>,
    pub fifos: Pool<mbm_fifos>,
    pub outputs: Pool<mbm_exceptionStatus>,
    pub ids: Pool<mbm_serverId>,
    pub identifications: Pool<mbm_serverIdentification>,
}

impl Default for Records {
    fn default() -> Self {
        Records {
            registers: Pool::new(),
            bits: Pool::new(),
            cells: Pool::new(),
            customs: Pool::new(),
            switches: Pool::new(),
            diagnostics: Pool::new(),
            files: Pool::new(),
            fifos: Pool::new(),
            outputs: Pool::new(),
            ids: Pool::new(),
            identifications: Pool::new(),
        }
    }
}
