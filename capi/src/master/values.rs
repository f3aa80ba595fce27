//! Views of the master's words as registers, to get and set values: see `mbm_registers`.

use super::mbm_master;
use super::Object;
use crate::pointers::{put_result, with};
use crate::registers::{self, mbm_registers, MBM_REGISTERS_INTO_WORDS, MBM_REGISTERS_OF_WORDS};
use crate::storage::MasterBuffers;
use mbm::data::order::Order;
use mbm::error::Status;

/// Sets the byte and word order of values in the views that mbm_master_getResponseRegisters
/// and mbm_master_getTransmitRegisters fill in from now on.
///
/// @param master  the object
/// @param order   one of MBM_ORDER_...; the default is MBM_ORDER_ABCD
/// @return MBM_OK; MBM_INVALID_ARGUMENT, also for an unknown order; MBM_NOT_INITIALISED
#[no_mangle]
pub unsafe extern "C" fn mbm_master_setWordOrder(master: *mut mbm_master, order: u8) -> u8 {
    // SAFETY: as the header demands.
    unsafe {
        with(master, |master| {
            match registers::order(order, Order::Abcd) {
                Ok(_) => {
                    master.order = order;
                    Status::OK
                }
                Err(status) => status,
            }
        })
    }
}

/// The view of words as registers with addresses from `first` on. It has at most as many words
/// as there are addresses up to 65535.
fn view(
    master: &mut Object,
    first: u16,
    kind: u8,
    words: fn(&MasterBuffers) -> (*mut u16, u8),
) -> mbm_registers {
    let (words, count) = words(master.core.storage());
    // With `first` 0, 65536 would not fit into 16 bits; the words are fewer in any case.
    let count = u16::from(count).min((u16::MAX - first).saturating_add(1));
    let order = master.order;
    let data = words.cast_const().cast();
    mbm_registers {
        data,
        first,
        count,
        kind,
        order,
    }
}

/// Fills in a view of the response words as registers, from which you can get values. The
/// view copies no words: it also shows those that a later read receives.
///
/// The view includes all words of the buffer, also words that the last read did not
/// change. Get values only after the read has succeeded.
///
/// @param master     the object; do not change its buffers while you use the view
/// @param first      the address in the device of word 0: the address of the read, or 0 if
///                   you want to count from word 0
/// @param registers  the view to fill in; unchanged if the status is not MBM_OK
/// @return MBM_OK, MBM_INVALID_ARGUMENT or MBM_NOT_INITIALISED
#[no_mangle]
pub unsafe extern "C" fn mbm_master_getResponseRegisters(
    master: *const mbm_master,
    first: u16,
    registers: *mut mbm_registers,
) -> u8 {
    // SAFETY: as the header demands; every object is writable storage.
    unsafe {
        with(master.cast_mut(), |master| {
            put_result(registers, || {
                Ok(view(master, first, MBM_REGISTERS_OF_WORDS, |storage| {
                    (storage.response, storage.response_words)
                }))
            })
            .err()
            .unwrap_or(Status::OK)
        })
    }
}

/// Fills in a view of the transmit words as registers, in which you can set values for the
/// functions that write. The queue of mbm_master_send does not change.
///
/// @param master     the object; do not change its buffers while you use the view
/// @param first      the address in the device of word 0: the address of the write, or 0 if
///                   you want to count from word 0
/// @param registers  the view to fill in; unchanged if the status is not MBM_OK
/// @return MBM_OK, MBM_INVALID_ARGUMENT or MBM_NOT_INITIALISED
#[no_mangle]
pub unsafe extern "C" fn mbm_master_getTransmitRegisters(
    master: *const mbm_master,
    first: u16,
    registers: *mut mbm_registers,
) -> u8 {
    // SAFETY: as the header demands; every object is writable storage.
    unsafe {
        with(master.cast_mut(), |master| {
            put_result(registers, || {
                Ok(view(master, first, MBM_REGISTERS_INTO_WORDS, |storage| {
                    (storage.transmit, storage.transmit_words)
                }))
            })
            .err()
            .unwrap_or(Status::OK)
        })
    }
}
