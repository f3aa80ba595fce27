//! The ten functions, and their forms without arguments.

use super::{call, mbm_master, request};
use mbm::error::Status;
use mbm::pdu::function_spec::FunctionSpec;
use mbm::pdu::master_request::MasterSpec;

/// Function 01: reads coils into the response words, 16 to a word, lowest bit
/// first, the last word padded with zeros (V1.1b3, 6.1).
///
/// This and the nine other functions behave alike. In blocking mode they return
/// when the request has ended, in non-blocking mode at once with MBM_PENDING, and
/// mbm_master_poll ends it. They empty the queue of send and set receive back to the
/// first word, unless they return MBM_BUSY, MBM_NOT_INITIALISED or
/// MBM_INVALID_ARGUMENT. Response words change only on success. Transmit words stay;
/// only 06 and 16 store their arguments in them. A request that no device could accept
/// (a quantity that the standard forbids, addresses beyond 65535) is not sent: the
/// status is the exception that a device would answer.
///
/// @param master    the object
/// @param address   first coil, 0 to 65535, as on the wire
/// @param quantity  1 to 2000
/// @return MBM_OK, or an exception of the device (0x01 to 0x7F), or
///         MBM_PENDING (non-blocking), MBM_RESPONSE_TIMED_OUT, MBM_INVALID_CRC,
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

/// Function 02: reads discrete inputs into the response words, 16 to a word,
/// lowest bit first, the last word padded with zeros (V1.1b3, 6.2).
///
/// @param master    the object
/// @param address   first input, 0 to 65535, as on the wire
/// @param quantity  1 to 2000
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
/// @param address   first register, 0 to 65535, as on the wire
/// @param quantity  1 to 125
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
/// @param address   first register, 0 to 65535, as on the wire
/// @param quantity  1 to 125
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

/// Function 05: switches one coil (V1.1b3, 6.5). Unit 0 broadcasts.
///
/// @param master   the object
/// @param address  the coil, 0 to 65535; becomes the write address
/// @param state    0 is off, anything else is on
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

/// Function 06: writes one register (V1.1b3, 6.6). Unit 0 broadcasts.
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

/// Function 0F: writes coils from the transmit words, from word 0 on, lowest bit
/// first (V1.1b3, 6.11). Unit 0 broadcasts.
///
/// @param master    the object
/// @param address   first coil, 0 to 65535; becomes the write address
/// @param quantity  1 to 1968, and no more than the transmit words hold
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

/// Function 0F: writes the queued bits to the last write address
/// (beginTransmission, sendBit, then this).
///
/// @param master  the object
/// @return a status; see mbm_master_readCoils
#[no_mangle]
pub unsafe extern "C" fn mbm_master_writeQueuedCoils(master: *mut mbm_master) -> u8 {
    // SAFETY: as the header demands.
    unsafe { request(master, |master| master.write_queued_coils()) }
}

/// Function 10: writes registers from the transmit words, from word 0 on
/// (V1.1b3, 6.12). Unit 0 broadcasts.
///
/// @param master    the object
/// @param address   first register, 0 to 65535; becomes the write address
/// @param quantity  1 to 123, and no more than the transmit words
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

/// Function 10: writes the queued complete words to the last write address
/// (beginTransmission, send, then this).
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
/// Unit 0 broadcasts.
///
/// @param master   the object
/// @param address  the register, 0 to 65535; becomes the write address
/// @param andMask  keeps bits; also becomes transmit word 0
/// @param orMask   sets bits where andMask is 0; also becomes transmit word 1
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

/// Function 17: the device writes registers from the transmit words first, then
/// reads others into the response words, in one request (V1.1b3, 6.17).
///
/// @param master         the object
/// @param readAddress    first register to read, 0 to 65535
/// @param readQuantity   1 to 125
/// @param writeAddress   first register to write, 0 to 65535; becomes the write
///                       address
/// @param writeQuantity  1 to 121, and no more than the transmit words
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

/// Function 17: writes the queued complete words to the last write address, then
/// reads.
///
/// @param master        the object
/// @param readAddress   first register to read, 0 to 65535
/// @param readQuantity  1 to 125
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

/// Reads holding registers for mbm_master_receive to give, one after the other.
///
/// @param master    the object
/// @param address   first register, 0 to 65535
/// @param quantity  1 to 125
/// @return how many words mbm_master_receive will give; 0 if the request failed
///         (mbm_master_status says how), another one is under way or, in non-blocking
///         mode, this one is
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
