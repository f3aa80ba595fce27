//! The ten functions, and those of them that use the queue of words to send.

use super::{call, mbm_master, request};
use mbm::error::Status;
use mbm::pdu::function_spec::FunctionSpec;
use mbm::pdu::master_request::MasterSpec;

/// Function 01: reads coils into the response words, 16 in each word. The first coil is the
/// lowest bit; the last word is padded with zeros (V1.1b3, 6.1).
///
/// All functions that make a request behave as follows. In blocking mode they return when
/// the request has ended. In non-blocking mode they return MBM_PENDING at once, and you call
/// mbm_master_poll until the request has ended.
///
/// They empty the queue of mbm_master_send, and mbm_master_receive starts again at the first
/// word, unless they return MBM_BUSY, MBM_NOT_INITIALISED or MBM_INVALID_ARGUMENT. The
/// response words change only on success. The transmit words do not change, except that 06
/// and 16 store their arguments there.
///
/// The master does not send a request that no device could accept, with a quantity that the
/// standard forbids or addresses beyond 65535. The status is then the exception with which a
/// device would answer.
///
/// @param master    the object
/// @param address   the first coil, 0 to 65535, as on the wire
/// @param quantity  the number of coils, 1 to 2000
/// @return MBM_OK, or an exception of the device (0x01 to 0x7F), or
///         MBM_PENDING (non-blocking mode), MBM_RESPONSE_TIMED_OUT, MBM_INVALID_CRC,
///         MBM_MALFORMED_REPLY, MBM_INVALID_SLAVE_ID, MBM_INVALID_FUNCTION,
///         MBM_LINK_LOST, MBM_LINE_BUSY, MBM_BUFFER_TOO_SMALL,
///         MBM_BROADCAST_NOT_ALLOWED, MBM_BUSY, MBM_CANCELLED,
///         MBM_NOT_INITIALISED, MBM_INVALID_ARGUMENT
#[no_mangle]
pub unsafe extern "C" fn mbm_master_readCoils(
    master: *mut mbm_master,
    address: u16,
    quantity: u16,
) -> u8 {
    // SAFETY: as the header demands.
    unsafe {
        call(
            master,
            address,
            quantity,
            MasterSpec::new(FunctionSpec::READ_COILS),
        )
    }
}

/// Function 02: reads discrete inputs into the response words, 16 in each word. The first
/// input is the lowest bit; the last word is padded with zeros (V1.1b3, 6.2).
///
/// @param master    the object
/// @param address   the first input, 0 to 65535, as on the wire
/// @param quantity  the number of inputs, 1 to 2000
/// @return a status; see mbm_master_readCoils
#[no_mangle]
pub unsafe extern "C" fn mbm_master_readDiscreteInputs(
    master: *mut mbm_master,
    address: u16,
    quantity: u16,
) -> u8 {
    // SAFETY: as the header demands.
    unsafe {
        call(
            master,
            address,
            quantity,
            MasterSpec::new(FunctionSpec::READ_DISCRETE_INPUTS),
        )
    }
}

/// Function 03: reads holding registers into the response words (V1.1b3, 6.3).
///
/// @param master    the object
/// @param address   the first register, 0 to 65535, as on the wire
/// @param quantity  the number of registers, 1 to 125
/// @return a status; see mbm_master_readCoils
#[no_mangle]
pub unsafe extern "C" fn mbm_master_readHoldingRegisters(
    master: *mut mbm_master,
    address: u16,
    quantity: u16,
) -> u8 {
    // SAFETY: as the header demands.
    unsafe {
        call(
            master,
            address,
            quantity,
            MasterSpec::new(FunctionSpec::READ_HOLDING_REGISTERS),
        )
    }
}

/// Function 04: reads input registers into the response words (V1.1b3, 6.4).
///
/// @param master    the object
/// @param address   the first register, 0 to 65535, as on the wire
/// @param quantity  the number of registers, 1 to 125
/// @return a status; see mbm_master_readCoils
#[no_mangle]
pub unsafe extern "C" fn mbm_master_readInputRegisters(
    master: *mut mbm_master,
    address: u16,
    quantity: u16,
) -> u8 {
    // SAFETY: as the header demands.
    unsafe {
        call(
            master,
            address,
            quantity,
            MasterSpec::new(FunctionSpec::READ_INPUT_REGISTERS),
        )
    }
}

/// Function 05: switches one coil on or off (V1.1b3, 6.5). With unit 0 it is a broadcast.
///
/// @param master   the object
/// @param address  the coil, 0 to 65535; becomes the write address
/// @param state    0 is off, any other value is on
/// @return a status; see mbm_master_readCoils
#[no_mangle]
pub unsafe extern "C" fn mbm_master_writeSingleCoil(
    master: *mut mbm_master,
    address: u16,
    state: u8,
) -> u8 {
    // SAFETY: as the header demands.
    unsafe {
        request(master, |master| {
            master.write_single_coil(address, state.into())
        })
    }
}

/// Function 06: writes one register (V1.1b3, 6.6). With unit 0 it is a broadcast.
///
/// @param master   the object
/// @param address  the register, 0 to 65535; becomes the write address
/// @param value    its value; also becomes transmit word 0
/// @return a status; see mbm_master_readCoils
#[no_mangle]
pub unsafe extern "C" fn mbm_master_writeSingleRegister(
    master: *mut mbm_master,
    address: u16,
    value: u16,
) -> u8 {
    // SAFETY: as the header demands.
    unsafe {
        request(master, |master| {
            master.write_single_register(address, value)
        })
    }
}

/// Function 0F: writes coils from the transmit words, starting at word 0. The first coil is
/// the lowest bit (V1.1b3, 6.11). With unit 0 it is a broadcast.
///
/// @param master    the object
/// @param address   the first coil, 0 to 65535; becomes the write address
/// @param quantity  the number of coils, 1 to 1968, and not more than the transmit words hold
/// @return a status; see mbm_master_readCoils
#[no_mangle]
pub unsafe extern "C" fn mbm_master_writeMultipleCoils(
    master: *mut mbm_master,
    address: u16,
    quantity: u16,
) -> u8 {
    // SAFETY: as the header demands.
    unsafe {
        call(
            master,
            address,
            quantity,
            MasterSpec::new(FunctionSpec::WRITE_MULTIPLE_COILS),
        )
    }
}

/// Function 0F: writes the queued bits to coils, starting at the last write address. Call
/// mbm_master_beginTransmission and mbm_master_sendBit before.
///
/// @param master  the object
/// @return a status; see mbm_master_readCoils
#[no_mangle]
pub unsafe extern "C" fn mbm_master_writeQueuedCoils(master: *mut mbm_master) -> u8 {
    // SAFETY: as the header demands.
    unsafe { request(master, |master| master.write_queued_coils()) }
}

/// Function 10: writes registers from the transmit words, starting at word 0 (V1.1b3, 6.12).
/// With unit 0 it is a broadcast.
///
/// @param master    the object
/// @param address   the first register, 0 to 65535; becomes the write address
/// @param quantity  the number of registers, 1 to 123, and not more than the transmit words
/// @return a status; see mbm_master_readCoils
#[no_mangle]
pub unsafe extern "C" fn mbm_master_writeMultipleRegisters(
    master: *mut mbm_master,
    address: u16,
    quantity: u16,
) -> u8 {
    // SAFETY: as the header demands.
    unsafe {
        call(
            master,
            address,
            quantity,
            MasterSpec::new(FunctionSpec::WRITE_MULTIPLE_REGISTERS),
        )
    }
}

/// Function 10: writes the queued complete words to registers, starting at the last write
/// address. Call mbm_master_beginTransmission and mbm_master_send before.
///
/// @param master  the object
/// @return a status; see mbm_master_readCoils
#[no_mangle]
pub unsafe extern "C" fn mbm_master_writeQueuedRegisters(master: *mut mbm_master) -> u8 {
    // SAFETY: as the header demands.
    unsafe { request(master, |master| master.write_queued_registers()) }
}

/// Function 16: the device sets a register to
/// (register AND andMask) OR (orMask AND NOT andMask) (V1.1b3, 6.16).
/// With unit 0 it is a broadcast.
///
/// @param master   the object
/// @param address  the register, 0 to 65535; becomes the write address
/// @param andMask  1 for each bit of the register to keep; also becomes transmit word 0
/// @param orMask   the new value of the bits that are not kept; also becomes transmit word 1
/// @return a status; see mbm_master_readCoils
#[no_mangle]
pub unsafe extern "C" fn mbm_master_maskWriteRegister(
    master: *mut mbm_master,
    address: u16,
    andMask: u16,
    orMask: u16,
) -> u8 {
    // SAFETY: as the header demands.
    unsafe {
        request(master, |master| {
            master.mask_write_register(address, andMask, orMask)
        })
    }
}

/// Function 17: the device writes the transmit words to registers first. Then it reads
/// registers, which arrive in the response words. Both in one request (V1.1b3, 6.17).
///
/// @param master         the object
/// @param readAddress    the first register to read, 0 to 65535
/// @param readQuantity   the number of registers to read, 1 to 125
/// @param writeAddress   the first register to write, 0 to 65535; becomes the write
///                       address
/// @param writeQuantity  the number of registers to write, 1 to 121, and not more than the
///                       transmit words
/// @return a status; see mbm_master_readCoils
#[no_mangle]
pub unsafe extern "C" fn mbm_master_readWriteMultipleRegisters(
    master: *mut mbm_master,
    readAddress: u16,
    readQuantity: u16,
    writeAddress: u16,
    writeQuantity: u16,
) -> u8 {
    // SAFETY: as the header demands.
    unsafe {
        request(master, |master| {
            master.read_write_multiple_registers(
                readAddress,
                readQuantity,
                writeAddress,
                writeQuantity,
            )
        })
    }
}

/// Function 17: as mbm_master_readWriteMultipleRegisters, but writes the queued complete
/// words, starting at the last write address.
///
/// @param master        the object
/// @param readAddress   the first register to read, 0 to 65535
/// @param readQuantity  the number of registers to read, 1 to 125
/// @return a status; see mbm_master_readCoils
#[no_mangle]
pub unsafe extern "C" fn mbm_master_readWriteQueuedRegisters(
    master: *mut mbm_master,
    readAddress: u16,
    readQuantity: u16,
) -> u8 {
    // SAFETY: as the header demands.
    unsafe {
        request(master, |master| {
            master.read_write_queued_registers(readAddress, readQuantity)
        })
    }
}

/// Reads holding registers. mbm_master_receive then returns them one after the other.
///
/// @param master    the object
/// @param address   the first register, 0 to 65535
/// @param quantity  the number of registers, 1 to 125
/// @return the number of words that mbm_master_receive will return; 0 if the request failed
///         (mbm_master_status returns why), if another request is under way, and in
///         non-blocking mode
#[no_mangle]
pub unsafe extern "C" fn mbm_master_requestFrom(
    master: *mut mbm_master,
    address: u16,
    quantity: u16,
) -> u8 {
    // SAFETY: as the header demands.
    unsafe {
        if mbm_master_readHoldingRegisters(master, address, quantity) != Status::OK.code() {
            return 0;
        }
        super::mbm_master_available(master)
    }
}
