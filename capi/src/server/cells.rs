//! Cells of a table: moved one by one, and many at a time, as a host does.

use core::slice::from_raw_parts_mut;
use mbm::bytes::copy_words;
use mbm::server::table::{MachineByte, TableKind};

/// True if so many bits of a bitmap are 1.
///
/// # Safety
/// The bitmap has them, and there is one at least.
#[cfg_attr(target_os = "none", inline(always))]
#[cfg_attr(not(target_os = "none"), inline(never))]
pub(super) unsafe fn are_all_on(map: *const u8, first: usize, quantity: usize) -> bool {
    // SAFETY: as the caller promises.
    unsafe {
        let mut bit = Place::of_cells(map.cast_mut(), TableKind::COILS, first);
        let mut left = quantity;
        loop {
            if MachineByte::from(*bit.byte) & bit.mask == 0 {
                return false;
            }
            bit.step();
            left -= 1;
            if left == 0 {
                return true;
            }
        }
    }
}

/// Where a bit stands, or with an empty mask a register.
#[derive(Clone, Copy)]
pub(super) struct Place {
    pub(super) byte: *mut u8,
    mask: MachineByte,
}

impl Place {
    /// The cell with this index.
    ///
    /// # Safety
    /// There is one.
    #[inline(always)]
    pub(super) unsafe fn of_cells(cells: *mut u8, kind: TableKind, index: usize) -> Place {
        // SAFETY: as the caller promises.
        unsafe {
            if kind.is_bits() {
                let (byte, mask) = (cells.add(index >> 3), 1 << (index & 7));
                Place { byte, mask }
            } else {
                let byte = cells.add(2 * index);
                Place { byte, mask: 0 }
            }
        }
    }

    /// The first of data.
    #[inline(always)]
    pub(super) fn of_data(byte: *mut u8, kind: TableKind) -> Place {
        let mask = kind.is_bits().into();
        Place { byte, mask }
    }

    /// Becomes the next bit.
    #[inline(always)]
    #[allow(clippy::unnecessary_cast)] // It is needed on an AVR.
    fn step(&mut self) {
        let next = self.mask >> 7;
        self.mask = (self.mask << 1 | next) & 0xFF;
        self.byte = self.byte.wrapping_add(next as usize);
    }
}

/// Moves so many cells.
///
/// # Safety
/// There are so many at both; nothing else uses them meanwhile.
#[cfg_attr(target_os = "none", inline(never))]
pub(super) unsafe fn transfer(mut from: Place, mut to: Place, mut left: usize) {
    // SAFETY: as the caller promises.
    unsafe {
        loop {
            if from.mask == 0 {
                // From one order of bytes to the other, whichever is which.
                let high = usize::from(cfg!(target_endian = "little"));
                *to.byte = *from.byte.add(high);
                *to.byte.add(1) = *from.byte.add(1 - high);
                from.byte = from.byte.add(2);
                to.byte = to.byte.add(2);
            } else {
                let mut byte = MachineByte::from(*to.byte) & !to.mask;
                if MachineByte::from(*from.byte) & from.mask != 0 {
                    byte |= to.mask;
                }
                *to.byte = byte as u8;
                from.step();
                to.step();
            }
            left -= 1;
            if left == 0 {
                return;
            }
        }
    }
}

/// Moves cells from `first` on, from or into data.
///
/// # Safety
/// Behind `cells` and `data` are all of them, and nothing else uses them meanwhile.
#[inline(always)]
pub(super) unsafe fn transfer_many(
    cells: *mut u8,
    kind: TableKind,
    write: bool,
    first: u16,
    quantity: u16,
    data: *mut u8,
) {
    // SAFETY: as the caller promises.
    unsafe {
        if !kind.is_bits() {
            transfer_words(cells.cast(), write, first, quantity, data);
        } else if write && quantity == 1 {
            let cell = cells.add(usize::from(first >> 3));
            let rest = *cell & !(1 << (first & 7));
            *cell = rest | (*data & 1) << (first & 7);
        } else {
            let data = from_raw_parts_mut(data, usize::from(quantity.div_ceil(8)));
            transfer_bits(cells, write, first, quantity, data);
        }
    }
}

/// Moves registers from `first` on, from or into data.
///
/// # Safety
/// Behind `words` and `data` are all of them, and nothing else uses them meanwhile.
#[inline(always)]
unsafe fn transfer_words(words: *mut u16, write: bool, first: u16, quantity: u16, data: *mut u8) {
    // SAFETY: as the caller promises.
    unsafe {
        let bytes = 2 * usize::from(quantity);
        let words = from_raw_parts_mut(words.add(first.into()).cast(), bytes);
        let data = from_raw_parts_mut(data, bytes);
        if write {
            copy_words(words, data);
        } else {
            copy_words(data, words);
        }
    }
}

/// Moves bits from `first` on, from or into data, eight at a time.
///
/// # Safety
/// Behind `cells` are all bytes that have some of them, and nothing else uses
/// them meanwhile.
#[inline(never)]
unsafe fn transfer_bits(cells: *mut u8, write: bool, first: u16, quantity: u16, data: &mut [u8]) {
    let shift = first & 7;
    let count = usize::from((shift + quantity).div_ceil(8));
    // SAFETY: as the caller promises.
    let cells = unsafe { from_raw_parts_mut(cells.add(usize::from(first >> 3)), count) };
    let mut left = quantity;
    for (index, byte) in data.iter_mut().enumerate() {
        // What of this byte is meant, and where it stands in two of the cells.
        let mask = if left < 8 { (1u16 << left) - 1 } else { 0xFF };
        let behind = cells.get(index + 1).copied().unwrap_or(0);
        let Some(cell) = cells.get_mut(index) else {
            return;
        };
        let both = u16::from_le_bytes([*cell, behind]);
        if write {
            let value = (both & !(mask << shift)) | ((u16::from(*byte) & mask) << shift);
            let [low, high] = value.to_le_bytes();
            *cell = low;
            if let Some(next) = cells.get_mut(index + 1) {
                *next = high;
            }
        } else {
            *byte = (both >> shift & mask) as u8;
        }
        left = left.saturating_sub(8);
    }
}
