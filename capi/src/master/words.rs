//! The words to send and the received words.

use super::mbm_master;
use crate::pointers::{read, with};
use mbm::error::Status;
use mbm::master::NO_WORD;

/// Returns a word of the last successful read.
///
/// @param master  the object
/// @param index   0 to 255
/// @return the word; 0xFFFF if `index` is past the end of the response buffer
#[no_mangle]
pub unsafe extern "C" fn mbm_master_getResponseBuffer(master: *const mbm_master, index: u8) -> u16 {
    // SAFETY: as the header demands.
    unsafe {
        read(master, NO_WORD, |master| {
            master.core.response_word(usize::from(index))
        })
    }
}

/// Zeroes the response words. The position of mbm_master_receive does not change.
///
/// @param master  the object
/// @return MBM_OK, MBM_INVALID_ARGUMENT or MBM_NOT_INITIALISED
#[no_mangle]
pub unsafe extern "C" fn mbm_master_clearResponseBuffer(master: *mut mbm_master) -> u8 {
    // SAFETY: as the header demands.
    unsafe {
        with(master, |master| {
            master.core.clear_response();
            Status::OK
        })
    }
}

/// Sets a transmit word for the functions that write. The queue of mbm_master_send does not
/// change.
///
/// @param master  the object
/// @param index   0 to the number of transmit words - 1
/// @param value   the word
/// @return MBM_OK; MBM_ILLEGAL_DATA_ADDRESS if `index` is past the end of the buffer;
///         MBM_INVALID_ARGUMENT or MBM_NOT_INITIALISED
#[no_mangle]
pub unsafe extern "C" fn mbm_master_setTransmitBuffer(
    master: *mut mbm_master,
    index: u8,
    value: u16,
) -> u8 {
    // SAFETY: as the header demands.
    unsafe {
        with(master, |master| {
            if master.core.set_transmit_word(usize::from(index), value) {
                Status::OK
            } else {
                Status::ILLEGAL_DATA_ADDRESS
            }
        })
    }
}

/// Zeroes the transmit words. The queue of mbm_master_send does not change its length.
///
/// @param master  the object
/// @return MBM_OK, MBM_INVALID_ARGUMENT or MBM_NOT_INITIALISED
#[no_mangle]
pub unsafe extern "C" fn mbm_master_clearTransmitBuffer(master: *mut mbm_master) -> u8 {
    // SAFETY: as the header demands.
    unsafe {
        with(master, |master| {
            master.core.clear_transmit();
            Status::OK
        })
    }
}

/// Sets the write address and empties the queue of mbm_master_send. The transmit words do not
/// change.
///
/// @param master   the object
/// @param address  the address to which the functions with Queued in their name write, 0 to
///                 65535
/// @return MBM_OK, MBM_INVALID_ARGUMENT or MBM_NOT_INITIALISED
#[no_mangle]
pub unsafe extern "C" fn mbm_master_beginTransmission(master: *mut mbm_master, address: u16) -> u8 {
    // SAFETY: as the header demands.
    unsafe {
        with(master, |master| {
            master.core.begin_transmission(address);
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
/// @param master  the object
/// @param word    the word
/// @return MBM_OK; MBM_BUFFER_TOO_SMALL, with nothing queued, if the transmit buffer is full;
///         MBM_INVALID_ARGUMENT or MBM_NOT_INITIALISED
#[no_mangle]
pub unsafe extern "C" fn mbm_master_send(master: *mut mbm_master, word: u16) -> u8 {
    // SAFETY: as the header demands.
    unsafe { with(master, |master| queued(master.core.send(word))) }
}

/// Queues two words, the low one first. If only one word fits, it queues the low one alone.
///
/// @param master  the object
/// @param value   both words
/// @return MBM_OK; MBM_BUFFER_TOO_SMALL if a word did not fit;
///         MBM_INVALID_ARGUMENT or MBM_NOT_INITIALISED
#[no_mangle]
pub unsafe extern "C" fn mbm_master_send32(master: *mut mbm_master, value: u32) -> u8 {
    // SAFETY: as the header demands.
    unsafe {
        with(master, |master| {
            queued(master.core.send(value as u16) && master.core.send((value >> 16) as u16))
        })
    }
}

/// Queues a bit after the bits queued before, starting at the lowest bit of a word.
///
/// @param master  the object
/// @param on      0 is off, any other value is on
/// @return MBM_OK; MBM_BUFFER_TOO_SMALL, with nothing queued, if the transmit buffer is full;
///         MBM_INVALID_ARGUMENT or MBM_NOT_INITIALISED
#[no_mangle]
pub unsafe extern "C" fn mbm_master_sendBit(master: *mut mbm_master, on: u8) -> u8 {
    // SAFETY: as the header demands.
    unsafe { with(master, |master| queued(master.core.send_bit(on != 0))) }
}

/// Returns how many words of the last successful read mbm_master_receive has not returned yet.
///
/// @param master  the object
/// @return 0 to 125
#[no_mangle]
pub unsafe extern "C" fn mbm_master_available(master: *const mbm_master) -> u8 {
    // SAFETY: as the header demands.
    unsafe { read(master, 0, |master| master.core.available()) }
}

/// Returns the next word of the last successful read.
///
/// @param master  the object
/// @return the word; 0xFFFF if no word is left
#[no_mangle]
pub unsafe extern "C" fn mbm_master_receive(master: *mut mbm_master) -> u16 {
    // SAFETY: as the header demands.
    unsafe { read(master, NO_WORD, |master| master.core.receive()) }
}
