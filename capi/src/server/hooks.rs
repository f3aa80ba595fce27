//! The hooks that the program sets for the cells of its tables, callbacks and files.

use super::buffers::Core;
use core::ffi::c_void;
use core::mem::{offset_of, transmute, MaybeUninit};
use mbm::pdu::files::Record;
use mbm::server::{Indication, Reply};

/// A request that reads or writes cells of yours, as your hooks get it. A cell is a register,
/// a coil, a discrete input or a record of a file.
#[repr(C)]
pub struct mbm_access {
    /// The new values, in the hooks of a write: registers and records with the high byte
    /// first, bits with the lowest bit of the first byte first. NULL in beforeRead. Valid
    /// until the hook returns.
    pub data: *const u8,
    /// The line or connection that the request came from: the `context` of the port of the
    /// server that received it, or the `connection` of mbm_unit_respond.
    pub connection: *mut c_void,
    /// The address of the first cell; for a file, the number of the first record.
    pub address: u16,
    /// How many cells, 1 to 2000.
    pub quantity: u16,
    /// The number of the file; 0 for tables and callbacks.
    pub file: u16,
    /// The unit id in the request. 0 on a serial line is a broadcast.
    pub unit: u8,
    /// The function code of the request.
    pub function: u8,
}

/// Functions of yours that the server calls around a read or a write of cells. Each is
/// optional. Pass the struct to mbm_registerTable_setHooks, mbm_bitTable_setHooks,
/// mbm_dataCallbacks_setHooks or mbm_files_setHooks. It may be a constant, and any number
/// of records may share it.
///
/// The server calls the hooks only for a request that is right and whose cells all exist.
/// Functions 16 and 17 (hex) read and write: for them the server calls beforeRead,
/// beforeWrite and afterWrite in this order. A request of function 14 or 15 (hex) has one or
/// more groups of records, and the server calls each hook once for each group. It calls
/// beforeWrite for all groups before it writes any of them.
///
/// A hook may change cells. It may call any function of this library but those on the
/// server that calls it, which return MBM_BUSY. If it changes its record, or sets other
/// hooks for it, that counts from the next request on.
#[repr(C)]
pub struct mbm_accessHooks {
    /// Your pointer, passed to each hook; may be NULL.
    pub context: *mut c_void,
    /// Called before cells are read. It may refresh them. Returns 0 to allow the read, or an
    /// exception code to refuse the whole request; a number above 127 becomes exception 04.
    pub beforeRead:
        Option<unsafe extern "C" fn(context: *mut c_void, access: *const mbm_access) -> u8>,
    /// Called before cells are written. Returns as beforeRead.
    pub beforeWrite:
        Option<unsafe extern "C" fn(context: *mut c_void, access: *const mbm_access) -> u8>,
    /// Called after cells were written.
    pub afterWrite: Option<unsafe extern "C" fn(context: *mut c_void, access: *const mbm_access)>,
}

/// The hooks of a record. Private.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct mbm_recordHooks {
    /// The hooks.
    pub hooks: *const mbm_accessHooks,
    /// Calls the hooks. NULL if there are none. A program in which no record has hooks does
    /// not contain the function.
    pub call: Option<unsafe extern "C" fn()>,
}

/// A function that calls a hook as [`call_hook`].
type CallHook = unsafe extern "C" fn(
    hooks: *const mbm_accessHooks,
    info: *const c_void,
    hook: Hook,
    access: *mut mbm_access,
) -> u8;

impl mbm_recordHooks {
    /// The hooks of a record that calls them through [`HookCaller`]. `hooks` may be NULL for
    /// none.
    pub(super) fn new(hooks: *const mbm_accessHooks) -> mbm_recordHooks {
        let call: CallHook = call_hook;
        // SAFETY: both are pointers to functions; `call` has the right type again when it is
        // called.
        let call = unsafe { transmute::<CallHook, unsafe extern "C" fn()>(call) };
        mbm_recordHooks {
            hooks,
            call: (!hooks.is_null()).then_some(call),
        }
    }
}

/// The hooks that a record had when a request came, and the request.
pub(super) struct HookCaller {
    hooks: mbm_recordHooks,
    info: *const c_void,
    /// `function` and `file` are set, from `call` on also the other fields.
    access: MaybeUninit<mbm_access>,
}

impl HookCaller {
    /// # Safety
    /// [`mbm_recordHooks::new`] made the hooks, or they are zeroed. They stay valid. `info` is
    /// as for [`connection`].
    pub(super) unsafe fn new(hooks: mbm_recordHooks, info: *const c_void, function: u8) -> Self {
        let mut access = MaybeUninit::<mbm_access>::uninit();
        let fields = access.as_mut_ptr();
        // SAFETY: fields of that storage.
        unsafe {
            (*fields).function = function;
            (*fields).file = 0;
        }
        HookCaller {
            hooks,
            info,
            access,
        }
    }

    /// Calls a hook, if there are hooks. Returns 0, or the exception code with which the hook
    /// refuses the request. `data` is NULL for a read.
    pub(super) fn call(&mut self, hook: Hook, address: u16, quantity: u16, data: *const u8) -> u8 {
        let Some(call) = self.hooks.call else {
            return 0;
        };
        let access = self.access.as_mut_ptr();
        // SAFETY: as `new` requires.
        unsafe {
            (*access).address = address;
            (*access).quantity = quantity;
            (*access).data = data;
            let call = transmute::<unsafe extern "C" fn(), CallHook>(call);
            call(self.hooks.hooks, self.info, hook, access)
        }
    }

    /// As [`HookCaller::call`], for records of a file.
    pub(super) fn call_of_file(&mut self, hook: Hook, record: Record, data: *const u8) -> u8 {
        // SAFETY: a field of that storage.
        unsafe { (*self.access.as_mut_ptr()).file = record.file };
        self.call(hook, record.record, record.length, data)
    }
}

/// Which hook is called.
#[derive(Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
pub(super) enum Hook {
    /// `beforeRead`.
    BeforeRead,
    /// `beforeWrite`.
    BeforeWrite,
    /// `afterWrite`.
    AfterWrite,
}

/// The connection of a request: the context of the port of the server that received it.
///
/// # Safety
/// `info` is the field `request` of a server, as for [`super::records::Serve`].
pub(super) unsafe fn connection(info: *const c_void) -> *mut c_void {
    // The pointer is valid for the whole server.
    let server = info.byte_sub(offset_of!(Core, request)).cast::<Core>();
    (*server).port.context
}

/// Calls a hook. The function sets the fields `connection` and `unit` of `access`, which are
/// known from `info`. Returns 0, or the exception code with which the hook refuses the request.
///
/// # Safety
/// `hooks` and `access` are valid, and the functions behave as the header says; `info` is as
/// for [`connection`].
pub(super) unsafe extern "C" fn call_hook(
    hooks: *const mbm_accessHooks,
    info: *const c_void,
    hook: Hook,
    access: *mut mbm_access,
) -> u8 {
    // No reference to the hooks or the server is kept.
    (*access).connection = connection(info);
    (*access).unit = (*info.cast::<Indication>()).to;
    let context = (*hooks).context;
    let before = match hook {
        Hook::BeforeRead => (*hooks).beforeRead,
        Hook::BeforeWrite => (*hooks).beforeWrite,
        Hook::AfterWrite => {
            if let Some(after) = (*hooks).afterWrite {
                after(context, access);
            }
            return 0;
        }
    };
    match before.map_or(0, |before| before(context, access)) {
        refused @ 0..=127 => refused,
        _ => Reply::SERVER_DEVICE_FAILURE.exception_code(),
    }
}
