//! The four tables of the data model, in arrays of the program.

use super::cells::{are_all_on, transfer, Place};
use super::hooks::mbm_recordHooks;
use super::units::{add_as, is_ignored_broadcast, request};
use super::{mbm_service, mbm_unit};
use core::ffi::c_void;
use core::mem::transmute;
use mbm::error::Status;
use mbm::server::table::{self, TableAccess, TableKind, TableOperation};
use mbm::server::Reply;

/// Holding registers or input registers in an array of yours. Initialise the struct with
/// MBM_INIT, set the fields that you need, and pass it to mbm_unit_serveHoldingRegisters or
/// mbm_unit_serveInputRegisters. You may change the registers at any time, and the fields too,
/// except from within a hook of this table: the server finishes a request with the `words`
/// that the table had when the request came. To serve the struct as another kind of table,
/// zero it first.
#[repr(C)]
pub struct mbm_registerTable {
    /// Private.
    pub service: mbm_service,
    /// The registers: `size` words.
    pub words: *mut u16,
    /// Optional; NULL if every register exists. Otherwise a bitmap with one bit for each
    /// register, the lowest bit of the first byte first. A request for a register whose
    /// bit is 0 is answered with exception 02.
    pub valid: *const u8,
    /// Private: see mbm_registerTable_setHooks.
    pub hooks: mbm_recordHooks,
    /// The address of the first register.
    pub base: u16,
    /// How many registers there are.
    pub size: u16,
}

/// Coils or discrete inputs in an array of yours, eight bits in a byte, the lowest bit
/// first. Use it as mbm_registerTable, with mbm_unit_serveCoils or
/// mbm_unit_serveDiscreteInputs.
#[repr(C)]
pub struct mbm_bitTable {
    /// Private.
    pub service: mbm_service,
    /// The bits: `size` bits, in (size + 7) / 8 bytes.
    pub bits: *mut u8,
    /// As in mbm_registerTable.
    pub valid: *const u8,
    /// Private: see mbm_bitTable_setHooks.
    pub hooks: mbm_recordHooks,
    /// The address of the first bit.
    pub base: u16,
    /// How many bits there are.
    pub size: u16,
}

/// A table of C, and the request as for [`super::records::Serve`]. Its hooks may use the
/// struct, so no reference to it is kept.
pub(super) struct Table(pub(super) *mut mbm_registerTable, pub(super) *const c_void);

/// Serves an access as [`TableAccess::access`], to cells that exist, and calls the hooks of the
/// table around it.
///
/// A table has this function only with hooks, so a program without hooks does not contain it.
pub(super) type AccessWithHooks = unsafe fn(
    table: *mut mbm_registerTable,
    info: *const c_void,
    operation: TableOperation,
    pdu: *mut u8,
) -> Reply;

/// The function that a table with hooks has.
unsafe fn access_with_hooks(table: *const mbm_registerTable) -> Option<AccessWithHooks> {
    // `call` of a table is NULL or such a function.
    transmute((*table).hooks.call)
}

// Both structs have the same layout; only the type of the array differs.
const _: () = {
    use core::mem::offset_of;
    assert!(offset_of!(mbm_registerTable, words) == offset_of!(mbm_bitTable, bits));
    assert!(offset_of!(mbm_registerTable, size) == offset_of!(mbm_bitTable, size));
};

// SAFETY, of all functions here: the header requires that the struct stays valid, at the
// same address, with arrays of `size` cells. Each access is within these arrays.
impl TableAccess for Table {
    fn access(
        &mut self,
        operation: TableOperation,
        quantity: usize,
        bytes: usize,
        pdu: &mut [u8],
    ) -> Reply {
        let table = self.0;
        let pdu = pdu.as_mut_ptr();
        // SAFETY: see above. The PDU has a function code and an address; a write request has
        // its data; the response of a read has space for `bytes` bytes.
        unsafe {
            // The code reads the fields that locate the cells only once, because a hook
            // may zero the struct or fill it in anew.
            let cells = (*table).words.cast::<u8>();
            let address = usize::from(*pdu.add(1)) << 8 | usize::from(*pdu.add(2));
            let first = address.wrapping_sub((*table).base.into());
            if cells.is_null() || !contains(table, first, quantity) {
                return Reply::ABSENT;
            }
            let kind = TableKind::from_code((*table).service.kind);
            let place = Place::of_cells(cells, kind, first);
            let data = Place::of_data(pdu.add(operation.data()), kind);
            let (mut from, mut to, mut reply) = (data, place, table::WRITTEN);
            if operation == TableOperation::READ && bytes == 0 {
                return Reply::SERVER_DEVICE_FAILURE;
            }
            if let Some(access) = access_with_hooks(table) {
                return access(table, self.1, operation, pdu);
            }
            if operation == TableOperation::READ {
                *pdu.add(1) = bytes as u8;
                // The last byte may have bits without a cell: they are 0.
                *pdu.add(1 + bytes) = 0;
                reply = Reply::length(2 + bytes);
                (from, to) = (place, data);
            }
            transfer(from, to, quantity);
            reply
        }
    }
}

/// True if a table has `quantity` cells from the index `first` on, and all of them are
/// valid.
unsafe fn contains(table: *const mbm_registerTable, first: usize, quantity: usize) -> bool {
    let size = usize::from((*table).size);
    if first >= size || quantity > size - first {
        return false;
    }
    let valid = (*table).valid;
    valid.is_null() || are_all_on(valid, first, quantity)
}

/// As [`Table`], for functions that read and write: a copy of the table. It has the fields that
/// the table had when the request came, also if a hook has changed them.
struct TableSnapshot(mbm_registerTable, *const c_void);

impl TableAccess for TableSnapshot {
    fn access(
        &mut self,
        operation: TableOperation,
        quantity: usize,
        bytes: usize,
        pdu: &mut [u8],
    ) -> Reply {
        let (mut part, mut count) = (operation, bytes);
        let (table, info) = (&raw mut self.0, self.1);
        // SAFETY: see `Table`; where a hook is called, the cells exist.
        unsafe {
            let call = (*table).hooks.call;
            if operation.reads() {
                part = TableOperation::READ;
                (*table).hooks.call = None;
            }
            if operation == TableOperation::ASK {
                count = 0;
            }
            let reply = Table(table, info).access(part, quantity, count, pdu);
            (*table).hooks.call = call;
            // Without bytes to read, the reply says whether the cells exist.
            if count == bytes || reply == Reply::ABSENT {
                return reply;
            }
            match access_with_hooks(table) {
                Some(ask) => ask(table, info, operation, pdu.as_mut_ptr()),
                None => Reply::NOT_HANDLED,
            }
        }
    }
}

/// Serves a request to a table.
unsafe extern "C" fn serve(service: *mut mbm_service, pdu: *mut u8, info: *const c_void) -> usize {
    let table = service.cast::<mbm_registerTable>();
    let kind = TableKind::from_code((*table).service.kind);
    let operation = table::operation(kind, *pdu);
    let (pdu, length) = request(pdu, info);
    let cells = &mut Table(table, info);
    table::serve_as(operation, kind, cells, pdu, length).code()
}

/// Serves functions 16 and 17 (hex) of a table of holding registers.
unsafe fn serve_mask_and_read_write(
    table: *mut mbm_registerTable,
    pdu: *mut u8,
    info: *const c_void,
) -> usize {
    let (pdu, length) = request(pdu, info);
    let mut cells = TableSnapshot(table.read(), info);
    let cells: &mut dyn TableAccess = &mut cells;
    table::serve_mask_and_read_write(cells, pdu, length).code()
}

/// Serves holding registers, functions 16 and 17 (hex) too.
unsafe extern "C" fn serve_holding_registers(
    service: *mut mbm_service,
    pdu: *mut u8,
    info: *const c_void,
) -> usize {
    if !table::is_mask_or_read_write(*pdu) {
        serve(service, pdu, info)
    } else if is_ignored_broadcast(info, *pdu) {
        Reply::NOT_HANDLED.code()
    } else {
        serve_mask_and_read_write(service.cast(), pdu, info)
    }
}

/// Adds a table to a unit.
unsafe extern "C" fn add_table(
    unit: *mut mbm_unit,
    table: *mut mbm_registerTable,
    kind: TableKind,
) -> u8 {
    add_as(unit, table.cast(), kind.code(), serve).code()
}

functions! {
    (unit: *mut mbm_unit)

    /// Serves coils: functions 01, 05 and 0F (hex).
    ///
    /// @return a status; see mbm_unit_serveFiles. MBM_BUSY for a table that is served as another
    ///         kind
    fn mbm_unit_serveCoils(table: *mut mbm_bitTable) = add_table(table.cast(), TableKind::COILS);

    /// Serves discrete inputs: function 02.
    ///
    /// @return a status; see mbm_unit_serveCoils
    fn mbm_unit_serveDiscreteInputs(table: *mut mbm_bitTable)
        = add_table(table.cast(), TableKind::DISCRETE_INPUTS);

    /// Serves holding registers: functions 03, 06 and 10 (hex). For functions 16 and 17 too,
    /// call mbm_registerTable_serveMaskAndReadWrite afterwards.
    ///
    /// @return a status; see mbm_unit_serveCoils
    fn mbm_unit_serveHoldingRegisters(table: *mut mbm_registerTable)
        = add_table(table, TableKind::HOLDING_REGISTERS);

    /// Serves input registers: function 04.
    ///
    /// @return a status; see mbm_unit_serveCoils
    fn mbm_unit_serveInputRegisters(table: *mut mbm_registerTable)
        = add_table(table, TableKind::INPUT_REGISTERS);
}

/// Adds functions 16 and 17 (hex), Mask Write Register and Read/Write Multiple Registers,
/// to a table of holding registers, on every unit that serves the table. It is a function
/// of its own so that firmware without these two is smaller. Call it again after you have
/// zeroed the table.
///
/// @param table  holding registers that mbm_unit_serveHoldingRegisters accepted
/// @return a status; MBM_INVALID_ARGUMENT for any other table
#[no_mangle]
pub unsafe extern "C" fn mbm_registerTable_serveMaskAndReadWrite(
    table: *mut mbm_registerTable,
) -> u8 {
    if table.is_null() || (*table).service.kind != TableKind::HOLDING_REGISTERS.code() {
        return Status::INVALID_ARGUMENT.code();
    }
    (*table).service.serve = Some(serve_holding_registers);
    Status::OK.code()
}
