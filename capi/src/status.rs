//! The status codes and the function that explains them.

use core::ffi::c_char;
use mbm::error::Status;

/// Asserts that each constant of C equals the core's number.
macro_rules! statuses {
    ($($constant:ident = $core:expr;)*) => {
        $(const _: () = assert!($constant == $core.code());)*
    };
}

/// The call succeeded.
pub const MBM_OK: u8 = 0x00;
/// Exception of the device: it does not support the function.
pub const MBM_ILLEGAL_FUNCTION: u8 = 0x01;
/// Exception of the device: it has no such address. This library also returns it, and sends
/// nothing, for a range that passes address 65535.
pub const MBM_ILLEGAL_DATA_ADDRESS: u8 = 0x02;
/// Exception of the device: it refuses the quantity or value. This library also returns it,
/// and sends nothing, for a quantity that the standard forbids, and for a write of more than
/// the transmit buffer holds.
pub const MBM_ILLEGAL_DATA_VALUE: u8 = 0x03;
/// Exception of the device: it failed while it executed the request.
pub const MBM_SERVER_DEVICE_FAILURE: u8 = 0x04;
/// Exception of the device: it accepted the request and needs a long time for it.
pub const MBM_ACKNOWLEDGE: u8 = 0x05;
/// Exception of the device: it is busy. Send the request again later.
pub const MBM_SERVER_DEVICE_BUSY: u8 = 0x06;
/// Exception of the device: the memory of a file failed its consistency check.
pub const MBM_MEMORY_PARITY_ERROR: u8 = 0x08;
/// Exception of a gateway: it has no path to the device.
pub const MBM_GATEWAY_PATH_UNAVAILABLE: u8 = 0x0A;
/// Exception of a gateway: it received no response from the device.
pub const MBM_GATEWAY_TARGET_FAILED_TO_RESPOND: u8 = 0x0B;

/// Only frames of other units arrived within the response timeout.
pub const MBM_INVALID_SLAVE_ID: u8 = 0xE0;
/// The unit sent a reply to another function, and no other reply arrived within the
/// response timeout.
pub const MBM_INVALID_FUNCTION: u8 = 0xE1;
/// No complete reply arrived within the response timeout.
pub const MBM_RESPONSE_TIMED_OUT: u8 = 0xE2;
/// The CRC of the reply, or in ASCII its LRC, is wrong.
pub const MBM_INVALID_CRC: u8 = 0xE3;

/// The function cannot accept an argument: NULL, a number out of range, a port without
/// read, write or micros, a buffer that is too short, or an object of another framing or
/// kind. The comment of the function says which. The call changed nothing.
pub const MBM_INVALID_ARGUMENT: u8 = 0xE4;
/// The unit sent a reply of this function with a right CRC, but the reply does not match the
/// request: a wrong byte count, a wrong echo, or an exception code of 0 or from 0x80.
pub const MBM_MALFORMED_REPLY: u8 = 0xE5;
/// The port's read or write reported that the link is lost.
pub const MBM_LINK_LOST: u8 = 0xE6;
/// The object is in use: it has a pending request, or the call came from a hook that the
/// object called, or the object is a record that serves in another way. The call changed
/// nothing.
pub const MBM_BUSY: u8 = 0xE7;
/// A request that reads cannot be broadcast. Nothing was sent.
pub const MBM_BROADCAST_NOT_ALLOWED: u8 = 0xE8;
/// One of these: the frame buffer cannot hold the request, and nothing was sent; the frame
/// buffer or the response buffer cannot hold the reply, and the response words are
/// unchanged; a unit cannot take another record.
pub const MBM_BUFFER_TOO_SMALL: u8 = 0xE9;
/// The object was never begun, or has no buffers.
pub const MBM_NOT_INITIALISED: u8 = 0xEA;
/// The request is pending: call mbm_node_poll again.
pub const MBM_PENDING: u8 = 0xEB;
/// The line was not silent, or the port accepted no bytes, for as long as the response
/// timeout.
pub const MBM_LINE_BUSY: u8 = 0xEC;
/// A cancel function or a begin function gave the request up.
pub const MBM_CANCELLED: u8 = 0xED;
/// The frame is not complete: more bytes must follow.
pub const MBM_INCOMPLETE_FRAME: u8 = 0xEE;
/// No frame of this framing starts with these bytes, or has this length.
pub const MBM_MALFORMED_FRAME: u8 = 0xEF;
/// The client has 16 requests already. Nothing was queued.
pub const MBM_QUEUE_FULL: u8 = 0xF0;
/// Another pending request of the client has this transaction number. Nothing was queued.
pub const MBM_DUPLICATE_TRANSACTION: u8 = 0xF1;
/// The request has ended already, or was never queued on this client.
pub const MBM_NOT_PENDING: u8 = 0xF2;
/// The device says that more objects of its identification follow, but it sends none, names
/// an object that is not after those that it has sent, or then sends one before the one that
/// it named. Reading on might never end.
pub const MBM_NO_PROGRESS: u8 = 0xF4;
/// A value is out of the range of the type in which the program reads it.
pub const MBM_OUT_OF_RANGE: u8 = 0xF6;
/// The connection was not made in time: that of a link within its connect timeout. For a
/// request on Modbus TCP without a link: the port accepted no byte within the response timeout.
pub const MBM_CONNECT_TIMED_OUT: u8 = 0xF7;
/// The device answered with the number that means "not available", or with a float that is not a
/// number: there is no value. See mbm_planConversion.
pub const MBM_NOT_AVAILABLE: u8 = 0xF8;
/// The registers hold no value of the type in which the program reads them: a BCD digit above 9, a
/// date that does not exist.
pub const MBM_MALFORMED_VALUE: u8 = 0xF9;

statuses! {
    MBM_OK = Status::OK;
    MBM_ILLEGAL_FUNCTION = Status::ILLEGAL_FUNCTION;
    MBM_ILLEGAL_DATA_ADDRESS = Status::ILLEGAL_DATA_ADDRESS;
    MBM_ILLEGAL_DATA_VALUE = Status::ILLEGAL_DATA_VALUE;
    MBM_SERVER_DEVICE_FAILURE = Status::SERVER_DEVICE_FAILURE;
    MBM_ACKNOWLEDGE = Status::ACKNOWLEDGE;
    MBM_SERVER_DEVICE_BUSY = Status::SERVER_DEVICE_BUSY;
    MBM_MEMORY_PARITY_ERROR = Status::MEMORY_PARITY_ERROR;
    MBM_GATEWAY_PATH_UNAVAILABLE = Status::GATEWAY_PATH_UNAVAILABLE;
    MBM_GATEWAY_TARGET_FAILED_TO_RESPOND = Status::GATEWAY_TARGET_FAILED_TO_RESPOND;
    MBM_INVALID_SLAVE_ID = Status::INVALID_SLAVE_ID;
    MBM_INVALID_FUNCTION = Status::INVALID_FUNCTION;
    MBM_RESPONSE_TIMED_OUT = Status::RESPONSE_TIMED_OUT;
    MBM_INVALID_CRC = Status::INVALID_CRC;
    MBM_INVALID_ARGUMENT = Status::INVALID_ARGUMENT;
    MBM_MALFORMED_REPLY = Status::MALFORMED_REPLY;
    MBM_LINK_LOST = Status::LINK_LOST;
    MBM_BUSY = Status::BUSY;
    MBM_BROADCAST_NOT_ALLOWED = Status::BROADCAST_NOT_ALLOWED;
    MBM_BUFFER_TOO_SMALL = Status::BUFFER_TOO_SMALL;
    MBM_NOT_INITIALISED = Status::NOT_INITIALISED;
    MBM_PENDING = Status::PENDING;
    MBM_LINE_BUSY = Status::LINE_BUSY;
    MBM_CANCELLED = Status::CANCELLED;
    MBM_INCOMPLETE_FRAME = Status::INCOMPLETE_FRAME;
    MBM_MALFORMED_FRAME = Status::MALFORMED_FRAME;
    MBM_QUEUE_FULL = Status::QUEUE_FULL;
    MBM_DUPLICATE_TRANSACTION = Status::DUPLICATE_TRANSACTION;
    MBM_NOT_PENDING = Status::NOT_PENDING;
    MBM_NO_PROGRESS = Status::NO_PROGRESS;
    MBM_OUT_OF_RANGE = Status::OUT_OF_RANGE;
    MBM_CONNECT_TIMED_OUT = Status::CONNECT_TIMED_OUT;
    MBM_NOT_AVAILABLE = Status::NOT_AVAILABLE;
    MBM_MALFORMED_VALUE = Status::MALFORMED_VALUE;
}

/// Explains a status in a few words of English. For 1 to 3 these are the words of the device's
/// exception; mbm_status_textOf has its own text for a request that was refused before it was sent.
///
/// On an AVR, constants are in RAM, and a program that calls this function has about 1100
/// bytes of RAM less. There, show the number; or in a sketch call modbusStatusText of
/// ModbusStatusText.h, which keeps its words in flash.
///
/// Any thread or interrupt may call it.
///
/// @param status  any number
/// @return a constant string, never NULL
#[no_mangle]
pub extern "C" fn mbm_status_text(status: u8) -> *const c_char {
    Status::from_code(status).c_text().as_ptr()
}

/// Explains how a request ended: as mbm_status_text, but for a request that a master or a client
/// refused itself, the text says so, and that nothing was sent.
///
/// Any thread or interrupt may call it. As for mbm_status_text, the texts take RAM on an AVR: a
/// sketch calls modbusStatusText with both numbers.
///
/// @param status         the status of the request
/// @param exceptionCode  `exception` of the mbm_clientRequest, or what mbm_node_getExceptionCode
///                       returns: 0 if the device sent no exception
/// @return a constant string, never NULL
#[no_mangle]
pub extern "C" fn mbm_status_textOf(status: u8, exceptionCode: u8) -> *const c_char {
    let text = match (status, exceptionCode) {
        (MBM_ILLEGAL_FUNCTION, 0) => c"refused, nothing was sent: no such function code",
        (MBM_ILLEGAL_DATA_ADDRESS, 0) => c"refused, nothing was sent: the addresses pass 65535",
        (MBM_ILLEGAL_DATA_VALUE, 0) => {
            c"refused, nothing was sent: the standard or a buffer does not allow the quantity or value"
        }
        _ => Status::from_code(status).c_text(),
    };
    text.as_ptr()
}
