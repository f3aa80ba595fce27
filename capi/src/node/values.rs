//! Views of the master's words as registers, to get and set values: see `mbm_registers`.

use super::mbm_node;
use super::Object;
use crate::pointers::{put_result, with};
use crate::registers::{self, mbm_registers, MBM_REGISTERS_INTO_WORDS, MBM_REGISTERS_OF_WORDS};
use crate::storage::NodeWords;
use mbm::data::order::Order;
use mbm::error::Status;

/// Sets the byte and word order of values in the views that mbm_node_getResponseRegisters
/// and mbm_node_getTransmitRegisters fill in from now on.
///
/// @param node  the object
/// @param order   one of MBM_ORDER_...; the default is MBM_ORDER_ABCD
/// @return MBM_OK; MBM_INVALID_ARGUMENT, also for an unknown order; MBM_NOT_INITIALISED
#[no_mangle]
pub unsafe extern "C" fn mbm_node_setWordOrder(node: *mut mbm_node, order: u8) -> u8 {
    // SAFETY: as the header demands.
    unsafe {
        with(node, |node| match registers::order(order, Order::Abcd) {
            Ok(_) => {
                node.order = order;
                Status::OK
            }
            Err(status) => status,
        })
    }
}

/// The view of words as registers with addresses from `first` on. It has at most as many words
/// as there are addresses up to 65535.
fn view(
    node: &mut Object,
    first: u16,
    kind: u8,
    words: fn(&NodeWords) -> (*mut u16, u8),
) -> mbm_registers {
    let (words, count) = words(&node.words);
    // With `first` 0, 65536 would not fit into 16 bits; the words are fewer in any case.
    let count = u16::from(count).min((u16::MAX - first).saturating_add(1));
    let order = node.order;
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
/// @param node  the object; do not change its buffers while you use the view
/// @param first      the address in the device of word 0: the address of the read, or 0 if
///                   you want to count from word 0
/// @param registers  the view to fill in; unchanged if the status is not MBM_OK
/// @return MBM_OK, MBM_INVALID_ARGUMENT or MBM_NOT_INITIALISED
#[no_mangle]
pub unsafe extern "C" fn mbm_node_getResponseRegisters(
    node: *const mbm_node,
    first: u16,
    registers: *mut mbm_registers,
) -> u8 {
    // SAFETY: as the header demands; every object is writable storage.
    unsafe {
        with(node.cast_mut(), |node| {
            put_result(registers, || {
                Ok(view(node, first, MBM_REGISTERS_OF_WORDS, |words| {
                    (words.response, words.response_words)
                }))
            })
            .err()
            .unwrap_or(Status::OK)
        })
    }
}

/// Fills in a view of the transmit words as registers, in which you can set values for the
/// functions that write. The queue of mbm_node_send does not change.
///
/// @param node  the object; do not change its buffers while you use the view
/// @param first      the address in the device of word 0: the address of the write, or 0 if
///                   you want to count from word 0
/// @param registers  the view to fill in; unchanged if the status is not MBM_OK
/// @return MBM_OK, MBM_INVALID_ARGUMENT or MBM_NOT_INITIALISED
#[no_mangle]
pub unsafe extern "C" fn mbm_node_getTransmitRegisters(
    node: *const mbm_node,
    first: u16,
    registers: *mut mbm_registers,
) -> u8 {
    // SAFETY: as the header demands; every object is writable storage.
    unsafe {
        with(node.cast_mut(), |node| {
            put_result(registers, || {
                Ok(view(node, first, MBM_REGISTERS_INTO_WORDS, |words| {
                    (words.transmit, words.transmit_words)
                }))
            })
            .err()
            .unwrap_or(Status::OK)
        })
    }
}
