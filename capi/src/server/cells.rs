//! Copies cells of a table, one by one.

use mbm::server::table::{MachineByte, TableKind};

/// True if all `quantity` bits of a bitmap, from bit `first` on, are 1.
///
/// # Safety
/// The bitmap has these bits. `quantity` is at least 1.
#[cfg_attr(target_os = "none", inline(always))]
pub(super) unsafe fn are_all_on(map: *const u8, first: usize, quantity: usize) -> bool {
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
    pub(super) unsafe fn of_cells(cells: *mut u8, kind: TableKind, index: usize) -> Place {
        if kind.is_bits() {
            let (byte, mask) = (cells.add(index >> 3), 1 << (index & 7));
            Place { byte, mask }
        } else {
            let byte = cells.add(2 * index);
            Place { byte, mask: 0 }
        }
    }

    /// The position of the first cell in the data of a PDU.
    pub(super) fn of_data(byte: *mut u8, kind: TableKind) -> Place {
        let mask = kind.is_bits().into();
        Place { byte, mask }
    }

    /// Moves to the next bit.
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
pub(super) unsafe fn transfer(mut from: Place, mut to: Place, mut left: usize) {
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
