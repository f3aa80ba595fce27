//! Calls the hooks of tables in arrays. Only programs that set such hooks contain this code.

use super::hooks::{call_hook, mbm_access, mbm_accessHooks, mbm_recordHooks, Hook};
use super::tables::{mbm_bitTable, mbm_registerTable, AccessWithHooks, Table};
use core::ffi::c_void;
use core::mem::transmute;
use core::ptr::{null, null_mut};
use core::slice::from_raw_parts_mut;
use mbm::error::Status;
use mbm::server::table::{TableAccess, TableKind, TableOperation, WRITTEN};
use mbm::server::Reply;

/// The function of a table with hooks: see [`AccessWithHooks`].
///
/// # Safety
/// `table` is a table with hooks. `info` is as for [`call_hook`]. The PDU has a function code and
/// an address, and unless the operation writes one cell, a quantity. A write has its data; for
/// the response of a read there is space.
unsafe fn access(
    table: *mut mbm_registerTable,
    info: *const c_void,
    operation: TableOperation,
    pdu: *mut u8,
) -> Reply {
    // The copy has the fields that the table had when the request came: a hook may change those
    // of the table.
    let hooks = (*table).hooks.hooks;
    let mut copy = table.read();
    copy.hooks.call = None;
    let reads = operation.reads();
    let word = |at| u16::from_be_bytes([*pdu.add(at), *pdu.add(at + 1)]);
    let quantity = match operation {
        TableOperation::WRITE_ONE => 1,
        _ => word(3),
    };
    let mut access = mbm_access {
        connection: null_mut(),
        data: null(),
        address: word(1),
        quantity,
        file: 0,
        unit: 0,
        function: *pdu,
    };
    let mut hook = Hook::BeforeRead;
    if !reads {
        hook = Hook::BeforeWrite;
        access.data = pdu.add(operation.data());
    }
    let refused = call_hook(hooks, info, hook, &raw mut access);
    if refused != 0 {
        return Reply::exception(refused);
    }
    if operation == TableOperation::ASK {
        return Reply::NOT_HANDLED;
    }
    let quantity = quantity.into();
    let bytes = TableKind::from_code(copy.service.kind).bytes(quantity);
    let pdu = from_raw_parts_mut(pdu, operation.data() + bytes);
    let reply = Table(&raw mut copy, info).access(operation, quantity, bytes, pdu);
    if reply == WRITTEN && !reads {
        call_hook(hooks, info, Hook::AfterWrite, &raw mut access);
    }
    reply
}

/// The hooks of a table.
fn table_hooks(hooks: *const mbm_accessHooks) -> mbm_recordHooks {
    // SAFETY: both are pointers to functions; tables.rs gives `call` its type again.
    let call = unsafe { transmute::<AccessWithHooks, unsafe extern "C" fn()>(access) };
    mbm_recordHooks {
        hooks,
        call: (!hooks.is_null()).then_some(call),
    }
}

/// Sets the functions that are called around a read or a write of registers, or removes them.
///
/// @param table  the table, registered already or not. Zeroing the struct removes the hooks
/// @param hooks  must stay valid for as long as the table is served; NULL for no hooks
#[no_mangle]
pub unsafe extern "C" fn mbm_registerTable_setHooks(
    table: *mut mbm_registerTable,
    hooks: *const mbm_accessHooks,
) -> u8 {
    if table.is_null() {
        return Status::INVALID_ARGUMENT.code();
    }
    (*table).hooks = table_hooks(hooks);
    Status::OK.code()
}

/// Sets the functions that are called around a read or a write of bits, or removes them.
///
/// @param table  the table, registered already or not. Zeroing the struct removes the hooks
/// @param hooks  must stay valid for as long as the table is served; NULL for no hooks
#[no_mangle]
pub unsafe extern "C" fn mbm_bitTable_setHooks(
    table: *mut mbm_bitTable,
    hooks: *const mbm_accessHooks,
) -> u8 {
    // Both structs have the same layout.
    mbm_registerTable_setHooks(table.cast(), hooks)
}
