//! The words to send and the received words.

use super::mbm_node;
use crate::pointers::{read, with};
use mbm::error::Status;
use mbm::node::{set_word, NO_WORD};

/// Returns a word of the last successful read.
///
/// @param node  the object
/// @param index   0 to 255
/// @return the word; 0xFFFF if `index` is past the end of the response buffer
#[no_mangle]
pub unsafe extern "C" fn mbm_node_getResponseBuffer(node: *const mbm_node, index: u8) -> u16 {
    // SAFETY: as the header demands.
    unsafe { read(node, NO_WORD, |node| node.words.response_word(index)) }
}

/// Zeroes the response words. The position of mbm_node_receive does not change.
///
/// @param node  the object
/// @return MBM_OK, MBM_INVALID_ARGUMENT or MBM_NOT_INITIALISED
#[no_mangle]
pub unsafe extern "C" fn mbm_node_clearResponseBuffer(node: *mut mbm_node) -> u8 {
    // SAFETY: as the header demands.
    unsafe {
        with(node, |node| {
            node.words.response().fill(0);
            Status::OK
        })
    }
}

/// Sets a transmit word for the functions that write. The queue of mbm_node_send does not
/// change.
///
/// @param node  the object
/// @param index   0 to the number of transmit words - 1
/// @param value   the word
/// @return MBM_OK; MBM_ILLEGAL_DATA_ADDRESS if `index` is past the end of the buffer;
///         MBM_INVALID_ARGUMENT or MBM_NOT_INITIALISED
#[no_mangle]
pub unsafe extern "C" fn mbm_node_setTransmitBuffer(
    node: *mut mbm_node,
    index: u8,
    value: u16,
) -> u8 {
    // SAFETY: as the header demands.
    unsafe {
        with(node, |node| {
            if set_word(node.words.transmit(), usize::from(index), value) {
                Status::OK
            } else {
                Status::ILLEGAL_DATA_ADDRESS
            }
        })
    }
}

/// Zeroes the transmit words. The queue of mbm_node_send does not change its length.
///
/// @param node  the object
/// @return MBM_OK, MBM_INVALID_ARGUMENT or MBM_NOT_INITIALISED
#[no_mangle]
pub unsafe extern "C" fn mbm_node_clearTransmitBuffer(node: *mut mbm_node) -> u8 {
    // SAFETY: as the header demands.
    unsafe {
        with(node, |node| {
            node.words.transmit().fill(0);
            Status::OK
        })
    }
}

/// Sets the write address and empties the queue of mbm_node_send. The transmit words do not
/// change.
///
/// @param node  the object
/// @param address  the address to which the functions with Queued in their name write, 0 to
///                 65535
/// @return MBM_OK, MBM_INVALID_ARGUMENT or MBM_NOT_INITIALISED
#[no_mangle]
pub unsafe extern "C" fn mbm_node_beginTransmission(node: *mut mbm_node, address: u16) -> u8 {
    // SAFETY: as the header demands.
    unsafe {
        with(node, |node| {
            node.core.begin_transmission(address);
            Status::OK
        })
    }
}

/// The status of a word or bit that was queued if it `fits`.
fn queued(fits: bool) -> Status {
    if fits {
        Status::OK
    } else {
        Status::BUFFER_TOO_SMALL
    }
}

/// Queues a word after the words queued before. If the last word holds queued bits, the new
/// word goes into the next one.
///
/// @param node  the object
/// @param word    the word
/// @return MBM_OK; MBM_BUFFER_TOO_SMALL, with nothing queued, if the transmit buffer is full;
///         MBM_INVALID_ARGUMENT or MBM_NOT_INITIALISED
#[no_mangle]
pub unsafe extern "C" fn mbm_node_send(node: *mut mbm_node, word: u16) -> u8 {
    // SAFETY: as the header demands.
    unsafe {
        with(node, |node| {
            queued(node.core.send(node.words.transmit(), word))
        })
    }
}

/// Queues two words, the low one first. If only one word fits, it queues the low one alone.
///
/// @param node  the object
/// @param value   both words
/// @return MBM_OK; MBM_BUFFER_TOO_SMALL if a word did not fit;
///         MBM_INVALID_ARGUMENT or MBM_NOT_INITIALISED
#[no_mangle]
pub unsafe extern "C" fn mbm_node_send32(node: *mut mbm_node, value: u32) -> u8 {
    // SAFETY: as the header demands.
    unsafe {
        with(node, |node| {
            queued(
                node.core.send(node.words.transmit(), value as u16)
                    && node.core.send(node.words.transmit(), (value >> 16) as u16),
            )
        })
    }
}

/// Queues a bit after the bits queued before, starting at the lowest bit of a word.
///
/// @param node  the object
/// @param on      0 is off, any other value is on
/// @return MBM_OK; MBM_BUFFER_TOO_SMALL, with nothing queued, if the transmit buffer is full;
///         MBM_INVALID_ARGUMENT or MBM_NOT_INITIALISED
#[no_mangle]
pub unsafe extern "C" fn mbm_node_sendBit(node: *mut mbm_node, on: u8) -> u8 {
    // SAFETY: as the header demands.
    unsafe {
        with(node, |node| {
            queued(node.core.send_bit(node.words.transmit(), on != 0))
        })
    }
}

/// Returns how many words of the last successful read mbm_node_receive has not returned yet.
///
/// @param node  the object
/// @return 0 to 125
#[no_mangle]
pub unsafe extern "C" fn mbm_node_available(node: *const mbm_node) -> u8 {
    // SAFETY: as the header demands.
    unsafe { read(node, 0, |node| node.core.available()) }
}

/// Returns the next word of the last successful read.
///
/// @param node  the object
/// @return the word; 0xFFFF if no word is left
#[no_mangle]
pub unsafe extern "C" fn mbm_node_receive(node: *mut mbm_node) -> u16 {
    // SAFETY: as the header demands.
    unsafe {
        read(node, NO_WORD, |node| {
            node.core.receive(node.words.response())
        })
    }
}
