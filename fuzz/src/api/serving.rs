//! The hooks of units: before and after writes, data callbacks, user-defined functions.

use super::world::{Grant, World};
use mbm_c::*;
use std::ffi::c_void;

/// Enters a hook of a unit. It may use every object but the server that called it.
fn enter<'a>() -> &'a World {
    let w = World::current();
    w.hook(Grant::Nothing, 24);
    w
}

/// Reads every byte that the hook was given.
fn read_all(data: *const u8, length: usize) -> u8 {
    assert!(!data.is_null() || length == 0);
    if length == 0 {
        return 0;
    }
    // SAFETY: the header promises this many bytes.
    let bytes = unsafe { std::slice::from_raw_parts(data, length) };
    bytes.iter().fold(0, |all, byte| all ^ byte)
}

/// Sometimes an exception code, which may be invalid; otherwise 0.
fn refusal(w: &World) -> u8 {
    match w.random() % 16 {
        0 => w.random() as u8,
        1 => 4,
        _ => 0,
    }
}

/// Reads the access that a hook was given, before and after other calls. That of a write has data.
unsafe fn read_access<'a>(access: *const mbm_access, writes: bool) -> &'a World {
    let read = || {
        // SAFETY: the header promises an access.
        let access = unsafe { &*access };
        assert!(access.quantity > 0 && access.data.is_null() != writes);
        if writes {
            let is_bits = matches!(access.function, 0x05 | 0x0F);
            let count = usize::from(access.quantity);
            read_all(
                access.data,
                if is_bits {
                    count.div_ceil(8)
                } else {
                    2 * count
                },
            );
        }
    };
    read();
    let w = enter();
    read();
    w
}

unsafe extern "C" fn before_read(_: *mut c_void, access: *const mbm_access) -> u8 {
    // SAFETY: as the header promises.
    refusal(unsafe { read_access(access, false) })
}

unsafe extern "C" fn before_write(_: *mut c_void, access: *const mbm_access) -> u8 {
    // SAFETY: as the header promises.
    refusal(unsafe { read_access(access, true) })
}

unsafe extern "C" fn after_write(_: *mut c_void, access: *const mbm_access) {
    // SAFETY: as the header promises.
    unsafe { read_access(access, true) };
}

/// Hooks of a record, each present or not; NULL if none is.
pub fn hooks(w: &World) -> *const mbm_accessHooks {
    let present = w.byte();
    if present & 7 == 0 {
        return std::ptr::null();
    }
    w.put(mbm_accessHooks {
        context: std::ptr::null_mut(),
        beforeRead: (present & 1 != 0).then_some(before_read),
        beforeWrite: (present & 2 != 0).then_some(before_write),
        afterWrite: (present & 4 != 0).then_some(after_write),
    })
}

pub unsafe extern "C" fn is_valid(_: *mut c_void, address: u16) -> u8 {
    enter();
    u8::from(address % 64 != 63)
}

pub unsafe extern "C" fn get(_: *mut c_void, address: u16) -> u16 {
    enter();
    address
}

pub unsafe extern "C" fn set(_: *mut c_void, _: u16, _: u16) {
    enter();
}

pub unsafe extern "C" fn restart(_: *mut c_void, _: u8) {
    enter();
}

/// A user-defined function. It returns data, an exception, no response, "pending", or an
/// invalid value.
pub unsafe extern "C" fn custom(
    _: *mut c_void,
    request: *const mbm_request,
    response: *mut u8,
    capacity: u16,
) -> u16 {
    let w = enter();
    // SAFETY: the header promises the request and the capacity.
    unsafe {
        read_all((*request).data, (*request).length.into());
        if capacity > 0 {
            std::slice::from_raw_parts_mut(response, capacity.into()).fill(0x77);
        }
    }
    match w.random() % 16 {
        0 => MBM_REPLY_NONE,
        1 | 2 => MBM_REPLY_PENDING,
        7 => MBM_REPLY_DECLINED,
        3 => MBM_REPLY_EXCEPTION | (w.random() % 256) as u16,
        4 => w.random() as u16,
        5 => 255,
        6 => capacity.min(252),
        _ => capacity.min((w.random() % 32) as u16),
    }
}
