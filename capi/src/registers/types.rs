//! Gets and sets numbers in other forms than those of get.rs and set.rs. Each function is linked
//! only if it is called.

use super::get::get_value;
use super::mbm_registers;
use super::set::with;
use crate::pointers::{In, Out};

functions! {
    safe (registers: In<mbm_registers>)

    /// Reads a number in BCD: four digits in one register, eight in two.
    ///
    /// @param address  the device's address of its first register
    /// @param count    how many registers, 1 or 2
    /// @param order    one of MBM_ORDER_...; MBM_ORDER_DEFAULT for the order of `registers`
    /// @param value    receives the number
    /// @return a status; see mbm_registers. MBM_MALFORMED_VALUE for a digit above 9
    fn mbm_registers_getBcd(address: u16, count: u16, order: u8, value: Out<u32>)
        = get_value(order, value, |registers| registers.bcd(registers.order, address, count));

    /// Writes a number in BCD, as mbm_registers_getBcd reads it.
    ///
    /// @return as mbm_registers_setUint16; MBM_OUT_OF_RANGE for a number with more digits
    fn mbm_registers_setBcd(address: u16, count: u16, order: u8, value: u32)
        = with(order, |registers| registers.set_bcd(registers.order, address, count, value));

    /// Reads a number of which each register holds four decimal digits, 0 to 9999: M10K or
    /// Mod10 of Schneider's meters. Many have the lowest register first: MBM_ORDER_CDAB.
    ///
    /// @param count    how many registers, 1 to 4
    /// @param value    receives the number
    /// @return as mbm_registers_getBcd; MBM_MALFORMED_VALUE for a register above 9999
    fn mbm_registers_getM10k(address: u16, count: u16, order: u8, value: Out<u64>)
        = get_value(order, value, |registers| registers.m10k(registers.order, address, count));

    /// Writes such a number, as mbm_registers_getM10k reads it.
    ///
    /// @param value    points to the number
    /// @return as mbm_registers_setUint16; MBM_OUT_OF_RANGE for a number with more digits
    fn mbm_registers_setM10k(address: u16, count: u16, order: u8, value: In<u64>)
        = with(order, |registers| {
            registers.set_m10k(registers.order, address, count, value.get()?)
        });

    /// As mbm_registers_getM10k, with a sign in each register: -9999 to 9999.
    fn mbm_registers_getSignedM10k(address: u16, count: u16, order: u8, value: Out<i64>)
        = get_value(order, value, |registers| {
            registers.signed_m10k(registers.order, address, count)
        });

    /// As mbm_registers_setM10k. Each register that is not 0 gets the sign.
    fn mbm_registers_setSignedM10k(address: u16, count: u16, order: u8, value: In<i64>)
        = with(order, |registers| {
            registers.set_signed_m10k(registers.order, address, count, value.get()?)
        });

    /// Reads a number of 24 bits, in the low bits of two registers. The eight bits above it do
    /// not count; mbm_registers_getBits reads them.
    ///
    /// @return as mbm_registers_getUint16
    fn mbm_registers_getUint24(address: u16, order: u8, value: Out<u32>)
        = get_value(order, value, |registers| registers.u24(registers.order, address));

    /// Writes a number of 24 bits. The eight bits above it become 0.
    ///
    /// @return as mbm_registers_setUint16; MBM_OUT_OF_RANGE for a number with more bits
    fn mbm_registers_setUint24(address: u16, order: u8, value: u32)
        = with(order, |registers| registers.set_u24(registers.order, address, value));

    /// As mbm_registers_getUint24, with a sign, in two's complement.
    fn mbm_registers_getInt24(address: u16, order: u8, value: Out<i32>)
        = get_value(order, value, |registers| registers.i24(registers.order, address));

    /// As mbm_registers_setUint24, with a sign. The eight bits above it become copies of it.
    fn mbm_registers_setInt24(address: u16, order: u8, value: i32)
        = with(order, |registers| registers.set_i24(registers.order, address, value));

    /// Reads a number of 48 bits in three registers.
    ///
    /// @return as mbm_registers_getUint16; MBM_INVALID_ARGUMENT for an order by halves
    fn mbm_registers_getUint48(address: u16, order: u8, value: Out<u64>)
        = get_value(order, value, |registers| registers.u48(registers.order, address));

    /// Writes a number of 48 bits.
    ///
    /// @param value    points to the number
    /// @return as mbm_registers_setUint24; MBM_INVALID_ARGUMENT for an order by halves
    fn mbm_registers_setUint48(address: u16, order: u8, value: In<u64>)
        = with(order, |registers| {
            registers.set_u48(registers.order, address, value.get()?)
        });

    /// As mbm_registers_getUint48, with a sign, in two's complement.
    fn mbm_registers_getInt48(address: u16, order: u8, value: Out<i64>)
        = get_value(order, value, |registers| registers.i48(registers.order, address));

    /// As mbm_registers_setUint48, with a sign.
    fn mbm_registers_setInt48(address: u16, order: u8, value: In<i64>)
        = with(order, |registers| {
            registers.set_i48(registers.order, address, value.get()?)
        });

    /// Reads a number whose highest bit is its sign, and whose other bits are its amount.
    ///
    /// @param count    how many registers, 1 or 2
    /// @param value    receives the number; 0 for both zeros
    /// @return as mbm_registers_getUint16
    fn mbm_registers_getSignMagnitude(address: u16, count: u16, order: u8, value: Out<i32>)
        = get_value(order, value, |registers| {
            registers.sign_magnitude(registers.order, address, count)
        });

    /// Writes such a number, as mbm_registers_getSignMagnitude reads it: up to 32767 in one register
    /// and 2147483647 in two.
    ///
    /// @return as mbm_registers_setUint24
    fn mbm_registers_setSignMagnitude(address: u16, count: u16, order: u8, value: i32)
        = with(order, |registers| {
            registers.set_sign_magnitude(registers.order, address, count, value)
        });

    /// Reads a half float of one register, an IEEE 754 binary16. A float holds each exactly.
    ///
    /// @return as mbm_registers_getUint16
    fn mbm_registers_getHalf(address: u16, order: u8, value: Out<f32>)
        = get_value(order, value, |registers| registers.half(registers.order, address));

    /// Writes a half float: the one that is nearest to a float.
    ///
    /// @param value    points to the number
    /// @return as mbm_registers_setUint16; MBM_OUT_OF_RANGE from 65520 on, and for a number other
    ///         than 0 that is nearer to 0 than to a half float
    fn mbm_registers_setHalf(address: u16, order: u8, value: In<f32>)
        = with(order, |registers| {
            let number = f32::from_bits(value.cast::<u32>().get()?);
            registers.set_half(registers.order, address, number)
        });

    /// Reads bits of a field of 1 to 4 registers as one number.
    ///
    /// @param count    how many registers the field has, 1 to 4
    /// @param first    the lowest of the bits; 0 is the least significant of the field
    /// @param bits     how many bits, 1 to 64, not beyond those of the field
    /// @param value    receives the number
    /// @return as mbm_registers_getUint16; MBM_INVALID_ARGUMENT for an order by halves of three
    ///         registers
    fn mbm_registers_getBits(
        address: u16, count: u16, order: u8, first: u8, bits: u8, value: Out<u64>
    ) = get_value(order, value, |registers| {
        registers.bits(registers.order, address, count, first, bits)
    });

    /// Writes bits of a field of 1 to 4 registers; its other bits do not change.
    ///
    /// @param value    points to the number
    /// @return as mbm_registers_getBits; MBM_OUT_OF_RANGE for a number with more bits
    fn mbm_registers_setBits(
        address: u16, count: u16, order: u8, first: u8, bits: u8, value: In<u64>
    ) = with(order, |registers| {
        let number = value.get()?;
        registers.set_bits(registers.order, address, count, first, bits, number)
    });
}
