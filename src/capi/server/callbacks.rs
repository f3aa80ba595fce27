//! The four tables, cell by cell, where the caller's callbacks hold them.

use super::units::{add, request};
use super::{mbm_service, mbm_unit};
use crate::error::Status;
use crate::server::storage::{
    BitRead, BitWrite, Coils, DiscreteInputs, HoldingRegisters, InputRegisters, RegisterRead,
    RegisterWrite,
};
use crate::server::{Reply, Service};
use core::ffi::c_void;

/// Cells that your functions hold, one by one, in place of an array. Zero it, set
/// what you need, and hand it to mbm_server_serveCallbacks.
#[repr(C)]
pub struct mbm_cells {
    /// Not for you.
    pub service: mbm_service,
    /// Handed to each function. Yours, may be NULL.
    pub context: *mut c_void,
    /// Optional, NULL if every address is there: 1 if this one is. What is not
    /// there is answered with exception 02.
    pub isValid: Option<unsafe extern "C" fn(context: *mut c_void, address: u16) -> u8>,
    /// A cell that is there; of a bit, 0 or anything else.
    pub get: Option<unsafe extern "C" fn(context: *mut c_void, address: u16) -> u16>,
    /// Sets a cell that is there; a bit to 0 or 1. Not needed for what is only read.
    pub set: Option<unsafe extern "C" fn(context: *mut c_void, address: u16, value: u16)>,
    /// As in mbm_registerTable.
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
}

/// Cells of C, which its functions may look at: no reference to them is kept.
#[derive(Clone, Copy)]
struct ByC(*mut mbm_cells);

// SAFETY, of all functions here: the record is the caller's and stays where it
// is, as the header demands; its functions keep the contract of their comments.
impl ByC {
    fn is_valid(self, address: u16) -> bool {
        // SAFETY: see above.
        unsafe {
            let check = (*self.0).isValid;
            check.is_none_or(|check| check((*self.0).context, address) != 0)
        }
    }
    fn get(self, address: u16) -> u16 {
        // SAFETY: see above.
        unsafe {
            (*self.0)
                .get
                .map_or(0, |get| get((*self.0).context, address))
        }
    }
    fn set(self, address: u16, value: u16) {
        // SAFETY: see above.
        unsafe {
            if let Some(set) = (*self.0).set {
                set((*self.0).context, address, value);
            }
        }
    }
    fn before(self, address: u16, quantity: u16, data: &[u8]) -> u8 {
        // SAFETY: see above.
        unsafe {
            let hook = (*self.0).before;
            hook.map_or(0, |hook| {
                hook((*self.0).context, address, quantity, data.as_ptr())
            })
        }
    }
    fn after(self, address: u16, quantity: u16) {
        // SAFETY: see above.
        unsafe {
            if let Some(hook) = (*self.0).after {
                hook((*self.0).context, address, quantity);
            }
        }
    }
}

impl RegisterRead for ByC {
    fn is_valid(&self, address: u16) -> bool {
        ByC::is_valid(*self, address)
    }
    fn get(&self, address: u16) -> u16 {
        ByC::get(*self, address)
    }
}

impl RegisterWrite for ByC {
    fn set(&mut self, address: u16, value: u16) {
        ByC::set(*self, address, value);
    }
    fn before(&mut self, address: u16, quantity: u16, data: &[u8]) -> u8 {
        ByC::before(*self, address, quantity, data)
    }
    fn after(&mut self, address: u16, quantity: u16) {
        ByC::after(*self, address, quantity);
    }
}

impl BitRead for ByC {
    fn is_valid(&self, address: u16) -> bool {
        ByC::is_valid(*self, address)
    }
    fn get(&self, address: u16) -> bool {
        ByC::get(*self, address) != 0
    }
}

impl BitWrite for ByC {
    fn set(&mut self, address: u16, on: bool) {
        ByC::set(*self, address, on.into());
    }
    fn before(&mut self, address: u16, quantity: u16, data: &[u8]) -> u8 {
        ByC::before(*self, address, quantity, data)
    }
    fn after(&mut self, address: u16, quantity: u16) {
        ByC::after(*self, address, quantity);
    }
}

/// Serves cells as what `table` makes of them.
///
/// # Safety
/// `service` is the head of a record of them; `pdu` has the bytes and room of
/// `heading`.
unsafe fn serve<T: Service>(
    service: *mut mbm_service,
    pdu: *mut u8,
    heading: *const c_void,
    table: fn(ByC) -> T,
) -> u16 {
    // SAFETY: as the caller promises.
    let (pdu, length) = unsafe { request(pdu, heading) };
    let reply: Reply = table(ByC(service.cast())).serve(pdu, length);
    reply.code()
}

unsafe extern "C" fn coils(service: *mut mbm_service, pdu: *mut u8, heading: *const c_void) -> u16 {
    // SAFETY: as for `serve`, here and below.
    unsafe { serve(service, pdu, heading, Coils) }
}

unsafe extern "C" fn inputs(
    service: *mut mbm_service,
    pdu: *mut u8,
    heading: *const c_void,
) -> u16 {
    // SAFETY: see above.
    unsafe { serve(service, pdu, heading, DiscreteInputs) }
}

unsafe extern "C" fn holding(
    service: *mut mbm_service,
    pdu: *mut u8,
    heading: *const c_void,
) -> u16 {
    // SAFETY: see above.
    unsafe { serve(service, pdu, heading, HoldingRegisters) }
}

unsafe extern "C" fn input_registers(
    service: *mut mbm_service,
    pdu: *mut u8,
    heading: *const c_void,
) -> u16 {
    // SAFETY: see above.
    unsafe { serve(service, pdu, heading, InputRegisters) }
}

/// Serves cells that your functions hold.
///
/// @param unit   the unit
/// @param cells  yours, for as long as the unit is used
/// @param table  the function that reads them: 1 coils (01, 05, 0F), 2 discrete
///               inputs (02), 3 holding registers (03, 06, 10, 16, 17), 4 input
///               registers (04)
/// @return MBM_OK, or MBM_INVALID_ARGUMENT for a NULL pointer, no `get`, no `set`
///         where it is needed, or another table
#[no_mangle]
pub unsafe extern "C" fn mbm_server_serveCallbacks(
    unit: *mut mbm_unit,
    cells: *mut mbm_cells,
    table: u8,
) -> u8 {
    // SAFETY: as the header demands.
    unsafe {
        let useless =
            cells.is_null() || (*cells).get.is_none() || (table & 1 != 0 && (*cells).set.is_none());
        match table {
            _ if useless => Status::INVALID_ARGUMENT.code(),
            1 => add(unit, cells.cast(), coils),
            2 => add(unit, cells.cast(), inputs),
            3 => add(unit, cells.cast(), holding),
            4 => add(unit, cells.cast(), input_registers),
            _ => Status::INVALID_ARGUMENT.code(),
        }
    }
}
