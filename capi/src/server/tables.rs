//! The four tables, in arrays of the caller.

use super::cells::{are_all_on, transfer, transfer_many, Place};
use super::units::{add_as, is_unheard, request};
use super::{mbm_service, mbm_unit};
use core::ffi::c_void;
use core::hint::assert_unchecked;
use mbm::error::Status;
use mbm::server::table::{self, TableAccess, TableKind, TableOperation};
use mbm::server::Reply;
use mbm::FIRMWARE;

/// Holding or input registers in an array of yours. Zero it, set what you need,
/// and hand it to mbm_unit_serveHoldingRegisters or
/// mbm_unit_serveInputRegisters. You may change words and settings at any
/// time, but not from within a hook of this table: the request under way goes on
/// with the words that the table had when it came. To serve it as another kind of
/// table, zero it first.
#[repr(C)]
pub struct mbm_registerTable {
    /// Private.
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
}

/// Coils or discrete inputs in an array of yours, eight to a byte, lowest bit
/// first; as mbm_registerTable.
#[repr(C)]
pub struct mbm_bitTable {
    /// Private.
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
}

/// A table of C, whose hooks may look at it: no reference to it is kept.
struct Table(*mut mbm_registerTable);

// The two tables are one record, but for what `words` points to.
const _: () = {
    use core::mem::offset_of;
    assert!(offset_of!(mbm_registerTable, words) == offset_of!(mbm_bitTable, bits));
    assert!(offset_of!(mbm_registerTable, size) == offset_of!(mbm_bitTable, size));
};

// SAFETY, of all functions here: the record is the caller's and stays where it
// is, as the header demands, with arrays of `size` cells behind its pointers; a
// cell that is looked at lies in them.
impl TableAccess for Table {
    #[cfg_attr(target_arch = "avr", inline(never))]
    #[cfg_attr(not(target_arch = "avr"), inline(always))]
    fn access(
        &mut self,
        operation: TableOperation,
        quantity: usize,
        bytes: usize,
        pdu: &mut [u8],
    ) -> Reply {
        let table = self.0;
        let pdu = pdu.as_mut_ptr();
        // SAFETY: see above; a PDU has a function and an address, a request that writes has
        // its data, and there is room for so many bytes of a response.
        unsafe {
            // What says where the cells are is taken once, for a hook may zero the
            // record or set it up anew.
            let cells = (*table).words.cast::<u8>();
            let address = usize::from(*pdu.add(1)) << 8 | usize::from(*pdu.add(2));
            let first = address.wrapping_sub((*table).base.into());
            if cells.is_null() || !contains(table, first, quantity) {
                return Reply::ILLEGAL_DATA_ADDRESS;
            }
            let kind = TableKind::from_code((*table).service.kind);
            let place = Place::of_cells(cells, kind, first);
            let data = Place::of_data(pdu.add(operation.data()), kind);
            let (mut from, mut to, mut reply, mut after) = (data, place, table::WRITTEN, None);
            if operation == TableOperation::READ {
                if bytes == 0 {
                    return Reply::SERVER_DEVICE_FAILURE;
                }
                *pdu.add(1) = bytes as u8;
                // There are bits without a cell.
                *pdu.add(1 + bytes) = 0;
                reply = Reply::length(2 + bytes);
                (from, to) = (place, data);
            } else {
                if let Some(hook) = (*table).before {
                    let refused =
                        hook((*table).context, address as u16, quantity as u16, data.byte);
                    if refused != 0 {
                        return Reply::exception(refused);
                    }
                }
                after = (*table).after;
            }
            // A host has room for code that takes many cells at a time.
            if FIRMWARE {
                transfer(from, to, quantity);
            } else {
                let write = operation != TableOperation::READ;
                transfer_many(cells, kind, write, first as u16, quantity as u16, data.byte);
            }
            if let Some(hook) = after {
                hook((*table).context, address as u16, quantity as u16);
            }
            reply
        }
    }
}

/// True if a table has so many cells from the one with this index on.
///
/// # Safety
/// `table` is one, with `size` bits behind `valid`.
#[inline(always)]
unsafe fn contains(table: *const mbm_registerTable, first: usize, quantity: usize) -> bool {
    // SAFETY: as the caller promises.
    unsafe {
        let size = usize::from((*table).size);
        if first >= size || quantity > size - first {
            return false;
        }
        let valid = (*table).valid;
        valid.is_null() || are_all_on(valid, first, quantity)
    }
}

/// As [`Table`], for function 17: what it reads once its hooks were called is where it
/// was when the request came.
struct TableAsItWas(Table, mbm_registerTable);

impl TableAccess for TableAsItWas {
    #[cfg_attr(target_os = "none", inline(never))]
    fn access(
        &mut self,
        operation: TableOperation,
        quantity: usize,
        bytes: usize,
        pdu: &mut [u8],
    ) -> Reply {
        let mut was = Table(&raw mut self.1);
        let table = if operation == TableOperation::READ {
            &mut was
        } else {
            &mut self.0
        };
        table.access(operation, quantity, bytes, pdu)
    }
}

/// Serves a table.
///
/// # Safety
/// `service` is the head of one; `pdu` has the bytes and room of `info`.
unsafe extern "C" fn serve(service: *mut mbm_service, pdu: *mut u8, info: *const c_void) -> usize {
    // SAFETY: as the caller promises.
    unsafe {
        let table = service.cast::<mbm_registerTable>();
        let kind = TableKind::from_code((*table).service.kind);
        match table::operation(kind, *pdu) {
            operation if FIRMWARE => serve_as(operation, table, pdu, info),
            // A host takes a way of its own for each.
            TableOperation::READ if !kind.is_bits() && (*table).valid.is_null() => {
                serve_read_words(table, pdu, info)
            }
            TableOperation::READ => serve_read(table, pdu, info),
            TableOperation::WRITE_ONE => serve_write_one(table, pdu, info),
            TableOperation::WRITE_SEVERAL => serve_write_several(table, pdu, info),
            _ => Reply::NOT_HANDLED.code(),
        }
    }
}

/// Serves a request that does this to the table.
///
/// # Safety
/// As for [`serve`].
#[inline(always)]
unsafe fn serve_as(
    operation: TableOperation,
    table: *mut mbm_registerTable,
    pdu: *mut u8,
    info: *const c_void,
) -> usize {
    // SAFETY: as the caller promises.
    unsafe {
        let (pdu, length) = request(pdu, info);
        let kind = TableKind::from_code((*table).service.kind);
        let cells = &mut Table(table);
        if FIRMWARE || kind.is_bits() {
            table::serve_as(operation, kind, cells, pdu, length).code()
        } else {
            table::serve_as(operation, TableKind::HOLDING_REGISTERS, cells, pdu, length).code()
        }
    }
}

/// [`serve_read`], of registers that are all there.
///
/// # Safety
/// As for [`serve`].
#[inline(never)]
unsafe fn serve_read_words(
    table: *mut mbm_registerTable,
    pdu: *mut u8,
    info: *const c_void,
) -> usize {
    // SAFETY: as the caller promises.
    unsafe {
        let is_bits = TableKind::from_code((*table).service.kind).is_bits();
        assert_unchecked(!is_bits && (*table).valid.is_null());
        serve_as(TableOperation::READ, table, pdu, info)
    }
}

/// # Safety
/// As for [`serve`].
#[inline(never)]
unsafe fn serve_read(table: *mut mbm_registerTable, pdu: *mut u8, info: *const c_void) -> usize {
    // SAFETY: as the caller promises.
    unsafe { serve_as(TableOperation::READ, table, pdu, info) }
}

/// # Safety
/// As for [`serve`].
#[inline(never)]
unsafe fn serve_write_one(
    table: *mut mbm_registerTable,
    pdu: *mut u8,
    info: *const c_void,
) -> usize {
    // SAFETY: as the caller promises.
    unsafe { serve_as(TableOperation::WRITE_ONE, table, pdu, info) }
}

/// # Safety
/// As for [`serve`].
#[inline(never)]
unsafe fn serve_write_several(
    table: *mut mbm_registerTable,
    pdu: *mut u8,
    info: *const c_void,
) -> usize {
    // SAFETY: as the caller promises.
    unsafe { serve_as(TableOperation::WRITE_SEVERAL, table, pdu, info) }
}

/// Serves 16 and 17 of a table of holding registers.
///
/// # Safety
/// As for [`serve`].
#[cfg_attr(not(target_os = "none"), inline(never))]
unsafe fn serve_mask_and_read_write(
    table: *mut mbm_registerTable,
    pdu: *mut u8,
    info: *const c_void,
) -> usize {
    // SAFETY: as the caller promises.
    unsafe {
        let (pdu, length) = request(pdu, info);
        let mut cells = TableAsItWas(Table(table), table.read());
        if FIRMWARE {
            let cells: &mut dyn TableAccess = &mut cells;
            return table::serve_mask_and_read_write(cells, pdu, length).code();
        }
        table::serve_mask_and_read_write(&mut cells, pdu, length).code()
    }
}

/// Serves holding registers, 16 and 17 too.
///
/// # Safety
/// As for [`serve`].
unsafe extern "C" fn serve_all(
    service: *mut mbm_service,
    pdu: *mut u8,
    info: *const c_void,
) -> usize {
    // SAFETY: as the caller promises.
    unsafe {
        if !table::is_mask_or_read_write(*pdu) {
            serve(service, pdu, info)
        } else if is_unheard(info, *pdu) {
            Reply::NOT_HANDLED.code()
        } else {
            serve_mask_and_read_write(service.cast(), pdu, info)
        }
    }
}

/// Adds a table to a unit.
///
/// # Safety
/// As for [`add_as`].
#[cfg_attr(target_os = "none", inline(never))]
unsafe extern "C" fn add_table(
    unit: *mut mbm_unit,
    table: *mut mbm_registerTable,
    kind: TableKind,
) -> u8 {
    // SAFETY: as the caller promises.
    unsafe { add_as(unit, table.cast(), kind.code(), serve) }.code()
}

/// Serves coils: functions 01, 05 and 0F.
///
/// @param unit   the unit
/// @param table  yours, for as long as the unit is used
/// @return MBM_OK; MBM_INVALID_ARGUMENT for a NULL pointer; MBM_BUSY for a table that
///         is served as another kind; MBM_BUFFER_TOO_SMALL if the unit has no place
#[no_mangle]
pub unsafe extern "C" fn mbm_unit_serveCoils(unit: *mut mbm_unit, table: *mut mbm_bitTable) -> u8 {
    // SAFETY: as the header demands.
    unsafe { add_table(unit, table.cast(), TableKind::COILS) }
}

/// Serves discrete inputs: function 02.
///
/// @param unit   the unit
/// @param table  yours, for as long as the unit is used
/// @return a status; see mbm_unit_serveCoils
#[no_mangle]
pub unsafe extern "C" fn mbm_unit_serveDiscreteInputs(
    unit: *mut mbm_unit,
    table: *mut mbm_bitTable,
) -> u8 {
    // SAFETY: as the header demands.
    unsafe { add_table(unit, table.cast(), TableKind::DISCRETE_INPUTS) }
}

/// Serves holding registers: functions 03, 06 and 10. For 16 and 17 too, call
/// mbm_registerTable_serveMaskAndReadWrite behind it.
///
/// @param unit   the unit
/// @param table  yours, for as long as the unit is used
/// @return a status; see mbm_unit_serveCoils
#[no_mangle]
pub unsafe extern "C" fn mbm_unit_serveHoldingRegisters(
    unit: *mut mbm_unit,
    table: *mut mbm_registerTable,
) -> u8 {
    // SAFETY: as the header demands.
    unsafe { add_table(unit, table, TableKind::HOLDING_REGISTERS) }
}

/// Serves input registers: function 04.
///
/// @param unit   the unit
/// @param table  yours, for as long as the unit is used
/// @return a status; see mbm_unit_serveCoils
#[no_mangle]
pub unsafe extern "C" fn mbm_unit_serveInputRegisters(
    unit: *mut mbm_unit,
    table: *mut mbm_registerTable,
) -> u8 {
    // SAFETY: as the header demands.
    unsafe { add_table(unit, table, TableKind::INPUT_REGISTERS) }
}

/// Serves functions 16 and 17 beside 03, 06 and 10, on each unit that has the
/// table: a call of its own, so that firmware without it is smaller. After a table
/// was zeroed it is to be called again.
///
/// @param table  holding registers that mbm_unit_serveHoldingRegisters took
/// @return MBM_OK, or MBM_INVALID_ARGUMENT for NULL and other tables
#[no_mangle]
pub unsafe extern "C" fn mbm_registerTable_serveMaskAndReadWrite(
    table: *mut mbm_registerTable,
) -> u8 {
    // SAFETY: as the header demands.
    unsafe {
        if table.is_null() || (*table).service.kind != TableKind::HOLDING_REGISTERS.code() {
            return Status::INVALID_ARGUMENT.code();
        }
        (*table).service.serve = Some(serve_all);
    }
    Status::OK.code()
}
