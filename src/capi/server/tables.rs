//! The four tables, in arrays of the caller.

use super::units::{add, request};
use super::{mbm_service, mbm_unit};
use crate::server::table::{self, Cells, Kind, Way};
use crate::server::Reply;
use core::ffi::c_void;
use core::slice::from_raw_parts_mut;

/// Holding or input registers in an array of yours. Zero it, set what you need,
/// and hand it to mbm_server_serveHoldingRegisters or
/// mbm_server_serveInputRegisters. You may change words and settings at any
/// time, but not from within a hook of this table.
#[repr(C)]
pub struct mbm_registerTable {
    /// Not for you.
    pub service: mbm_service,
    /// The registers.
    pub words: *mut u16,
    /// Optional, NULL if every register is there: a bit for each, lowest bit of
    /// the first byte first; 0 answers exception 02.
    pub valid: *const u8,
    /// Optional: asked before registers are written, once a request. `data` are
    /// the new values, high bytes first. Returns 0, or an exception code that
    /// refuses the whole request.
    pub before: Option<
        unsafe extern "C" fn(
            context: *mut c_void,
            address: u16,
            quantity: u16,
            data: *const u8,
        ) -> u8,
    >,
    /// Optional: told what was written.
    pub after: Option<unsafe extern "C" fn(context: *mut c_void, address: u16, quantity: u16)>,
    /// Handed to both hooks. Yours, may be NULL.
    pub context: *mut c_void,
    /// The address of the first register.
    pub base: u16,
    /// How many registers there are.
    pub size: u16,
    /// Not for you.
    pub kind: u8,
}

/// Coils or discrete inputs in an array of yours, eight to a byte, lowest bit
/// first; as mbm_registerTable.
#[repr(C)]
pub struct mbm_bitTable {
    /// Not for you.
    pub service: mbm_service,
    /// The bits.
    pub bits: *mut u8,
    /// As in mbm_registerTable.
    pub valid: *const u8,
    /// As in mbm_registerTable; `data` are bits, lowest first.
    pub before: Option<
        unsafe extern "C" fn(
            context: *mut c_void,
            address: u16,
            quantity: u16,
            data: *const u8,
        ) -> u8,
    >,
    /// As in mbm_registerTable.
    pub after: Option<unsafe extern "C" fn(context: *mut c_void, address: u16, quantity: u16)>,
    /// As in mbm_registerTable.
    pub context: *mut c_void,
    /// The address of the first bit.
    pub base: u16,
    /// How many bits there are.
    pub size: u16,
    /// Not for you.
    pub kind: u8,
}

/// A table of C, whose hooks may look at it: no reference to it is kept.
struct Table(*mut mbm_registerTable);

// The two tables are one record, but for what `words` points to.
const _: () = {
    use core::mem::offset_of;
    assert!(offset_of!(mbm_registerTable, words) == offset_of!(mbm_bitTable, bits));
    assert!(offset_of!(mbm_registerTable, size) == offset_of!(mbm_bitTable, size));
    assert!(offset_of!(mbm_registerTable, kind) == offset_of!(mbm_bitTable, kind));
};

/// The bit of a place in a bitmap.
///
/// # Safety
/// The bitmap has it.
unsafe fn bit(map: *const u8, index: u16) -> bool {
    // SAFETY: as the caller promises.
    unsafe { *map.add(usize::from(index >> 3)) >> (index & 7) & 1 != 0 }
}

// SAFETY, of all functions here: the record is the caller's and stays where it
// is, as the header demands, with arrays of `size` cells behind its pointers; a
// cell that is `covered` lies in them.
impl Table {
    fn index(&self, address: u16) -> u16 {
        // SAFETY: see above.
        unsafe { address.wrapping_sub((*self.0).base) }
    }
}

impl Cells for Table {
    fn covers(&self, address: u16, quantity: u16) -> bool {
        let first = self.index(address);
        // SAFETY: see above.
        unsafe {
            let size = (*self.0).size;
            if (*self.0).words.is_null() || first > size || quantity > size - first {
                return false;
            }
            let valid = (*self.0).valid;
            valid.is_null() || (first..first + quantity).all(|index| bit(valid, index))
        }
    }

    #[cfg_attr(target_os = "none", inline(never))]
    fn transfer(&mut self, way: Way, address: u16, quantity: u16, data: &mut [u8]) {
        let first = self.index(address);
        let write = way == Way::Write;
        // SAFETY: see above; data have room for so many cells.
        unsafe {
            let cells = (*self.0).words.cast::<u8>();
            let bits = Kind::from_code((*self.0).kind).is_bits();
            // A host has room for code that takes many cells at a time.
            if cfg!(not(target_os = "none")) {
                if bits {
                    transfer_bits(cells, write, first, quantity, data);
                } else {
                    transfer_words(cells.cast(), write, first, quantity, data);
                }
                return;
            }
            let mut data = data.as_mut_ptr();
            let mut mask = 1u8;
            for index in first..first + quantity {
                if bits {
                    let (cell, bit) = (cells.add(usize::from(index >> 3)), 1 << (index & 7));
                    let (to, to_bit, from, from_bit) = if write {
                        (cell, bit, data, mask)
                    } else {
                        (data, mask, cell, bit)
                    };
                    // A byte that is begun has no bits yet.
                    let mut value = if write || mask != 1 { *to & !to_bit } else { 0 };
                    if *from & from_bit != 0 {
                        value |= to_bit;
                    }
                    *to = value;
                    mask = mask.rotate_left(1);
                    if mask == 1 {
                        data = data.add(1);
                    }
                } else {
                    let cell = cells.add(2 * usize::from(index)).cast::<u16>();
                    if write {
                        *cell = u16::from_be_bytes([*data, *data.add(1)]);
                    } else {
                        let [high, low] = (*cell).to_be_bytes();
                        *data = high;
                        *data.add(1) = low;
                    }
                    data = data.add(2);
                }
            }
        }
    }

    fn before(&mut self, address: u16, quantity: u16, data: &[u8]) -> u8 {
        // SAFETY: see above.
        unsafe {
            match (*self.0).before {
                Some(hook) => hook((*self.0).context, address, quantity, data.as_ptr()),
                None => 0,
            }
        }
    }

    fn after(&mut self, address: u16, quantity: u16) {
        // SAFETY: see above.
        unsafe {
            if let Some(hook) = (*self.0).after {
                hook((*self.0).context, address, quantity);
            }
        }
    }
}

/// Moves registers from `first` on, from or into data.
///
/// # Safety
/// Behind `words` are all of them, and nothing else uses them meanwhile.
unsafe fn transfer_words(words: *mut u16, write: bool, first: u16, quantity: u16, data: &mut [u8]) {
    // SAFETY: as the caller promises.
    let words = unsafe { from_raw_parts_mut(words.add(first.into()), quantity.into()) };
    let (pairs, _) = data.as_chunks_mut::<2>();
    for (word, pair) in words.iter_mut().zip(pairs) {
        if write {
            *word = u16::from_be_bytes(*pair);
        } else {
            *pair = word.to_be_bytes();
        }
    }
}

/// Moves bits from `first` on, from or into data, eight at a time.
///
/// # Safety
/// Behind `cells` are all bytes that have some of them, and nothing else uses
/// them meanwhile.
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

/// Serves a table.
///
/// # Safety
/// `service` is the head of one; `pdu` has the bytes and room of `heading`.
unsafe extern "C" fn serve(service: *mut mbm_service, pdu: *mut u8, heading: *const c_void) -> u16 {
    // SAFETY: as the caller promises.
    unsafe {
        let table = service.cast::<mbm_registerTable>();
        // Soon done with what another table serves.
        if cfg!(not(target_os = "none")) && table::kind_of(*pdu) != (*table).kind {
            return Reply::NOT_MINE.code();
        }
        let (pdu, length) = request(pdu, heading);
        let kind = Kind::from_code((*table).kind);
        table::serve(kind, &mut Table(table), pdu, length).code()
    }
}

/// Serves holding registers, 16 and 17 too.
///
/// # Safety
/// As for [`serve`].
unsafe extern "C" fn serve_all(
    service: *mut mbm_service,
    pdu: *mut u8,
    heading: *const c_void,
) -> u16 {
    // SAFETY: as the caller promises.
    unsafe {
        let reply = serve(service, pdu, heading);
        if reply != Reply::NOT_MINE.code() {
            return reply;
        }
        let (pdu, length) = request(pdu, heading);
        table::serve_more(&mut Table(service.cast()), pdu, length).code()
    }
}

/// Hangs a table onto a unit.
///
/// # Safety
/// As for [`add`].
#[cfg_attr(target_os = "none", inline(never))]
unsafe fn add_table(unit: *mut mbm_unit, table: *mut mbm_registerTable, kind: Kind) -> u8 {
    // SAFETY: as the caller promises.
    unsafe {
        if !table.is_null() {
            (*table).kind = kind.code();
        }
        add(unit, table.cast(), serve)
    }
}

/// Serves coils: functions 01, 05 and 0F.
///
/// @param unit   the unit
/// @param table  yours, for as long as the unit is used
/// @return MBM_OK, or MBM_INVALID_ARGUMENT for a NULL pointer
#[no_mangle]
pub unsafe extern "C" fn mbm_server_serveCoils(
    unit: *mut mbm_unit,
    table: *mut mbm_bitTable,
) -> u8 {
    // SAFETY: as the header demands.
    unsafe { add_table(unit, table.cast(), Kind::COILS) }
}

/// Serves discrete inputs: function 02.
///
/// @param unit   the unit
/// @param table  yours, for as long as the unit is used
/// @return MBM_OK, or MBM_INVALID_ARGUMENT for a NULL pointer
#[no_mangle]
pub unsafe extern "C" fn mbm_server_serveDiscreteInputs(
    unit: *mut mbm_unit,
    table: *mut mbm_bitTable,
) -> u8 {
    // SAFETY: as the header demands.
    unsafe { add_table(unit, table.cast(), Kind::DISCRETE_INPUTS) }
}

/// Serves holding registers: functions 03, 06 and 10. For 16 and 17 too, call
/// mbm_server_serveMaskAndReadWrite behind it.
///
/// @param unit   the unit
/// @param table  yours, for as long as the unit is used
/// @return MBM_OK, or MBM_INVALID_ARGUMENT for a NULL pointer
#[no_mangle]
pub unsafe extern "C" fn mbm_server_serveHoldingRegisters(
    unit: *mut mbm_unit,
    table: *mut mbm_registerTable,
) -> u8 {
    // SAFETY: as the header demands.
    unsafe { add_table(unit, table, Kind::HOLDING_REGISTERS) }
}

/// Serves input registers: function 04.
///
/// @param unit   the unit
/// @param table  yours, for as long as the unit is used
/// @return MBM_OK, or MBM_INVALID_ARGUMENT for a NULL pointer
#[no_mangle]
pub unsafe extern "C" fn mbm_server_serveInputRegisters(
    unit: *mut mbm_unit,
    table: *mut mbm_registerTable,
) -> u8 {
    // SAFETY: as the header demands.
    unsafe { add_table(unit, table, Kind::INPUT_REGISTERS) }
}

/// Serves functions 16 and 17 beside 03, 06 and 10: a call of its own, so that
/// firmware without it is smaller.
///
/// @param table  holding registers that mbm_server_serveHoldingRegisters took
/// @return MBM_OK, or MBM_INVALID_ARGUMENT for NULL and other tables
#[no_mangle]
pub unsafe extern "C" fn mbm_server_serveMaskAndReadWrite(table: *mut mbm_registerTable) -> u8 {
    // SAFETY: as the header demands.
    unsafe {
        if table.is_null() || (*table).kind != Kind::HOLDING_REGISTERS.code() {
            return crate::error::Status::INVALID_ARGUMENT.code();
        }
        (*table).service.serve = Some(serve_all);
    }
    crate::error::Status::OK.code()
}
