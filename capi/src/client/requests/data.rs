//! Requests for coils, discrete inputs and registers.

use super::{two_words, with_more};
use crate::client::request::RequestFields;
use crate::client::{mbm_client, mbm_clientRequest};
use mbm::error::Status;
use mbm::pdu::functions::{coil_value, FunctionSpec};

functions! {
    (client: *mut mbm_client, request: *mut mbm_clientRequest)

    /// Function 01: reads coils into the bytes of `reply`, eight in each byte. The first coil is
    /// the lowest bit; the last byte is padded with zeros (V1.1b3, 6.1).
    ///
    /// This and the other functions that make a request queue the request and return. The
    /// request has ended when its `status` is no longer MBM_PENDING. Then `status` is MBM_OK, an
    /// exception of the device (0x01 to 0x7F), MBM_RESPONSE_TIMED_OUT, MBM_INVALID_CRC,
    /// MBM_MALFORMED_REPLY, MBM_INVALID_SLAVE_ID, MBM_INVALID_FUNCTION, MBM_LINK_LOST,
    /// MBM_LINE_BUSY, MBM_CONNECT_TIMED_OUT, MBM_BUFFER_TOO_SMALL or MBM_CANCELLED. `reply` changes
    /// only if it is MBM_OK.
    ///
    /// @param address   the first coil, 0 to 65535, as on the wire
    /// @param quantity  the number of coils, 1 to 2000
    /// @return MBM_PENDING if the request is queued. Otherwise nothing was queued, and the
    ///         request's `status` is the same: MBM_ILLEGAL_DATA_VALUE or MBM_ILLEGAL_DATA_ADDRESS
    ///         for a request that no device could accept, MBM_BROADCAST_NOT_ALLOWED,
    ///         MBM_QUEUE_FULL, MBM_DUPLICATE_TRANSACTION, MBM_BUFFER_TOO_SMALL if `reply` cannot
    ///         hold the data, MBM_INVALID_ARGUMENT if `data` is NULL. With the request unchanged:
    ///         MBM_BUSY also if the request is pending already
    fn mbm_client_readCoils(address: u16, quantity: u16)
        = two_words(address, quantity, FunctionSpec::READ_COILS);

    /// Function 02: reads discrete inputs into the bytes of `reply`, as mbm_client_readCoils
    /// does (V1.1b3, 6.2).
    ///
    /// @param address   the first input, 0 to 65535, as on the wire
    /// @param quantity  the number of inputs, 1 to 2000
    /// @return a status; see mbm_client_readCoils
    fn mbm_client_readDiscreteInputs(address: u16, quantity: u16)
        = two_words(address, quantity, FunctionSpec::READ_DISCRETE_INPUTS);

    /// Function 03: reads holding registers into the words of `reply` (V1.1b3, 6.3).
    ///
    /// @param address   the first register, 0 to 65535, as on the wire
    /// @param quantity  the number of registers, 1 to 125
    /// @return a status; see mbm_client_readCoils
    fn mbm_client_readHoldingRegisters(address: u16, quantity: u16)
        = two_words(address, quantity, FunctionSpec::READ_HOLDING_REGISTERS);

    /// Function 04: reads input registers into the words of `reply` (V1.1b3, 6.4).
    ///
    /// @param address   the first register, 0 to 65535, as on the wire
    /// @param quantity  the number of registers, 1 to 125
    /// @return a status; see mbm_client_readCoils
    fn mbm_client_readInputRegisters(address: u16, quantity: u16)
        = two_words(address, quantity, FunctionSpec::READ_INPUT_REGISTERS);

    /// Function 05: switches one coil on or off (V1.1b3, 6.5).
    ///
    /// @param address  the coil, 0 to 65535, as on the wire
    /// @param on       0 is off, any other value is on
    /// @return a status; see mbm_client_readCoils
    fn mbm_client_writeSingleCoil(address: u16, on: u8)
        = two_words(address, coil_value(on != 0), FunctionSpec::WRITE_SINGLE_COIL);

    /// Function 06: writes one holding register (V1.1b3, 6.6).
    ///
    /// @param address  the register, 0 to 65535, as on the wire
    /// @param value    its new value
    /// @return a status; see mbm_client_readCoils
    fn mbm_client_writeSingleRegister(address: u16, value: u16)
        = two_words(address, value, FunctionSpec::WRITE_SINGLE_REGISTER);

    /// Function 0F: writes coils from the bytes of `data`, eight in each byte. The first coil is
    /// the lowest bit (V1.1b3, 6.11).
    ///
    /// @param address   the first coil, 0 to 65535, as on the wire
    /// @param quantity  the number of coils, 1 to 1968
    /// @return a status; see mbm_client_readCoils
    fn mbm_client_writeMultipleCoils(address: u16, quantity: u16)
        = two_words(address, quantity, FunctionSpec::WRITE_MULTIPLE_COILS);

    /// Function 10: writes the words of `data` to holding registers (V1.1b3, 6.12).
    ///
    /// @param address   the first register, 0 to 65535, as on the wire
    /// @param quantity  the number of registers, 1 to 123
    /// @return a status; see mbm_client_readCoils
    fn mbm_client_writeMultipleRegisters(address: u16, quantity: u16)
        = two_words(address, quantity, FunctionSpec::WRITE_MULTIPLE_REGISTERS);

    /// Function 16: sets a holding register to (register & andMask) | (orMask & ~andMask)
    /// (V1.1b3, 6.16).
    ///
    /// @param address  the register, 0 to 65535, as on the wire
    /// @param andMask  1 for each bit of the register to keep
    /// @param orMask   the new value of the bits that are not kept
    /// @return a status; see mbm_client_readCoils
    fn mbm_client_maskWriteRegister(address: u16, andMask: u16, orMask: u16)
        = with_more(
            FunctionSpec::MASK_WRITE_REGISTER, [address.into(), andMask.into(), orMask.into(), 0],
            None);

    /// Function 17: the device writes the words of `data` to holding registers first. Then it
    /// reads holding registers, which arrive in the words of `reply` (V1.1b3, 6.17).
    ///
    /// @param readAddress    the first register to read, 0 to 65535
    /// @param readQuantity   the number of registers to read, 1 to 125
    /// @param writeAddress   the first register to write, 0 to 65535
    /// @param writeQuantity  the number of registers to write, 1 to 121
    /// @return a status; see mbm_client_readCoils
    fn mbm_client_readWriteMultipleRegisters(
        readAddress: u16, readQuantity: u16, writeAddress: u16, writeQuantity: u16)
        = with_more(
            FunctionSpec::READ_WRITE_REGISTERS,
            [readAddress.into(), readQuantity.into(), writeAddress.into(), writeQuantity.into()],
            Some(add_write));
}

/// Adds the registers that the request writes.
///
/// # Safety
/// Always safe. It is unsafe only to have the type [`More`](super::More).
unsafe fn add_write(fields: &mut RequestFields, words: &[usize; 4], readable: Status) -> Status {
    let header = &mut fields.state.header;
    match header.add_write(words[2] as u16, words[3] as u16) {
        Status::OK => readable,
        refused => refused,
    }
}
