//! The four tables, with cells that the program's callbacks get and set one by one.

use super::hooks::{mbm_accessHooks, mbm_recordHooks, Hook, HookCaller};
use super::units::{add_as, is_ignored_broadcast, request};
use super::{mbm_service, mbm_unit};
use core::ffi::c_void;
use core::ptr::null;
use mbm::error::Status;
use mbm::server::table::{self, DataModel, Direction, TableAccess, TableKind};
use mbm::server::Reply;

/// Cells that your functions get and set one by one, in place of an array. A cell is a
/// register, a coil or a discrete input. Initialise the struct with MBM_INIT, set the fields
/// that you need, and pass it to mbm_unit_serveCallbacks.
#[repr(C)]
pub struct mbm_dataCallbacks {
    /// Private.
    pub service: mbm_service,
    /// Passed to each function. Any value; may be NULL.
    pub context: *mut c_void,
    /// Optional; NULL if every address exists. Otherwise returns 1 if this address
    /// exists, else 0. A request for an address that does not exist is answered with
    /// exception 02.
    pub isValid: Option<unsafe extern "C" fn(context: *mut c_void, address: u16) -> u8>,
    /// Required. Returns the value of an existing cell; for a bit, 0 is off and any other value on.
    pub get: Option<unsafe extern "C" fn(context: *mut c_void, address: u16) -> u16>,
    /// Sets an existing cell; a bit to 0 or 1. Coils and holding registers without it are
    /// read-only: the unit answers functions that write them with exception 01, unless a
    /// later record serves these functions.
    pub set: Option<unsafe extern "C" fn(context: *mut c_void, address: u16, value: u16)>,
    /// Private: see mbm_dataCallbacks_setHooks.
    pub hooks: mbm_recordHooks,
}

/// The callbacks of C. They may use the struct, so no reference to it is kept.
struct Callbacks(*mut mbm_dataCallbacks, HookCaller);

// SAFETY, of all functions here: the header requires that the struct stays valid, at the
// same address, and that its functions do what their comments say.
impl Callbacks {
    fn is_valid(&self, address: u16) -> bool {
        // SAFETY: see above.
        unsafe {
            let check = (*self.0).isValid;
            check.is_none_or(|check| check((*self.0).context, address) != 0)
        }
    }
    fn get(&self, address: u16) -> u16 {
        // SAFETY: see above.
        unsafe {
            (*self.0)
                .get
                .map_or(0, |get| get((*self.0).context, address))
        }
    }
    fn set(&self, address: u16, value: u16) {
        // SAFETY: see above.
        unsafe {
            if let Some(set) = (*self.0).set {
                set((*self.0).context, address, value);
            }
        }
    }
}

impl DataModel for Callbacks {
    fn contains(&self, address: u16, quantity: u16) -> bool {
        let last = address.checked_add(quantity.wrapping_sub(1));
        last.is_some_and(|last| (address..=last).all(|cell| self.is_valid(cell)))
    }

    fn transfer(&mut self, direction: Direction, address: u16, quantity: u16, data: &mut [u8]) {
        // SAFETY: see above.
        let bits = TableKind::from_code(unsafe { (*self.0).service.kind }).is_bits();
        for index in 0..quantity {
            let cell = address.wrapping_add(index);
            if bits {
                let Some(byte) = data.get_mut(usize::from(index / 8)) else {
                    return;
                };
                let bit = 1 << (index % 8);
                if direction == Direction::Write {
                    self.set(cell, u16::from(*byte & bit != 0));
                } else {
                    if bit == 1 {
                        *byte = 0;
                    }
                    if self.get(cell) != 0 {
                        *byte |= bit;
                    }
                }
            } else {
                let at = 2 * usize::from(index);
                let Some([high, low]) = data.get_mut(at..at + 2) else {
                    return;
                };
                if direction == Direction::Write {
                    self.set(cell, u16::from_be_bytes([*high, *low]));
                } else {
                    [*high, *low] = self.get(cell).to_be_bytes();
                }
            }
        }
    }

    fn before(&mut self, direction: Direction, address: u16, quantity: u16, data: &[u8]) -> u8 {
        let (mut hook, mut data) = (Hook::BeforeRead, data.as_ptr());
        if direction == Direction::Write {
            hook = Hook::BeforeWrite;
        } else {
            data = null();
        }
        self.1.call(hook, address, quantity, data)
    }

    fn after_write(&mut self, address: u16, quantity: u16, data: &[u8]) {
        self.1
            .call(Hook::AfterWrite, address, quantity, data.as_ptr());
    }
}

/// Serves a request to the cells.
unsafe extern "C" fn serve(service: *mut mbm_service, pdu: *mut u8, info: *const c_void) -> usize {
    let record = service.cast::<mbm_dataCallbacks>();
    let kind = TableKind::from_code((*record).service.kind);
    if is_ignored_broadcast(info, *pdu) {
        return Reply::NOT_HANDLED.code();
    }
    let function = *pdu;
    let is_mask_or_read_write =
        kind == TableKind::HOLDING_REGISTERS && table::is_mask_or_read_write(function);
    if (*record).set.is_none() && function != kind.code() {
        return Reply::NOT_HANDLED.code();
    }
    let mut cells = Callbacks(record, HookCaller::new((*record).hooks, info, function));
    let (pdu, length) = request(pdu, info);
    let reply = if is_mask_or_read_write {
        let cells: &mut dyn TableAccess = &mut cells;
        table::serve_mask_and_read_write(cells, pdu, length)
    } else {
        table::serve(kind, &mut cells, pdu, length)
    };
    reply.code()
}

/// Serves cells that your functions get and set.
///
/// @param cells  must stay valid for as long as the unit is used
/// @param table  the table, named by the function that reads it: 1 coils (functions 01, 05, 0F), 2
///               discrete inputs (02), 3 holding registers (03, 06, 10, 16, 17), 4 input registers
///               (04); functions in hex
/// @return a status; see mbm_unit_serveCoils. MBM_INVALID_ARGUMENT for a NULL `get`
#[no_mangle]
pub unsafe extern "C" fn mbm_unit_serveCallbacks(
    unit: *mut mbm_unit,
    cells: *mut mbm_dataCallbacks,
    table: u8,
) -> u8 {
    if cells.is_null() || (*cells).get.is_none() || !(1..=4).contains(&table) {
        return Status::INVALID_ARGUMENT.code();
    }
    add_as(unit, cells.cast(), table, serve).code()
}

/// Sets the functions that are called around a read or a write of cells, or removes them.
///
/// @param cells  the cells, registered already or not. Zeroing the struct removes the hooks
/// @param hooks  must stay valid for as long as the cells are served; NULL for no hooks
#[no_mangle]
pub unsafe extern "C" fn mbm_dataCallbacks_setHooks(
    cells: *mut mbm_dataCallbacks,
    hooks: *const mbm_accessHooks,
) -> u8 {
    if cells.is_null() {
        return Status::INVALID_ARGUMENT.code();
    }
    (*cells).hooks = mbm_recordHooks::new(hooks);
    Status::OK.code()
}
