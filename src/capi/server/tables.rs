//! The four tables, in arrays of the caller.

use super::cells::{transfer_bits, transfer_words};
use super::units::{add, is_unheard, request};
use super::{mbm_service, mbm_unit};
use crate::error::Status;
use crate::server::table::{self, Access, Kind, Role, Way};
use crate::server::Reply;
use crate::FIRMWARE;
use core::ffi::c_void;

/// Holding or input registers in an array of yours. Zero it, set what you need,
/// and hand it to mbm_server_serveHoldingRegisters or
/// mbm_server_serveInputRegisters. You may change words and settings at any
/// time, but not from within a hook of this table: the request under way goes on
/// with the words that the table had when it came. To serve it as another kind of
/// table, zero it first.
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

// SAFETY, of all functions here: the record is the caller's and stays where it
// is, as the header demands, with arrays of `size` cells behind its pointers; a
// cell that is looked at lies in them.
impl Access for Table {
    #[cfg_attr(target_os = "none", inline(never))]
    #[cfg_attr(not(target_os = "none"), inline(always))]
    fn access(&mut self, way: Way, address: u16, quantity: u16, data: &mut [u8]) -> u8 {
        let table = self.0;
        // SAFETY: see above; data have room for so many cells.
        unsafe {
            // What says where the cells are is taken once, for a hook may zero the
            // record or set it up anew.
            let cells = (*table).words.cast::<u8>();
            let kind = Kind::from_code((*table).kind);
            let first = address.wrapping_sub((*table).base);
            if cells.is_null() || !covers(table, first, quantity) {
                return Reply::ILLEGAL_DATA_ADDRESS.exception_code();
            }
            let writes = way == Way::Write;
            if writes {
                if let Some(hook) = (*table).before {
                    let refused = hook((*table).context, address, quantity, data.as_ptr());
                    if refused != 0 {
                        return refused;
                    }
                }
            }
            transfer(cells, kind, way, first, quantity, data);
            if writes {
                if let Some(hook) = (*table).after {
                    hook((*table).context, address, quantity);
                }
            }
        }
        0
    }
}

/// True if a table has so many cells from the one with this index on.
///
/// # Safety
/// `table` is one, with `size` bits behind `valid`.
#[inline(always)]
unsafe fn covers(table: *const mbm_registerTable, first: u16, quantity: u16) -> bool {
    // SAFETY: as the caller promises.
    unsafe {
        let size = (*table).size;
        if first >= size || quantity > size - first {
            return false;
        }
        let valid = (*table).valid;
        valid.is_null() || are_all_on(valid, first, quantity)
    }
}

/// True if so many bits of a bitmap are 1.
///
/// # Safety
/// The bitmap has them, and there is one at least.
#[cfg_attr(target_arch = "avr", inline(never))]
#[cfg_attr(not(target_arch = "avr"), inline(always))]
unsafe fn are_all_on(map: *const u8, mut first: u16, quantity: u16) -> bool {
    let end = first + quantity;
    loop {
        // SAFETY: as the caller promises.
        if unsafe { *map.add(usize::from(first >> 3)) } >> (first & 7) & 1 == 0 {
            return false;
        }
        first += 1;
        if first == end {
            return true;
        }
    }
}

/// Moves cells from or into data.
///
/// # Safety
/// There are so many at both; nothing else uses them meanwhile.
#[cfg_attr(target_os = "none", inline(never))]
#[cfg_attr(not(target_os = "none"), inline(always))]
unsafe fn transfer(
    cells: *mut u8,
    kind: Kind,
    way: Way,
    first: u16,
    quantity: u16,
    data: &mut [u8],
) {
    let (bits, write) = (kind.is_bits(), way == Way::Write);
    if way == Way::Check {
        return;
    }
    // SAFETY: as the caller promises.
    unsafe {
        // A host has room for code that takes many cells at a time.
        if !FIRMWARE {
            if bits && write && quantity == 1 {
                let cell = cells.add(usize::from(first >> 3));
                let on = data.first().is_some_and(|data| data & 1 != 0);
                let rest = *cell & !(1 << (first & 7));
                *cell = rest | u8::from(on) << (first & 7);
            } else if bits {
                transfer_bits(cells, write, first, quantity, data);
            } else {
                transfer_words(cells.cast(), write, first, quantity, data);
            }
            return;
        }
        if !bits {
            let mut words = cells.add(2 * usize::from(first));
            let mut data = data.as_mut_ptr();
            if write {
                core::mem::swap(&mut words, &mut data);
            }
            // From one order of bytes to the other, whichever is which.
            let high = usize::from(cfg!(target_endian = "little"));
            let mut left = quantity as u8;
            loop {
                *data = *words.add(high);
                *data.add(1) = *words.add(1 - high);
                words = words.add(2);
                data = data.add(2);
                left -= 1;
                if left == 0 {
                    return;
                }
            }
        }
        let (mut from, mut from_bit) = (cells.add(usize::from(first >> 3)), 1u8 << (first & 7));
        let (mut to, mut to_bit) = (data.as_mut_ptr(), 1u8);
        if !write {
            // There are bits without a cell.
            *to.add(usize::from((quantity - 1) >> 3)) = 0;
        } else {
            core::mem::swap(&mut from, &mut to);
            core::mem::swap(&mut from_bit, &mut to_bit);
        }
        let mut left = quantity;
        loop {
            let rest = *to & !to_bit;
            *to = if *from & from_bit != 0 {
                rest | to_bit
            } else {
                rest
            };
            from_bit = from_bit.rotate_left(1);
            from = from.add(usize::from(from_bit & 1));
            to_bit = to_bit.rotate_left(1);
            to = to.add(usize::from(to_bit & 1));
            left -= 1;
            if left == 0 {
                return;
            }
        }
    }
}

/// As [`Table`], for function 17: what it reads once its hooks were called is where it
/// was when the request came.
struct TableAsItWas(Table, mbm_registerTable);

impl Access for TableAsItWas {
    fn access(&mut self, way: Way, address: u16, quantity: u16, data: &mut [u8]) -> u8 {
        let mut was = Table(&raw mut self.1);
        let table = if way == Way::Read {
            &mut was
        } else {
            &mut self.0
        };
        table.access(way, address, quantity, data)
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
        let kind = Kind::from_code((*table).kind);
        match table::role(kind, *pdu) {
            role if FIRMWARE => serve_as(role, table, pdu, heading),
            // A host takes a way of its own for each.
            Role::READ => serve_read(table, pdu, heading),
            Role::WRITE_ONE => serve_write_one(table, pdu, heading),
            Role::WRITE_SEVERAL => serve_write_several(table, pdu, heading),
            _ => Reply::NOT_MINE.code(),
        }
    }
}

/// Serves a request that does this to the table.
///
/// # Safety
/// As for [`serve`].
#[inline(always)]
unsafe fn serve_as(
    role: Role,
    table: *mut mbm_registerTable,
    pdu: *mut u8,
    heading: *const c_void,
) -> u16 {
    // SAFETY: as the caller promises.
    unsafe {
        let (pdu, length) = request(pdu, heading);
        let kind = Kind::from_code((*table).kind);
        let cells = &mut Table(table);
        if FIRMWARE || kind.is_bits() {
            table::serve_as(role, kind, cells, pdu, length).code()
        } else {
            table::serve_as(role, Kind::HOLDING_REGISTERS, cells, pdu, length).code()
        }
    }
}

/// # Safety
/// As for [`serve`].
#[inline(never)]
unsafe fn serve_read(table: *mut mbm_registerTable, pdu: *mut u8, heading: *const c_void) -> u16 {
    // SAFETY: as the caller promises.
    unsafe { serve_as(Role::READ, table, pdu, heading) }
}

/// # Safety
/// As for [`serve`].
#[inline(never)]
unsafe fn serve_write_one(
    table: *mut mbm_registerTable,
    pdu: *mut u8,
    heading: *const c_void,
) -> u16 {
    // SAFETY: as the caller promises.
    unsafe { serve_as(Role::WRITE_ONE, table, pdu, heading) }
}

/// # Safety
/// As for [`serve`].
#[inline(never)]
unsafe fn serve_write_several(
    table: *mut mbm_registerTable,
    pdu: *mut u8,
    heading: *const c_void,
) -> u16 {
    // SAFETY: as the caller promises.
    unsafe { serve_as(Role::WRITE_SEVERAL, table, pdu, heading) }
}

/// Serves 16 and 17 of a table of holding registers.
///
/// # Safety
/// As for [`serve`].
#[cfg_attr(not(target_os = "none"), inline(never))]
unsafe fn serve_more(table: *mut mbm_registerTable, pdu: *mut u8, heading: *const c_void) -> u16 {
    // SAFETY: as the caller promises.
    unsafe {
        let (pdu, length) = request(pdu, heading);
        let mut cells = TableAsItWas(Table(table), table.read());
        if FIRMWARE {
            let cells: &mut dyn Access = &mut cells;
            return table::serve_more(cells, pdu, length).code();
        }
        table::serve_more(&mut cells, pdu, length).code()
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
        if !table::is_more(*pdu) {
            serve(service, pdu, heading)
        } else if is_unheard(heading, *pdu) {
            Reply::NOT_MINE.code()
        } else {
            serve_more(service.cast(), pdu, heading)
        }
    }
}

/// Adds a table to a unit.
///
/// # Safety
/// As for [`add`].
#[cfg_attr(target_os = "none", inline(never))]
unsafe fn add_table(unit: *mut mbm_unit, table: *mut mbm_registerTable, kind: Kind) -> u8 {
    // SAFETY: as the caller promises.
    unsafe {
        if !table.is_null() && is_other((*table).kind, kind.code()) {
            return Status::BUSY.code();
        }
        let status = add(unit, table.cast(), serve);
        if status == Status::OK.code() {
            (*table).kind = kind.code();
        }
        status
    }
}

/// True if a record, whose kind is 0 while it is zeroed, is served as another
/// kind already: it would answer other functions on each unit that has it.
pub(super) const fn is_other(served: u8, kind: u8) -> bool {
    served != 0 && served != kind
}

/// Serves coils: functions 01, 05 and 0F.
///
/// @param unit   the unit
/// @param table  yours, for as long as the unit is used
/// @return MBM_OK; MBM_INVALID_ARGUMENT for a NULL pointer; MBM_BUSY for a table that
///         is served as another kind; MBM_BUFFER_TOO_SMALL if the unit has no place
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
/// @return a status; see mbm_server_serveCoils
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
/// @return a status; see mbm_server_serveCoils
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
/// @return a status; see mbm_server_serveCoils
#[no_mangle]
pub unsafe extern "C" fn mbm_server_serveInputRegisters(
    unit: *mut mbm_unit,
    table: *mut mbm_registerTable,
) -> u8 {
    // SAFETY: as the header demands.
    unsafe { add_table(unit, table, Kind::INPUT_REGISTERS) }
}

/// Serves functions 16 and 17 beside 03, 06 and 10, on each unit that has the
/// table: a call of its own, so that firmware without it is smaller. After a table
/// was zeroed it is to be called again.
///
/// @param table  holding registers that mbm_server_serveHoldingRegisters took
/// @return MBM_OK, or MBM_INVALID_ARGUMENT for NULL and other tables
#[no_mangle]
pub unsafe extern "C" fn mbm_server_serveMaskAndReadWrite(table: *mut mbm_registerTable) -> u8 {
    // SAFETY: as the header demands.
    unsafe {
        if table.is_null() || (*table).kind != Kind::HOLDING_REGISTERS.code() {
            return Status::INVALID_ARGUMENT.code();
        }
        (*table).service.serve = Some(serve_all);
    }
    Status::OK.code()
}
