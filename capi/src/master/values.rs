//! The master's words as values: see `mbm_registers`.

use super::mbm_master;
use super::Object;
use crate::pointers::{put_result, with};
use crate::registers::{self, mbm_registers, MBM_REGISTERS_INTO_WORDS, MBM_REGISTERS_OF_WORDS};
use crate::storage::MasterBuffers;
use mbm::data::order::Order;
use mbm::error::Status;

/// Sets the order of values in the views that mbm_master_getResponseRegisters
/// and mbm_master_getTransmitRegisters give from now on.
///
/// @param master  the object
/// @param order   one of MBM_ORDER_...; MBM_ORDER_ABCD at first
/// @return MBM_OK, MBM_INVALID_ARGUMENT, also for another order, or
///         MBM_NOT_INITIALISED
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

/// Words as registers from `first` on, as many as there are addresses for.
fn view(
    master: &mut Object,
    first: u16,
    kind: u8,
    words: fn(&MasterBuffers) -> (*mut u16, u8),
) -> mbm_registers {
    let (words, count) = words(master.core.storage());
    // Less than all addresses, which are one more than this.
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

/// Sees the response words as registers to get values from. Copies nothing: it
/// sees what a later read puts there.
///
/// All words of the buffer are there, those too that the last read did not
/// reach; look at values only once it has succeeded.
///
/// @param master     the object; its buffers stay as they are while the view is used
/// @param first      the device's address of word 0: that of the read, or 0 to
///                   count from word 0
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

/// Sees the transmit words as registers to set values in, for the functions
/// that write. The queue of send does not move.
///
/// @param master     the object; its buffers stay as they are while the view is used
/// @param first      the device's address of word 0: that of the write, or 0 to
///                   count from word 0
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
