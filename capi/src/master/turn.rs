//! Several masters that take turns.

use super::{mbm_master, Object};
use crate::pointers::check;
use core::ptr::null_mut;
use mbm::error::Status;

/// What masters know of each other that take turns on one line, or in one frame
/// buffer. Storage is yours and must be zero before first use.
///
/// All objects of one turn are used from one thread. Before the storage of an object
/// goes, call mbm_master_endTurn.
#[repr(C)]
pub struct mbm_turn {
    /// The object that has the turn; NULL if none has.
    pub master: *mut mbm_master,
    /// When objects that had the turn before used the line last.
    pub lastUse: u32,
}

/// Takes the turn, before a request. The gap before that request counts from the last
/// use of the line by any object that had the turn before.
///
/// @param master  the object, with buffers or begun
/// @param turn    the turn of all objects that share a line or a frame buffer
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
                // Within a hook of that object, a reference to its core lives.
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

/// Gives the turn back, before the storage of the object goes; does nothing if the object
/// has not got the turn. A request under way is forgotten: cancel it before, so that the
/// driver is off.
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
