//! Requests for coils, discrete inputs and registers.

use super::{plain, special};
use crate::client::{mbm_client, mbm_clientRequest};
use mbm::error::Status;
use mbm::pdu::function_spec::FunctionSpec;

/// Function 01: reads coils into `reply`, eight to a byte, the lowest bit first, the
/// last byte padded with zeros (V1.1b3, 6.1).
///
/// This and the other functions behave alike: they queue a request and return. The
/// request has ended when its `status` is no longer MBM_PENDING: MBM_OK, an exception
/// of the device (0x01 to 0x7F), MBM_RESPONSE_TIMED_OUT, MBM_INVALID_CRC,
/// MBM_MALFORMED_REPLY, MBM_INVALID_SLAVE_ID, MBM_INVALID_FUNCTION, MBM_LINK_LOST,
/// MBM_LINE_BUSY, MBM_BUFFER_TOO_SMALL or MBM_CANCELLED. `reply` changes on MBM_OK only.
///
/// @param client   the object
/// @param request  the request
/// @param address  first coil, 0 to 65535, as on the wire
/// @param quantity  1 to 2000
/// @return MBM_PENDING: the request is queued; or, with nothing queued,
///         MBM_ILLEGAL_DATA_VALUE or MBM_ILLEGAL_DATA_ADDRESS for what no device
///         could accept, MBM_BROADCAST_NOT_ALLOWED, MBM_QUEUE_FULL,
///         MBM_DUPLICATE_TRANSACTION, MBM_BUFFER_TOO_SMALL if `reply` has no room
///         for the data, MBM_INVALID_ARGUMENT for `data` that are NULL,
///         MBM_NOT_INITIALISED; MBM_BUSY, with the request unchanged, if it is
///         pending already, and from within a hook of the port. A request that
///         is refused with another of these has it in `status`
#[no_mangle]
pub unsafe extern "C" fn mbm_client_readCoils(
    client: *mut mbm_client,
    request: *mut mbm_clientRequest,
    address: u16,
    quantity: u16,
) -> u8 {
    // SAFETY: as the header demands.
    unsafe { plain(client, request, address, quantity, FunctionSpec::READ_COILS) }
}

/// Function 02: reads discrete inputs, as mbm_client_readCoils (V1.1b3, 6.2).
///
/// @param client   the object
/// @param request  the request
/// @param address  first input, 0 to 65535, as on the wire
/// @param quantity  1 to 2000
/// @return a status; see mbm_client_readCoils
#[no_mangle]
pub unsafe extern "C" fn mbm_client_readDiscreteInputs(
    client: *mut mbm_client,
    request: *mut mbm_clientRequest,
    address: u16,
    quantity: u16,
) -> u8 {
    // SAFETY: as the header demands.
    unsafe {
        plain(
            client,
            request,
            address,
            quantity,
            FunctionSpec::READ_DISCRETE_INPUTS,
        )
    }
}

/// Function 03: reads holding registers into the words of `reply` (V1.1b3, 6.3).
///
/// @param client   the object
/// @param request  the request
/// @param address  first register, 0 to 65535, as on the wire
/// @param quantity  1 to 125
/// @return a status; see mbm_client_readCoils
#[no_mangle]
pub unsafe extern "C" fn mbm_client_readHoldingRegisters(
    client: *mut mbm_client,
    request: *mut mbm_clientRequest,
    address: u16,
    quantity: u16,
) -> u8 {
    // SAFETY: as the header demands.
    unsafe {
        plain(
            client,
            request,
            address,
            quantity,
            FunctionSpec::READ_HOLDING_REGISTERS,
        )
    }
}

/// Function 04: reads input registers into the words of `reply` (V1.1b3, 6.4).
///
/// @param client   the object
/// @param request  the request
/// @param address  first register, 0 to 65535, as on the wire
/// @param quantity  1 to 125
/// @return a status; see mbm_client_readCoils
#[no_mangle]
pub unsafe extern "C" fn mbm_client_readInputRegisters(
    client: *mut mbm_client,
    request: *mut mbm_clientRequest,
    address: u16,
    quantity: u16,
) -> u8 {
    // SAFETY: as the header demands.
    unsafe {
        plain(
            client,
            request,
            address,
            quantity,
            FunctionSpec::READ_INPUT_REGISTERS,
        )
    }
}

/// Function 05: switches a coil (V1.1b3, 6.5).
///
/// @param client   the object
/// @param request  the request
/// @param address  0 to 65535, as on the wire
/// @param on  0 is off, anything else is on
/// @return a status; see mbm_client_readCoils
#[no_mangle]
pub unsafe extern "C" fn mbm_client_writeSingleCoil(
    client: *mut mbm_client,
    request: *mut mbm_clientRequest,
    address: u16,
    on: u8,
) -> u8 {
    // SAFETY: as the header demands.
    unsafe {
        plain(
            client,
            request,
            address,
            if on == 0 { 0 } else { 0xFF00 },
            FunctionSpec::WRITE_SINGLE_COIL,
        )
    }
}

/// Function 06: writes a holding register (V1.1b3, 6.6).
///
/// @param client   the object
/// @param request  the request
/// @param address  0 to 65535, as on the wire
/// @param value  the value
/// @return a status; see mbm_client_readCoils
#[no_mangle]
pub unsafe extern "C" fn mbm_client_writeSingleRegister(
    client: *mut mbm_client,
    request: *mut mbm_clientRequest,
    address: u16,
    value: u16,
) -> u8 {
    // SAFETY: as the header demands.
    unsafe {
        plain(
            client,
            request,
            address,
            value,
            FunctionSpec::WRITE_SINGLE_REGISTER,
        )
    }
}

/// Function 0F: writes the coils of `data`, eight to a byte, the lowest bit first
/// (V1.1b3, 6.11).
///
/// @param client   the object
/// @param request  the request
/// @param address  first coil, 0 to 65535, as on the wire
/// @param quantity  1 to 1968
/// @return a status; see mbm_client_readCoils
#[no_mangle]
pub unsafe extern "C" fn mbm_client_writeMultipleCoils(
    client: *mut mbm_client,
    request: *mut mbm_clientRequest,
    address: u16,
    quantity: u16,
) -> u8 {
    // SAFETY: as the header demands.
    unsafe {
        plain(
            client,
            request,
            address,
            quantity,
            FunctionSpec::WRITE_MULTIPLE_COILS,
        )
    }
}

/// Function 10: writes the words of `data` (V1.1b3, 6.12).
///
/// @param client   the object
/// @param request  the request
/// @param address  first register, 0 to 65535, as on the wire
/// @param quantity  1 to 123
/// @return a status; see mbm_client_readCoils
#[no_mangle]
pub unsafe extern "C" fn mbm_client_writeMultipleRegisters(
    client: *mut mbm_client,
    request: *mut mbm_clientRequest,
    address: u16,
    quantity: u16,
) -> u8 {
    // SAFETY: as the header demands.
    unsafe {
        plain(
            client,
            request,
            address,
            quantity,
            FunctionSpec::WRITE_MULTIPLE_REGISTERS,
        )
    }
}

/// Function 16: sets a holding register to (register & andMask) | (orMask & ~andMask)
/// (V1.1b3, 6.16).
///
/// @param client   the object
/// @param request  the request
/// @param address  0 to 65535, as on the wire
/// @param andMask  bits to keep
/// @param orMask  bits to set where none are kept
/// @return a status; see mbm_client_readCoils
#[no_mangle]
pub unsafe extern "C" fn mbm_client_maskWriteRegister(
    client: *mut mbm_client,
    request: *mut mbm_clientRequest,
    address: u16,
    andMask: u16,
    orMask: u16,
) -> u8 {
    // SAFETY: as the header demands.
    unsafe {
        special(
            client,
            request,
            FunctionSpec::MASK_WRITE_REGISTER,
            [address.into(), andMask.into(), orMask.into(), 0],
            None,
        )
    }
}

/// Function 17: writes the words of `data`, then reads into the words of `reply`
/// (V1.1b3, 6.17).
///
/// @param client   the object
/// @param request  the request
/// @param readAddress  first register to read
/// @param readQuantity  1 to 125
/// @param writeAddress  first register to write
/// @param writeQuantity  1 to 121
/// @return a status; see mbm_client_readCoils
#[no_mangle]
pub unsafe extern "C" fn mbm_client_readWriteMultipleRegisters(
    client: *mut mbm_client,
    request: *mut mbm_clientRequest,
    readAddress: u16,
    readQuantity: u16,
    writeAddress: u16,
    writeQuantity: u16,
) -> u8 {
    // SAFETY: as the header demands.
    unsafe {
        special(
            client,
            request,
            FunctionSpec::READ_WRITE_REGISTERS,
            [
                readAddress.into(),
                readQuantity.into(),
                writeAddress.into(),
                writeQuantity.into(),
            ],
            Some(|inside, words, readable| {
                let header = &mut inside.state.header;
                match header.add_write(words[2] as u16, words[3] as u16) {
                    Status::OK => readable,
                    refused => refused,
                }
            }),
        )
    }
}
