//! The words to send and the received words.

use super::mbm_node;
use crate::pointers::{change, read, with};
use mbm::error::Status;
use mbm::master::node::{set_word, word, NO_WORD};

/// Returns a response word: one that the last successful read stored, or an older one after it.
///
/// @param index  0 to 255
/// @return the word; 0xFFFF if `index` is past the last response word
#[no_mangle]
pub unsafe extern "C" fn mbm_node_getResponseBuffer(node: *const mbm_node, index: u8) -> u16 {
    read(node, NO_WORD, |node| {
        word(node.words.response(), index.into())
    })
}

/// Sets every response word to 0. The position of mbm_node_receive does not change.
#[no_mangle]
pub unsafe extern "C" fn mbm_node_clearResponseBuffer(node: *mut mbm_node) -> u8 {
    change(node, |node| node.words.response_mut().fill(0))
}

/// Sets a transmit word, for the functions that write. The queue of mbm_node_send does not
/// change.
///
/// @param index  0 to the number of transmit words minus 1
/// @param value  the word
/// @return a status; MBM_ILLEGAL_DATA_ADDRESS if `index` is past the last transmit word
#[no_mangle]
pub unsafe extern "C" fn mbm_node_setTransmitBuffer(
    node: *mut mbm_node,
    index: u8,
    value: u16,
) -> u8 {
    with(node, |node| {
        match set_word(node.words.transmit(), index.into(), value) {
            true => Status::OK,
            false => Status::ILLEGAL_DATA_ADDRESS,
        }
    })
}

/// Sets every transmit word to 0. The queue of mbm_node_send keeps its length.
#[no_mangle]
pub unsafe extern "C" fn mbm_node_clearTransmitBuffer(node: *mut mbm_node) -> u8 {
    change(node, |node| node.words.transmit().fill(0))
}

/// Sets the write address and empties the queue of mbm_node_send. The transmit words do not
/// change.
///
/// @param address  the address to which the functions with Queued in their name write, 0 to 65535
#[no_mangle]
pub unsafe extern "C" fn mbm_node_beginTransmission(node: *mut mbm_node, address: u16) -> u8 {
    change(node, |node| node.core.begin_transmission(address))
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
/// @param word  the word
/// @return a status; MBM_BUFFER_TOO_SMALL, with nothing queued, if the transmit buffer is full
#[no_mangle]
pub unsafe extern "C" fn mbm_node_send(node: *mut mbm_node, word: u16) -> u8 {
    with(node, |node| {
        queued(node.core.send(node.words.transmit(), word))
    })
}

/// Queues a byte as a word whose high byte is 0; see mbm_node_send.
///
/// @param byte  0 to 255
/// @return a status; see mbm_node_send
#[no_mangle]
pub unsafe extern "C" fn mbm_node_send8(node: *mut mbm_node, byte: u8) -> u8 {
    mbm_node_send(node, byte.into())
}

/// Queues the two words of a number of 32 bits, the low word first; see mbm_node_send.
///
/// @param value  the number, 0 to 4294967295
/// @return a status; MBM_BUFFER_TOO_SMALL, with nothing queued, if two words do not fit
#[no_mangle]
pub unsafe extern "C" fn mbm_node_send32(node: *mut mbm_node, value: u32) -> u8 {
    with(node, |node| {
        queued(node.core.send32(node.words.transmit(), value))
    })
}

/// Queues a bit after the bits queued before, starting at the lowest bit of a word.
///
/// @param on  0 is off, any other value is on
/// @return a status; MBM_BUFFER_TOO_SMALL, with nothing queued, if the transmit buffer is full
#[no_mangle]
pub unsafe extern "C" fn mbm_node_sendBit(node: *mut mbm_node, on: u8) -> u8 {
    with(node, |node| {
        queued(node.core.send_bit(node.words.transmit(), on != 0))
    })
}

/// Returns how many words of the last successful read mbm_node_receive has not returned yet.
///
/// @return 0 to 125
#[no_mangle]
pub unsafe extern "C" fn mbm_node_available(node: *const mbm_node) -> u8 {
    read(node, 0, |node| node.core.available())
}

/// Returns the next word of the last successful read.
///
/// @return the word; 0xFFFF if no word is left
#[no_mangle]
pub unsafe extern "C" fn mbm_node_receive(node: *mut mbm_node) -> u16 {
    read(node, NO_WORD, |node| {
        node.core.receive(node.words.response())
    })
}
