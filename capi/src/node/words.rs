//! The words to send and the received words.

use super::mbm_node;
use crate::pointers::{change, read, with};
use mbm::error::Status;
use mbm::master::node::NO_WORD;

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
