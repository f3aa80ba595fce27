//! Cells of a table moved many at a time, as a host does.

use crate::server::table::Kind;
use core::slice::from_raw_parts_mut;

/// Moves cells from `first` on, from or into data.
///
/// # Safety
/// Behind `cells` and `data` are all of them, and nothing else uses them meanwhile.
#[inline(always)]
pub(super) unsafe fn transfer_many(
    cells: *mut u8,
    kind: Kind,
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
        let words = words.add(first.into()).cast::<u8>();
        let (from, to) = if write {
            (data.cast_const(), words)
        } else {
            (words.cast_const(), data)
        };
        let end = 2 * usize::from(quantity);
        let Some(last) = end.checked_sub(16) else {
            for at in (0..end).step_by(2) {
                turn::<1>(from.add(at), to.add(at));
            }
            return;
        };
        // Eight at a time; the last eight overlap those before.
        let mut at = 0;
        while at < last {
            turn::<8>(from.add(at), to.add(at));
            at += 16;
        }
        turn::<8>(from.add(last), to.add(last));
    }
}

/// Moves so many registers to or from the order of the wire.
///
/// # Safety
/// There are so many at both pointers, which need not be aligned.
#[inline(always)]
unsafe fn turn<const N: usize>(from: *const u8, to: *mut u8) {
    // SAFETY: as the caller promises.
    unsafe {
        let words = from.cast::<[u16; N]>().read_unaligned();
        to.cast::<[u16; N]>().write_unaligned(words.map(u16::to_be));
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
