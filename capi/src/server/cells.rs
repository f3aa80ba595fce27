//! Copies cells of a table: cell by cell, and on a host many at a time.

use core::slice::from_raw_parts_mut;
use mbm::bytes::copy_words;
use mbm::server::table::{MachineByte, TableKind};

/// True if all `quantity` bits of a bitmap, from bit `first` on, are 1.
///
/// # Safety
/// The bitmap has these bits. `quantity` is at least 1.
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

/// The position of a bit. With an empty mask it is the position of a register.
#[derive(Clone, Copy)]
pub(super) struct Place {
    pub(super) byte: *mut u8,
    mask: MachineByte,
}

impl Place {
    /// The position of the cell with this index.
    ///
    /// # Safety
    /// The cell exists.
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

    /// The position of the first cell in the data of a PDU.
    #[inline(always)]
    pub(super) fn of_data(byte: *mut u8, kind: TableKind) -> Place {
        let mask = kind.is_bits().into();
        Place { byte, mask }
    }

    /// Moves to the next bit.
    #[inline(always)]
    #[allow(clippy::unnecessary_cast)] // It is needed on an AVR.
    fn step(&mut self) {
        let next = self.mask >> 7;
        self.mask = (self.mask << 1 | next) & 0xFF;
        self.byte = self.byte.wrapping_add(next as usize);
    }
}

/// Copies `left` cells, at least one.
///
/// # Safety
/// Both positions have `left` cells, which nothing else uses meanwhile.
#[cfg_attr(target_os = "none", inline(never))]
pub(super) unsafe fn transfer(mut from: Place, mut to: Place, mut left: usize) {
    // SAFETY: as the caller promises.
    unsafe {
        loop {
            if from.mask == 0 {
                // Swaps between the byte order of the machine and that of the wire; the
                // same code does both directions.
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

/// Copies `quantity` cells, from cell `first` on, into `data`, or with `write` out of
/// `data`.
///
/// # Safety
/// `cells` and `data` contain these cells, which nothing else uses meanwhile.
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

/// As [`transfer_many`], for registers.
///
/// # Safety
/// `words` and `data` contain these registers, which nothing else uses meanwhile.
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

/// As [`transfer_many`], for bits, eight at a time.
///
/// # Safety
/// `cells` contains every byte that has one of these bits; nothing else uses these bytes
/// meanwhile.
#[inline(never)]
unsafe fn transfer_bits(cells: *mut u8, write: bool, first: u16, quantity: u16, data: &mut [u8]) {
    let shift = first & 7;
    let count = usize::from((shift + quantity).div_ceil(8));
    // SAFETY: as the caller promises.
    let cells = unsafe { from_raw_parts_mut(cells.add(usize::from(first >> 3)), count) };
    let mut left = quantity;
    for (index, byte) in data.iter_mut().enumerate() {
        // The bits of this data byte that are copied. They lie in two bytes of the cells.
        let mask = if left < 8 { (1u16 << left) - 1 } else { 0xFF };
        let next_byte = cells.get(index + 1).copied().unwrap_or(0);
        let Some(cell) = cells.get_mut(index) else {
            return;
        };
        let both = u16::from_le_bytes([*cell, next_byte]);
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
