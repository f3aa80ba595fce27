//! The ten functions, and their forms that use the queue of words to send.

use super::{call, mbm_node, mbm_node_available, request};
use mbm::error::Status;
use mbm::pdu::functions::FunctionSpec;

functions! {
    (node: *mut mbm_node)

    /// Function 01: reads coils into the response words, 16 in each word. The first coil is the
    /// lowest bit; the last word is padded with zeros (V1.1b3, 6.1).
    ///
    /// All functions that make a request behave as follows. In blocking mode they return when
    /// the request has ended. In non-blocking mode they return MBM_PENDING at once, and you call
    /// mbm_node_poll until the request has ended.
    ///
    /// They empty the queue of mbm_node_send, and mbm_node_receive starts again at the first
    /// word, unless they return MBM_BUSY, MBM_NOT_INITIALISED or MBM_INVALID_ARGUMENT. The
    /// response words change only on success. The transmit words do not change, except that 06
    /// and 16 store their arguments there.
    ///
    /// The master does not send a request that no device could accept, with a quantity that the
    /// standard forbids or addresses beyond 65535. The status is then the exception with which a
    /// device would answer.
    ///
    /// @param address   the first coil, 0 to 65535, as on the wire
    /// @param quantity  the number of coils, 1 to 2000
    /// @return a status; MBM_PENDING in non-blocking mode; an exception of the device (0x01 to
    ///         0x7F); MBM_RESPONSE_TIMED_OUT, MBM_INVALID_CRC, MBM_MALFORMED_REPLY,
    ///         MBM_INVALID_SLAVE_ID, MBM_INVALID_FUNCTION, MBM_LINK_LOST, MBM_LINE_BUSY,
    ///         MBM_BUFFER_TOO_SMALL, MBM_BROADCAST_NOT_ALLOWED or MBM_CANCELLED; MBM_BUSY while a
    ///         request is pending on the line; MBM_NOT_INITIALISED if the line has no port or no
    ///         frame buffer
    fn mbm_node_readCoils(address: u16, quantity: u16)
        = call(address, quantity, FunctionSpec::READ_COILS.short());

    /// Function 02: reads discrete inputs into the response words, 16 in each word. The first
    /// input is the lowest bit; the last word is padded with zeros (V1.1b3, 6.2).
    ///
    /// @param address   the first input, 0 to 65535, as on the wire
    /// @param quantity  the number of inputs, 1 to 2000
    /// @return a status; see mbm_node_readCoils
    fn mbm_node_readDiscreteInputs(address: u16, quantity: u16)
        = call(address, quantity, FunctionSpec::READ_DISCRETE_INPUTS.short());

    /// Function 03: reads holding registers into the response words (V1.1b3, 6.3).
    ///
    /// @param address   the first register, 0 to 65535, as on the wire
    /// @param quantity  the number of registers, 1 to 125
    /// @return a status; see mbm_node_readCoils
    fn mbm_node_readHoldingRegisters(address: u16, quantity: u16)
        = call(address, quantity, FunctionSpec::READ_HOLDING_REGISTERS.short());

    /// Function 04: reads input registers into the response words (V1.1b3, 6.4).
    ///
    /// @param address   the first register, 0 to 65535, as on the wire
    /// @param quantity  the number of registers, 1 to 125
    /// @return a status; see mbm_node_readCoils
    fn mbm_node_readInputRegisters(address: u16, quantity: u16)
        = call(address, quantity, FunctionSpec::READ_INPUT_REGISTERS.short());

    /// Function 05: switches one coil on or off (V1.1b3, 6.5). With unit 0 it is a broadcast.
    ///
    /// @param address  the coil, 0 to 65535; becomes the write address
    /// @param state    0 is off, any other value is on
    /// @return a status; see mbm_node_readCoils
    fn mbm_node_writeSingleCoil(address: u16, state: u8)
        = request(|node, line| node.write_single_coil(line, address, state.into()));

    /// Function 06: writes one register (V1.1b3, 6.6). With unit 0 it is a broadcast.
    ///
    /// @param address  the register, 0 to 65535; becomes the write address
    /// @param value    its value; also becomes transmit word 0
    /// @return a status; see mbm_node_readCoils
    fn mbm_node_writeSingleRegister(address: u16, value: u16)
        = request(|node, line| node.write_single_register(line, address, value));

    /// Function 0F: writes coils from the transmit words, starting at word 0. The first coil is
    /// the lowest bit (V1.1b3, 6.11). With unit 0 it is a broadcast.
    ///
    /// @param address   the first coil, 0 to 65535; becomes the write address
    /// @param quantity  the number of coils, 1 to 1968, and not more than the transmit words hold
    /// @return a status; see mbm_node_readCoils
    fn mbm_node_writeMultipleCoils(address: u16, quantity: u16)
        = call(address, quantity, FunctionSpec::WRITE_MULTIPLE_COILS.short());

    /// Function 0F: writes the queued bits to coils, starting at the last write address. Call
    /// mbm_node_beginTransmission and mbm_node_sendBit before.
    ///
    /// @return a status; see mbm_node_readCoils
    fn mbm_node_writeQueuedCoils() = request(|node, line| node.write_queued_coils(line));

    /// Function 10: writes registers from the transmit words, starting at word 0 (V1.1b3, 6.12).
    /// With unit 0 it is a broadcast.
    ///
    /// @param address   the first register, 0 to 65535; becomes the write address
    /// @param quantity  the number of registers, 1 to 123, and not more than the transmit words
    /// @return a status; see mbm_node_readCoils
    fn mbm_node_writeMultipleRegisters(address: u16, quantity: u16)
        = call(address, quantity, FunctionSpec::WRITE_MULTIPLE_REGISTERS.short());

    /// Function 10: writes the queued complete words to registers, starting at the last write
    /// address. Call mbm_node_beginTransmission and mbm_node_send before.
    ///
    /// @return a status; see mbm_node_readCoils
    fn mbm_node_writeQueuedRegisters() = request(|node, line| node.write_queued_registers(line));

    /// Function 16: the device sets a register to
    /// (register AND andMask) OR (orMask AND NOT andMask) (V1.1b3, 6.16).
    /// With unit 0 it is a broadcast.
    ///
    /// @param address  the register, 0 to 65535; becomes the write address
    /// @param andMask  1 for each bit of the register to keep; also becomes transmit word 0
    /// @param orMask   the new value of the bits that are not kept; also becomes transmit word 1
    /// @return a status; see mbm_node_readCoils
    fn mbm_node_maskWriteRegister(address: u16, andMask: u16, orMask: u16)
        = request(|node, line| node.mask_write_register(line, address, andMask, orMask));

    /// Function 17: the device writes the transmit words to registers first. Then it reads
    /// registers, which arrive in the response words. Both in one request (V1.1b3, 6.17).
    ///
    /// @param readAddress    the first register to read, 0 to 65535
    /// @param readQuantity   the number of registers to read, 1 to 125
    /// @param writeAddress   the first register to write, 0 to 65535; becomes the write address
    /// @param writeQuantity  the number of registers to write, 1 to 121, and not more than the
    ///                       transmit words
    /// @return a status; see mbm_node_readCoils
    fn mbm_node_readWriteMultipleRegisters(
        readAddress: u16, readQuantity: u16, writeAddress: u16, writeQuantity: u16)
        = request(|node, line| {
            let (read, write) = ((readAddress, readQuantity), (writeAddress, writeQuantity));
            node.read_write_multiple_registers(line, read, write)
        });

    /// Function 17: as mbm_node_readWriteMultipleRegisters, but writes the queued complete
    /// words, starting at the last write address.
    ///
    /// @param readAddress   the first register to read, 0 to 65535
    /// @param readQuantity  the number of registers to read, 1 to 125
    /// @return a status; see mbm_node_readCoils
    fn mbm_node_readWriteQueuedRegisters(readAddress: u16, readQuantity: u16)
        = request(|node, line| node.read_write_queued_registers(line, (readAddress, readQuantity)));
}

/// Reads holding registers into the response words. mbm_node_receive then returns them one after
/// the other.
///
/// @param address   the first register, 0 to 65535, as on the wire
/// @param quantity  the number of registers, 1 to 125
/// @return the number of words that mbm_node_receive will return; 0 if the request failed, as
///         mbm_node_status says, if another request is pending, and in non-blocking mode
#[no_mangle]
pub unsafe extern "C" fn mbm_node_requestFrom(
    node: *mut mbm_node,
    address: u16,
    quantity: u16,
) -> u8 {
    match mbm_node_readHoldingRegisters(node, address, quantity) {
        status if status == Status::OK.code() => mbm_node_available(node),
        _ => 0,
    }
}
