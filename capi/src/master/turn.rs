//! Several masters that use one line or one frame buffer in turn.

use super::{mbm_master, Object};
use crate::pointers::check;
use core::ptr::null_mut;
use mbm::error::Status;

/// Records which of several masters uses a shared line, or a shared frame buffer. You own the
/// storage. Initialise it with MBM_INIT.
///
/// Use all objects of one turn from one thread. Call mbm_master_endTurn before you release the
/// storage of an object.
#[repr(C)]
pub struct mbm_turn {
    /// The object that has the turn; NULL if none has it.
    pub master: *mut mbm_master,
    /// When an object that had the turn before used the line last, in microseconds.
    pub lastUse: u32,
}

/// Gives the turn to an object. Call it before a request. The gap before that request counts
/// from the last use of the line by any object that had the turn before.
///
/// @param master  the object, with buffers or begun
/// @param turn    the turn that all objects on the line, or with the frame buffer, share
/// @return MBM_OK; MBM_BUSY, with nothing changed, while another object has the turn
///         and a request under way; MBM_INVALID_ARGUMENT or MBM_NOT_INITIALISED
#[no_mangle]
pub unsafe extern "C" fn mbm_master_takeTurn(master: *mut mbm_master, turn: *mut mbm_turn) -> u8 {
    if turn.is_null() {
        return Status::INVALID_ARGUMENT.code();
    }
    // SAFETY: as the header demands.
    unsafe {
        let status = check(master);
        if status != Status::OK {
            return status.code();
        }
        let before = (*turn).master;
        if before != master {
            if !before.is_null() {
                // If that object is calling a hook, a reference to its core lives.
                if check(before) == Status::BUSY || (*Object::core_of(before)).is_pending() {
                    return Status::BUSY.code();
                }
                end(turn);
            }
            (*turn).master = master;
            (*Object::core_of(master)).line_used_at((*turn).lastUse);
        }
    }
    Status::OK.code()
}

/// Ends the turn of an object, before you release its storage. It does nothing if the object
/// does not have the turn. It does not end a request under way: call mbm_master_cancel
/// before, so that the driver is switched off.
///
/// @param master  the object
/// @param turn    as for mbm_master_takeTurn
/// @return MBM_OK, MBM_INVALID_ARGUMENT or MBM_NOT_INITIALISED
#[no_mangle]
pub unsafe extern "C" fn mbm_master_endTurn(master: *mut mbm_master, turn: *mut mbm_turn) -> u8 {
    if turn.is_null() {
        return Status::INVALID_ARGUMENT.code();
    }
    // SAFETY: as the header demands.
    unsafe {
        let status = check(master);
        if status == Status::OK && (*turn).master == master {
            end(turn);
        }
        status.code()
    }
}

/// Ends the turn of the object that has it.
///
/// # Safety
/// An object has the turn.
#[cfg_attr(target_os = "none", inline(never))]
unsafe fn end(turn: *mut mbm_turn) {
    // SAFETY: as the caller promises.
    unsafe {
        (*turn).lastUse = (*Object::core_of((*turn).master)).last_use();
        (*turn).master = null_mut();
    }
}
