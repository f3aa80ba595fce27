/**
 * @file mbm/values.h
 * @brief Values: registers and bits as numbers and texts.
 *
 * Licence: MIT OR Apache-2.0. Generated from the source of mbm; do not edit. A part of
 * mbm.h, at whose head are the rules of every function.
 */

#ifndef MBM_VALUES_H
#define MBM_VALUES_H

#include "base.h"

#if defined(__AVR__) && __SIZEOF_DOUBLE__ != 4
/* The archive has a double of 32 bits: what calls these must not link. */
#define mbm_registers_getDouble mbm_registers_getDouble_wants_mdouble_32
#define mbm_registers_setDouble mbm_registers_setDouble_wants_mdouble_32
#endif

#ifdef __cplusplus
extern "C" {
#endif

/* ==== Values: registers and bits as numbers, in words or bytes ====================== */

/** Passed to a function: use the order of the mbm_registers. As that order itself:
 *  MBM_ORDER_ABCD. */
#define MBM_ORDER_DEFAULT 0u
/** High word first, high byte first, as most devices do. A is the most significant byte.
 *  Example: 2923517522, which is 0xAE415652, is transmitted as AE41 5652 (hex). */
#define MBM_ORDER_ABCD 1u
/** Low word first, high byte first. The example is transmitted as 5652 AE41. */
#define MBM_ORDER_CDAB 2u
/** High word first, low byte first. The example is transmitted as 41AE 5256. */
#define MBM_ORDER_BADC 3u
/** Low word first, low byte first. The example is transmitted as 5256 41AE. */
#define MBM_ORDER_DCBA 4u
/** Four registers by halves: low half first, and within a half high word first, high byte first.
 *  For a value of two registers it is MBM_ORDER_ABCD, which is such a half. */
#define MBM_ORDER_EFGHABCD 5u

/**
 * Four registers by halves: high half first, and within a half low word first, as MBM_ORDER_CDAB.
 */
#define MBM_ORDER_CDABGHEF 6u

/**
 * Four registers by halves: low half first, and within a half low byte first, as MBM_ORDER_BADC.
 */
#define MBM_ORDER_FEHGBADC 7u
/** Four registers by halves: high half first, and within a half low word and low byte first, as
 *  MBM_ORDER_DCBA. */
#define MBM_ORDER_DCBAHGFE 8u
/** mbm_registers.kind: words that may only be read, for example the response words of
 *  mbm_node. */
#define MBM_REGISTERS_OF_WORDS 1u
/** mbm_registers.kind: bytes that may only be read, the high byte of each register first. */
#define MBM_REGISTERS_OF_BYTES 2u
/** mbm_registers.kind: words that may be read and written. */
#define MBM_REGISTERS_INTO_WORDS 3u
/** mbm_registers.kind: bytes that may be read and written, the high byte of each register
 *  first. */
#define MBM_REGISTERS_INTO_BYTES 4u
/** A flag of mbm_date: the device's clock shows summer time. Only IEC 870-5-4 has it. */
#define MBM_DATE_SUMMER_TIME 1u
/** A flag of mbm_date: the device says that its clock may be wrong. Only IEC 870-5-4 has it. */
#define MBM_DATE_UNRELIABLE 2u
/** A form of text: each register has one character, in its low byte. */
#define MBM_TEXT_LOW_BYTES 1u
/** A form of text: each register has one character, in its high byte. */
#define MBM_TEXT_HIGH_BYTES 2u
/** A form of text, alone or added to one of the others: the rest of the field has spaces. */
#define MBM_TEXT_SPACES 4u

/**
 * A view of consecutive registers, with the addresses that the device gives them. The
 * view owns nothing: `data` points to memory of the program.
 *
 * mbm_registers_ofWords, ofBytes, intoWords and intoBytes fill the view in. You may also
 * set each field yourself. The get and set functions do not change the view. Several
 * threads may use one view at the same time as long as none of them writes the registers.
 * They return MBM_ILLEGAL_DATA_ADDRESS if a register that they need is not in the view.
 */
typedef struct mbm_registers {
    /** The words or bytes; `kind` says which. If it is NULL, every function returns
     *  MBM_NOT_INITIALISED. */
    const void *data;
    /** The device's address of the first register. */
    uint16_t first;
    /** How many registers; `first + count` is at most 65536. */
    uint16_t count;
    /** One of MBM_REGISTERS_... */
    uint8_t kind;
    /** One of MBM_ORDER_...: the order for calls with MBM_ORDER_DEFAULT. */
    uint8_t order;
} mbm_registers;

/**
 * A date and a time of day, in the time zone of the device. If year, month and day are 0, a time
 * of day without a date.
 */
typedef struct mbm_date {
    /** 1 to 9999. */
    uint16_t year;
    /** 0 to 999. */
    uint16_t millisecond;
    /** 1 to 12. */
    uint8_t month;
    /** 1 to 31. */
    uint8_t day;
    /** 0 to 23. */
    uint8_t hour;
    /** 0 to 59. */
    uint8_t minute;
    /** 0 to 59. */
    uint8_t second;
    /** MBM_DATE_..., added up. */
    uint8_t flags;
} mbm_date;

/**
 * Packs coils into bytes for a write. The first coil goes into the lowest bit of the
 * first byte (V1.1b3, 6.11). Unused bits of the last byte become 0; the bytes after it do
 * not change.
 *
 * @param coils     one byte for each coil: 0 is off, any other value is on
 * @param quantity  the number of coils, 0 to 65535
 * @param bytes     receives the bits, 8 in each byte
 * @param length    the number of bytes that `bytes` can hold
 * @return a status; MBM_BUFFER_TOO_SMALL, with nothing packed
 */
uint8_t mbm_bits_pack(const uint8_t *coils, uint16_t quantity, uint8_t *bytes, uint16_t length);

/**
 * Unpacks the coils or discrete inputs that a read returned in bytes (V1.1b3, 6.1).
 *
 * @param bytes     the bits, 8 in each byte; the first coil is the lowest bit
 * @param length    the number of bytes
 * @param coils     receives one byte for each coil, 0 or 1
 * @param quantity  the number of coils, 0 to 65535
 * @return a status; MBM_ILLEGAL_DATA_ADDRESS if `bytes` has fewer bits than `quantity`
 */
uint8_t mbm_bits_unpack(const uint8_t *bytes, uint16_t length, uint8_t *coils, uint16_t quantity);

/**
 * Gets the state of one coil or discrete input of a read, by its address in the device.
 *
 * @param bytes     the bits of the read, 8 in each byte; the first coil is the lowest bit
 * @param first     the address of the first coil of the read
 * @param quantity  the number of coils that were read; `bytes` holds that many bits
 * @param address   the address of the coil
 * @param on        receives 0 or 1
 * @return a status; MBM_ILLEGAL_DATA_ADDRESS if the coil is outside of the read or the read
 *         passes address 65535
 */
uint8_t mbm_bits_isSet(const uint8_t *bytes, uint16_t first, uint16_t quantity, uint16_t address,
                       uint8_t *on);

/**
 * Sets one coil of a write, by its address in the device. The other coils do not change.
 *
 * @param bytes     the bits of the write, 8 in each byte; the first coil is the lowest bit
 * @param first     the address of the first coil of the write
 * @param quantity  the number of coils of the write; `bytes` holds that many bits
 * @param address   the address of the coil
 * @param on        0 is off, any other value is on
 * @return a status; MBM_ILLEGAL_DATA_ADDRESS if the coil is outside of the write or the write
 *         passes address 65535
 */
uint8_t mbm_bits_set(uint8_t *bytes, uint16_t first, uint16_t quantity, uint16_t address,
                     uint8_t on);

/**
 * As mbm_bits_isSet, but in words, for example the response words of a node.
 *
 * @param words     the bits of the read, 16 in each word; the first coil is the lowest bit
 * @return a status; MBM_ILLEGAL_DATA_ADDRESS if the coil is outside of the read or the read
 *         passes address 65535
 */
uint8_t mbm_bits_isSetInWords(const uint16_t *words, uint16_t first, uint16_t quantity,
                              uint16_t address, uint8_t *on);

/**
 * As mbm_bits_set, but in words, for example the transmit words of a node.
 *
 * @param words     the bits of the write, 16 in each word; the first coil is the lowest bit
 * @return a status; MBM_ILLEGAL_DATA_ADDRESS if the coil is outside of the write or the write
 *         passes address 65535
 */
uint8_t mbm_bits_setInWords(uint16_t *words, uint16_t first, uint16_t quantity, uint16_t address,
                            uint8_t on);

/**
 * Fills in a view of words that were read as registers. The order is MBM_ORDER_ABCD
 * until you set `registers->order`. Nothing is copied: the view always shows the present
 * words.
 *
 * @param registers  the view to fill in; without data after an error
 * @param words      the words, for example the response words of mbm_node; must stay valid
 *                   while the view is used. NULL only if `count` is 0
 * @param count      how many words
 * @param first      the device's address of the first register, 0 to 65535
 * @return a status; MBM_ILLEGAL_DATA_ADDRESS if the last address is greater than 65535
 */
uint8_t mbm_registers_ofWords(mbm_registers *registers, const uint16_t *words, uint16_t count,
                              uint16_t first);

/**
 * As mbm_registers_ofWords, for the data bytes of a reply or a request.
 *
 * @param bytes      the bytes, the high byte of each register first (V1.1b3, 4.2); must stay
 *                   valid while the view is used
 * @param length     how many bytes, an even number
 * @return a status; see mbm_registers_ofWords. MBM_INVALID_ARGUMENT for an odd length
 */
uint8_t mbm_registers_ofBytes(mbm_registers *registers, const uint8_t *bytes, uint16_t length,
                              uint16_t first);

/**
 * As mbm_registers_ofWords, for words that you also write, for example the transmit
 * words of mbm_node.
 *
 * @return a status; see mbm_registers_ofWords
 */
uint8_t mbm_registers_intoWords(mbm_registers *registers, uint16_t *words, uint16_t count,
                                uint16_t first);

/**
 * As mbm_registers_ofBytes, for bytes that you also write.
 *
 * @return a status; see mbm_registers_ofBytes
 */
uint8_t mbm_registers_intoBytes(mbm_registers *registers, uint8_t *bytes, uint16_t length,
                                uint16_t first);

/**
 * Sets the order of the values that calls with MBM_ORDER_DEFAULT read and write.
 *
 * @param registers  the view, filled in
 * @param order      one of MBM_ORDER_...; MBM_ORDER_DEFAULT for MBM_ORDER_ABCD
 */
uint8_t mbm_registers_setByteOrder(mbm_registers *registers, uint8_t order);

/**
 * Reads a date, or a time of day, from registers of which `layout` says what they hold. It has
 * a letter for each register, or two for its high and low byte, and a space between two
 * registers: "Y M D h m s" are six registers, "yM Dh ms" three.
 *
 * Y is the year, such as 2026, as a register; y the years since 2000; n those since 1900; C and
 * y together the first and the last two digits of the year. M and D are month and day from 1
 * on, h, m and s the time, and f, as a register, milliseconds. What - stands for is not read,
 * and written as 0. A part that is missing is 0. Without year, month and day it is a time of
 * day.
 *
 * @param address  the device's address of the first register
 * @param order    one of MBM_ORDER_...; MBM_ORDER_DEFAULT for the order of `registers`. The
 *                 registers follow each other in every order; one with the low byte first swaps
 *                 the bytes of each
 * @param layout   what the registers hold, up to 95 characters
 * @param isBcd    not 0 if the numbers are in BCD
 * @param value    receives the date, without flags
 * @return a status; see mbm_registers. MBM_MALFORMED_VALUE for a date that does not exist, or a
 *         digit above 9
 */
uint8_t mbm_registers_getDate(const mbm_registers *registers, uint16_t address, uint8_t order,
                              const char *layout, uint8_t isBcd, mbm_date *value);

/**
 * Writes a date, as mbm_registers_getDate reads it. Its flags do not count.
 *
 * @param value    the date
 * @return as mbm_registers_setUint16; MBM_INVALID_ARGUMENT for a date that does not exist;
 *         MBM_OUT_OF_RANGE for one that the layout cannot hold exactly
 */
uint8_t mbm_registers_setDate(const mbm_registers *registers, uint16_t address, uint8_t order,
                              const char *layout, uint8_t isBcd, const mbm_date *value);

/**
 * Reads a date of IEC 870-5-4, with its flags, from three registers, or from four with
 * milliseconds: DATETIME and TI081 of Schneider's devices. With MBM_ORDER_CDAB the first
 * register is the last one.
 *
 * @param count    how many registers, 3 or 4
 * @param value    receives the date, 2000 to 2127
 * @return as mbm_registers_getDate
 */
uint8_t mbm_registers_getIecDate(const mbm_registers *registers, uint16_t address, uint16_t count,
                                 uint8_t order, mbm_date *value);

/**
 * Writes a date, as mbm_registers_getIecDate reads it, with its flags and no day of the week.
 *
 * @param value    the date
 * @return as mbm_registers_setDate
 */
uint8_t mbm_registers_setIecDate(const mbm_registers *registers, uint16_t address, uint16_t count,
                                 uint8_t order, const mbm_date *value);

/**
 * The seconds from 1970-01-01 00:00:00 to a date, as if both were in UTC. Milliseconds and flags do
 * not count.
 *
 * @param date     the date; not a time of day alone
 * @param seconds  receives the number, below 0 before 1970
 * @return a status; MBM_INVALID_ARGUMENT for a date that does not exist
 */
uint8_t mbm_date_getSeconds(const mbm_date *date, int64_t *seconds);

/**
 * Sets the date that is so many seconds after 1970-01-01 00:00:00, both in UTC.
 *
 * @param date     receives the date, without milliseconds and flags
 * @param seconds  points to the number
 * @return a status; MBM_OUT_OF_RANGE before the year 1 and after 9999
 */
uint8_t mbm_date_setSeconds(mbm_date *date, const int64_t *seconds);

/**
 * Reads one bit of a register.
 *
 * @param address  the device's address of the register
 * @param bit      0, the least significant, to 15
 * @param on       receives 0 or 1
 * @return a status; see mbm_registers
 */
uint8_t mbm_registers_getBit(const mbm_registers *registers, uint16_t address, uint8_t bit,
                             uint8_t *on);

/**
 * Reads one byte of a register, 0 to 255.
 *
 * @param address  the device's address of the register
 * @param high     0 for the low byte, anything else for the high byte, which is transmitted
 *                 first. No order of `registers` exchanges them
 * @param value    receives the byte
 * @return a status; see mbm_registers
 */
uint8_t mbm_registers_getUint8(const mbm_registers *registers, uint16_t address, uint8_t high,
                               uint8_t *value);

/** As mbm_registers_getUint8, for a signed byte in two's complement, -128 to 127. */
uint8_t mbm_registers_getInt8(const mbm_registers *registers, uint16_t address, uint8_t high,
                              int8_t *value);

/**
 * Compares registers with bytes, in the order of the wire: the high byte of each register
 * first, whatever the order of `registers`.
 *
 * @param address  the device's address of the register whose high byte is compared with the
 *                 first byte
 * @param bytes    the bytes
 * @param length   how many bytes, two for each register; may be odd
 * @param equal    receives 1 if all bytes are equal, otherwise 0. It is 1 for no bytes
 * @return a status; see mbm_registers
 */
uint8_t mbm_registers_isEqualBytes(const mbm_registers *registers, uint16_t address,
                                   const uint8_t *bytes, uint16_t length, uint8_t *equal);

/**
 * Reads a number of one register, 0 to 65535. For a signed number, pass a pointer to an
 * int16_t, cast to uint16_t *. The order of words has no effect; the order of bytes has.
 *
 * @param address  the device's address of its first register
 * @param order    one of MBM_ORDER_...; MBM_ORDER_DEFAULT for the order of `registers`
 * @param value    receives the number
 * @return a status; see mbm_registers
 */
uint8_t mbm_registers_getUint16(const mbm_registers *registers, uint16_t address, uint8_t order,
                                uint16_t *value);

/**
 * Reads a number of two registers, 0 to 4294967295. For a signed number (two's
 * complement), pass a pointer to an int32_t, cast to uint32_t *.
 *
 * @return as mbm_registers_getUint16
 */
uint8_t mbm_registers_getUint32(const mbm_registers *registers, uint16_t address, uint8_t order,
                                uint32_t *value);

/**
 * Reads a number of four registers. For a signed number, pass a pointer to an int64_t,
 * cast to uint64_t *.
 *
 * @return as mbm_registers_getUint16
 */
uint8_t mbm_registers_getUint64(const mbm_registers *registers, uint16_t address, uint8_t order,
                                uint64_t *value);

/**
 * Reads a float of two registers, an IEEE 754 binary32. Its bits are copied, also those
 * of a NaN.
 *
 * @return as mbm_registers_getUint16
 */
uint8_t mbm_registers_getFloat(const mbm_registers *registers, uint16_t address, uint8_t order,
                               float *value);

/**
 * Reads a double of four registers, an IEEE 754 binary64. Its bits are copied. On AVR,
 * where a double of C has 32 bits (-mdouble=32), the number is rounded to the nearest.
 *
 * @return as mbm_registers_getUint16
 */
uint8_t mbm_registers_getDouble(const mbm_registers *registers, uint16_t address, uint8_t order,
                                double *value);

/**
 * Reads a text. It ends at its first NUL or at the end of its field.
 *
 * The registers of a text follow each other in every order. In an order with the low
 * byte first, the first of two characters is the low byte of a register. Characters are
 * copied without a check, also if they are not ASCII.
 *
 * @param address   the device's address of the first register of the field
 * @param length    length of the field in bytes, two for each register; an odd length ends with
 *                  the first character of a register
 * @param order     one of MBM_ORDER_...; MBM_ORDER_DEFAULT for the order of `registers`
 * @param text      receives the text and a NUL
 * @param capacity  size of `text` in bytes; `length + 1` are always enough
 * @return a status; see mbm_registers. MBM_BUFFER_TOO_SMALL if `text` is
 */
uint8_t mbm_registers_getString(const mbm_registers *registers, uint16_t address, uint16_t length,
                                uint8_t order, char *text, uint16_t capacity);

/**
 * Reads raw bytes. With MBM_ORDER_ABCD and MBM_ORDER_CDAB the high byte of each register
 * is first, as on the wire; with MBM_ORDER_BADC and MBM_ORDER_DCBA the low byte, for a
 * device that swaps the bytes of its registers.
 *
 * @param address  the device's address of the first register
 * @param order    one of MBM_ORDER_...; MBM_ORDER_DEFAULT for the order of `registers`
 * @param bytes    receives the bytes; must not overlap the registers
 * @param length   how many bytes, two for each register; may be odd
 * @return a status; see mbm_registers
 */
uint8_t mbm_registers_getBytes(const mbm_registers *registers, uint16_t address, uint8_t order,
                               uint8_t *bytes, uint16_t length);

/**
 * Writes one bit of a register; the other bits do not change.
 *
 * @param registers  the registers, of a kind that may be written
 * @param address    the device's address of the register
 * @param bit        0, the least significant, to 15
 * @param on         0 for off, anything else for on
 * @return a status; see mbm_registers
 */
uint8_t mbm_registers_setBit(const mbm_registers *registers, uint16_t address, uint8_t bit,
                             uint8_t on);

/**
 * Writes one byte of a register; the other byte does not change.
 *
 * @param registers  the registers, of a kind that may be written
 * @param address    the device's address of the register
 * @param high       0 for the low byte, anything else for the high byte, which is transmitted
 *                   first. No order of `registers` exchanges them
 * @param value      the byte, 0 to 255
 * @return a status; see mbm_registers
 */
uint8_t mbm_registers_setUint8(const mbm_registers *registers, uint16_t address, uint8_t high,
                               uint8_t value);

/**
 * As mbm_registers_setUint8, for a signed byte in two's complement.
 *
 * @param value  the byte, -128 to 127
 */
uint8_t mbm_registers_setInt8(const mbm_registers *registers, uint16_t address, uint8_t high,
                              int8_t value);

/**
 * Writes a number into one register. The order of words has no effect; the order of
 * bytes has.
 *
 * @param registers  the registers, of a kind that may be written
 * @param address    the device's address of its first register
 * @param order      one of MBM_ORDER_...; MBM_ORDER_DEFAULT for the order of `registers`
 * @param value      the number
 * @return a status; see mbm_registers
 */
uint8_t mbm_registers_setUint16(const mbm_registers *registers, uint16_t address, uint8_t order,
                                uint16_t value);

/**
 * Writes a number into two registers.
 *
 * @return as mbm_registers_setUint16
 */
uint8_t mbm_registers_setUint32(const mbm_registers *registers, uint16_t address, uint8_t order,
                                uint32_t value);

/**
 * Writes a number into four registers.
 *
 * @param value  points to the number
 * @return as mbm_registers_setUint16
 */
uint8_t mbm_registers_setUint64(const mbm_registers *registers, uint16_t address, uint8_t order,
                                const uint64_t *value);

/**
 * Writes a float into two registers, as an IEEE 754 binary32. Its bits are copied.
 *
 * @param value  points to the number
 * @return as mbm_registers_setUint16
 */
uint8_t mbm_registers_setFloat(const mbm_registers *registers, uint16_t address, uint8_t order,
                               const float *value);

/**
 * Writes a double into four registers, as an IEEE 754 binary64. On AVR, where a double
 * of C has 32 bits (-mdouble=32), it is converted without loss.
 *
 * @param value  points to the number
 * @return as mbm_registers_setUint16
 */
uint8_t mbm_registers_setDouble(const mbm_registers *registers, uint16_t address, uint8_t order,
                                const double *value);

/**
 * Writes a text into a field and fills the rest of the field with NULs, in the layout
 * that mbm_registers_getString reads.
 *
 * @param registers  the registers, of a kind that may be written
 * @param address    the device's address of the first register of the field
 * @param length     length of the field in bytes, two for each register; if it is odd, the byte
 *                   after the field becomes 0 too
 * @param order      one of MBM_ORDER_...; MBM_ORDER_DEFAULT for the order of `registers`
 * @param text       the text; ends with a NUL, which need not fit into the field
 * @return a status; see mbm_registers. MBM_BUFFER_TOO_SMALL if the text is longer than the
 *         field
 */
uint8_t mbm_registers_setString(const mbm_registers *registers, uint16_t address, uint16_t length,
                                uint8_t order, const char *text);

/**
 * Writes raw bytes. With MBM_ORDER_ABCD and MBM_ORDER_CDAB the high byte of each
 * register is first, as on the wire; with MBM_ORDER_BADC and MBM_ORDER_DCBA the low
 * byte, for a device that swaps the bytes of its registers.
 *
 * @param registers  the registers, of a kind that may be written
 * @param address    the device's address of the first register
 * @param order      one of MBM_ORDER_...; MBM_ORDER_DEFAULT for the order of `registers`
 * @param bytes      the bytes; must not overlap the registers
 * @param length     how many bytes, two for each register; if it is odd, the other byte of the
 *                   last register does not change
 * @return a status; see mbm_registers
 */
uint8_t mbm_registers_setBytes(const mbm_registers *registers, uint16_t address, uint8_t order,
                               const uint8_t *bytes, uint16_t length);

/**
 * Reads a text in another form than mbm_registers_getString. It ends at its first NUL or at the
 * end of its field; with MBM_TEXT_SPACES the spaces at its end are left out.
 *
 * @param address   the device's address of the first register of the field
 * @param length    length of the field in characters
 * @param order     one of MBM_ORDER_...; MBM_ORDER_DEFAULT for the order of `registers`. With
 *                  MBM_TEXT_LOW_BYTES and MBM_TEXT_HIGH_BYTES it has no effect
 * @param form      0 for two characters a register, or MBM_TEXT_..., added up
 * @param text      receives the text and a NUL
 * @param capacity  size of `text` in bytes; `length + 1` are always enough
 * @return a status; see mbm_registers. MBM_BUFFER_TOO_SMALL if `text` is
 */
uint8_t mbm_registers_getText(const mbm_registers *registers, uint16_t address, uint16_t length,
                              uint8_t order, uint8_t form, char *text, uint16_t capacity);

/**
 * Writes a text into a field, as mbm_registers_getText reads it. Every byte of the field's
 * registers is set.
 *
 * @param text      the text; ends with a NUL, which need not fit into the field
 * @return as mbm_registers_getText; MBM_BUFFER_TOO_SMALL if the text is longer than the field;
 *         MBM_INVALID_ARGUMENT if it ends with a space, which MBM_TEXT_SPACES would lose
 */
uint8_t mbm_registers_setText(const mbm_registers *registers, uint16_t address, uint16_t length,
                              uint8_t order, uint8_t form, const char *text);

/**
 * Reads a number in BCD: four digits in one register, eight in two.
 *
 * @param address  the device's address of its first register
 * @param count    how many registers, 1 or 2
 * @param order    one of MBM_ORDER_...; MBM_ORDER_DEFAULT for the order of `registers`
 * @param value    receives the number
 * @return a status; see mbm_registers. MBM_MALFORMED_VALUE for a digit above 9
 */
uint8_t mbm_registers_getBcd(const mbm_registers *registers, uint16_t address, uint16_t count,
                             uint8_t order, uint32_t *value);

/**
 * Writes a number in BCD, as mbm_registers_getBcd reads it.
 *
 * @return as mbm_registers_setUint16; MBM_OUT_OF_RANGE for a number with more digits
 */
uint8_t mbm_registers_setBcd(const mbm_registers *registers, uint16_t address, uint16_t count,
                             uint8_t order, uint32_t value);

/**
 * Reads a number of which each register holds four decimal digits, 0 to 9999: M10K or
 * Mod10 of Schneider's meters. Many have the lowest register first: MBM_ORDER_CDAB.
 *
 * @param count    how many registers, 1 to 4
 * @param value    receives the number
 * @return as mbm_registers_getBcd; MBM_MALFORMED_VALUE for a register above 9999
 */
uint8_t mbm_registers_getM10k(const mbm_registers *registers, uint16_t address, uint16_t count,
                              uint8_t order, uint64_t *value);

/**
 * Writes such a number, as mbm_registers_getM10k reads it.
 *
 * @param value    points to the number
 * @return as mbm_registers_setUint16; MBM_OUT_OF_RANGE for a number with more digits
 */
uint8_t mbm_registers_setM10k(const mbm_registers *registers, uint16_t address, uint16_t count,
                              uint8_t order, const uint64_t *value);

/** As mbm_registers_getM10k, with a sign in each register: -9999 to 9999. */
uint8_t mbm_registers_getSignedM10k(const mbm_registers *registers, uint16_t address,
                                    uint16_t count, uint8_t order, int64_t *value);

/** As mbm_registers_setM10k. Each register that is not 0 gets the sign. */
uint8_t mbm_registers_setSignedM10k(const mbm_registers *registers, uint16_t address,
                                    uint16_t count, uint8_t order, const int64_t *value);

/**
 * Reads a number of 24 bits, in the low bits of two registers. The eight bits above it do
 * not count; mbm_registers_getBits reads them.
 *
 * @return as mbm_registers_getUint16
 */
uint8_t mbm_registers_getUint24(const mbm_registers *registers, uint16_t address, uint8_t order,
                                uint32_t *value);

/**
 * Writes a number of 24 bits. The eight bits above it become 0.
 *
 * @return as mbm_registers_setUint16; MBM_OUT_OF_RANGE for a number with more bits
 */
uint8_t mbm_registers_setUint24(const mbm_registers *registers, uint16_t address, uint8_t order,
                                uint32_t value);

/** As mbm_registers_getUint24, with a sign, in two's complement. */
uint8_t mbm_registers_getInt24(const mbm_registers *registers, uint16_t address, uint8_t order,
                               int32_t *value);

/** As mbm_registers_setUint24, with a sign. The eight bits above it become copies of it. */
uint8_t mbm_registers_setInt24(const mbm_registers *registers, uint16_t address, uint8_t order,
                               int32_t value);

/**
 * Reads a number of 48 bits in three registers.
 *
 * @return as mbm_registers_getUint16; MBM_INVALID_ARGUMENT for an order by halves
 */
uint8_t mbm_registers_getUint48(const mbm_registers *registers, uint16_t address, uint8_t order,
                                uint64_t *value);

/**
 * Writes a number of 48 bits.
 *
 * @param value    points to the number
 * @return as mbm_registers_setUint24; MBM_INVALID_ARGUMENT for an order by halves
 */
uint8_t mbm_registers_setUint48(const mbm_registers *registers, uint16_t address, uint8_t order,
                                const uint64_t *value);

/** As mbm_registers_getUint48, with a sign, in two's complement. */
uint8_t mbm_registers_getInt48(const mbm_registers *registers, uint16_t address, uint8_t order,
                               int64_t *value);

/** As mbm_registers_setUint48, with a sign. */
uint8_t mbm_registers_setInt48(const mbm_registers *registers, uint16_t address, uint8_t order,
                               const int64_t *value);

/**
 * Reads a number whose highest bit is its sign, and whose other bits are its amount.
 *
 * @param count    how many registers, 1 or 2
 * @param value    receives the number; 0 for both zeros
 * @return as mbm_registers_getUint16
 */
uint8_t mbm_registers_getSignMagnitude(const mbm_registers *registers, uint16_t address,
                                       uint16_t count, uint8_t order, int32_t *value);

/**
 * Writes such a number, as mbm_registers_getSignMagnitude reads it: up to 32767 in one register
 * and 2147483647 in two.
 *
 * @return as mbm_registers_setUint24
 */
uint8_t mbm_registers_setSignMagnitude(const mbm_registers *registers, uint16_t address,
                                       uint16_t count, uint8_t order, int32_t value);

/**
 * Reads a half float of one register, an IEEE 754 binary16. A float holds each exactly.
 *
 * @return as mbm_registers_getUint16
 */
uint8_t mbm_registers_getHalf(const mbm_registers *registers, uint16_t address, uint8_t order,
                              float *value);

/**
 * Writes a half float: the one that is nearest to a float.
 *
 * @param value    points to the number
 * @return as mbm_registers_setUint16; MBM_OUT_OF_RANGE from 65520 on, and for a number other
 *         than 0 that is nearer to 0 than to a half float
 */
uint8_t mbm_registers_setHalf(const mbm_registers *registers, uint16_t address, uint8_t order,
                              const float *value);

/**
 * Reads bits of a field of 1 to 4 registers as one number.
 *
 * @param count    how many registers the field has, 1 to 4
 * @param first    the lowest of the bits; 0 is the least significant of the field
 * @param bits     how many bits, 1 to 64, not beyond those of the field
 * @param value    receives the number
 * @return as mbm_registers_getUint16; MBM_INVALID_ARGUMENT for an order by halves of three
 *         registers
 */
uint8_t mbm_registers_getBits(const mbm_registers *registers, uint16_t address, uint16_t count,
                              uint8_t order, uint8_t first, uint8_t bits, uint64_t *value);

/**
 * Writes bits of a field of 1 to 4 registers; its other bits do not change.
 *
 * @param value    points to the number
 * @return as mbm_registers_getBits; MBM_OUT_OF_RANGE for a number with more bits
 */
uint8_t mbm_registers_setBits(const mbm_registers *registers, uint16_t address, uint16_t count,
                              uint8_t order, uint8_t first, uint8_t bits, const uint64_t *value);

/* ==== Values in words: each in one call =============================================== */

/**
 * A number of two words, 0 to 4294967295.
 *
 * The functions of this section are inline, and return the number itself. They know no end of the
 * words: an array of yours must have as many as the number. Where the words come with a count, take
 * mbm_registers_ofWords.
 *
 * @param words  the first of them: `&response[6]` for the seventh response word of mbm_node
 * @param order  one of MBM_ORDER_...; MBM_ORDER_DEFAULT for MBM_ORDER_ABCD
 * @return the number; 0 if `words` is NULL or there is no such order
 */
static inline uint32_t mbm_words_getUint32(const uint16_t *words, uint8_t order)
{
    const mbm_registers view = {words, 0, 2, MBM_REGISTERS_OF_WORDS, MBM_ORDER_ABCD};
    uint32_t number = 0;

    (void)mbm_registers_getUint32(&view, 0, order, &number);
    return number;
}

/**
 * As mbm_words_getUint32, with a sign, in two's complement.
 *
 * @return the number; 0 if `words` is NULL or there is no such order
 */
static inline int32_t mbm_words_getInt32(const uint16_t *words, uint8_t order)
{
    const mbm_registers view = {words, 0, 2, MBM_REGISTERS_OF_WORDS, MBM_ORDER_ABCD};
    int32_t number = 0;

    (void)mbm_registers_getUint32(&view, 0, order, (uint32_t *)&number);
    return number;
}

/**
 * As mbm_words_getUint32, for a float of two words, an IEEE 754 binary32. Its bits are copied.
 *
 * @return the number; a NaN if `words` is NULL or there is no such order
 */
static inline float mbm_words_getFloat(const uint16_t *words, uint8_t order)
{
    const mbm_registers view = {words, 0, 2, MBM_REGISTERS_OF_WORDS, MBM_ORDER_ABCD};
    union {
        uint32_t bits;
        float number;
    } value = {0x7FC00000u};

    (void)mbm_registers_getUint32(&view, 0, order, &value.bits);
    return value.number;
}

/**
 * As mbm_words_getUint32, for a number of one word. Without swapped bytes it is the word itself.
 *
 * @return the number; 0 if `words` is NULL or there is no such order
 */
static inline uint16_t mbm_words_getUint16(const uint16_t *words, uint8_t order)
{
    const mbm_registers view = {words, 0, 1, MBM_REGISTERS_OF_WORDS, MBM_ORDER_ABCD};
    uint16_t number = 0;

    (void)mbm_registers_getUint16(&view, 0, order, &number);
    return number;
}

/**
 * As mbm_words_getUint16, with a sign, in two's complement.
 *
 * @return the number; 0 if `words` is NULL or there is no such order
 */
static inline int16_t mbm_words_getInt16(const uint16_t *words, uint8_t order)
{
    const mbm_registers view = {words, 0, 1, MBM_REGISTERS_OF_WORDS, MBM_ORDER_ABCD};
    int16_t number = 0;

    (void)mbm_registers_getUint16(&view, 0, order, (uint16_t *)&number);
    return number;
}

/**
 * As mbm_words_getUint32, for a number of four words.
 *
 * @return the number; 0 if `words` is NULL or there is no such order
 */
static inline uint64_t mbm_words_getUint64(const uint16_t *words, uint8_t order)
{
    const mbm_registers view = {words, 0, 4, MBM_REGISTERS_OF_WORDS, MBM_ORDER_ABCD};
    uint64_t number = 0;

    (void)mbm_registers_getUint64(&view, 0, order, &number);
    return number;
}

/**
 * As mbm_words_getUint64, with a sign, in two's complement.
 *
 * @return the number; 0 if `words` is NULL or there is no such order
 */
static inline int64_t mbm_words_getInt64(const uint16_t *words, uint8_t order)
{
    const mbm_registers view = {words, 0, 4, MBM_REGISTERS_OF_WORDS, MBM_ORDER_ABCD};
    int64_t number = 0;

    (void)mbm_registers_getUint64(&view, 0, order, (uint64_t *)&number);
    return number;
}

/**
 * As mbm_words_getUint64, for a double of four words, an IEEE 754 binary64; see
 * mbm_registers_getDouble.
 *
 * @return the number; a NaN if `words` is NULL or there is no such order
 */
static inline double mbm_words_getDouble(const uint16_t *words, uint8_t order)
{
    const mbm_registers view = {words, 0, 4, MBM_REGISTERS_OF_WORDS, MBM_ORDER_ABCD};
    const union {
        uint32_t bits;
        float number;
    } none = {0x7FC00000u};
    double number = (double)none.number;

    (void)mbm_registers_getDouble(&view, 0, order, &number);
    return number;
}

/**
 * Writes a number into two words of yours, for example the transmit words of mbm_node.
 *
 * @param words   the first of them
 * @param order   one of MBM_ORDER_...; MBM_ORDER_DEFAULT for MBM_ORDER_ABCD
 * @param number  the number
 * @return a status; MBM_NOT_INITIALISED if `words` is NULL
 */
static inline uint8_t mbm_words_setUint32(uint16_t *words, uint8_t order, uint32_t number)
{
    const mbm_registers view = {words, 0, 2, MBM_REGISTERS_INTO_WORDS, MBM_ORDER_ABCD};

    return mbm_registers_setUint32(&view, 0, order, number);
}

/** As mbm_words_setUint32, with a sign, in two's complement. */
static inline uint8_t mbm_words_setInt32(uint16_t *words, uint8_t order, int32_t number)
{
    return mbm_words_setUint32(words, order, (uint32_t)number);
}

/** As mbm_words_setUint32, for a number of one word. */
static inline uint8_t mbm_words_setUint16(uint16_t *words, uint8_t order, uint16_t number)
{
    const mbm_registers view = {words, 0, 1, MBM_REGISTERS_INTO_WORDS, MBM_ORDER_ABCD};

    return mbm_registers_setUint16(&view, 0, order, number);
}

/** As mbm_words_setUint32, for a number of one word with a sign. */
static inline uint8_t mbm_words_setInt16(uint16_t *words, uint8_t order, int16_t number)
{
    return mbm_words_setUint16(words, order, (uint16_t)number);
}

/** As mbm_words_setUint32, for a float, an IEEE 754 binary32. Its bits are copied. */
static inline uint8_t mbm_words_setFloat(uint16_t *words, uint8_t order, float number)
{
    const mbm_registers view = {words, 0, 2, MBM_REGISTERS_INTO_WORDS, MBM_ORDER_ABCD};

    return mbm_registers_setFloat(&view, 0, order, &number);
}

/** As mbm_words_setUint32, for a number of four words. */
static inline uint8_t mbm_words_setUint64(uint16_t *words, uint8_t order, uint64_t number)
{
    const mbm_registers view = {words, 0, 4, MBM_REGISTERS_INTO_WORDS, MBM_ORDER_ABCD};

    return mbm_registers_setUint64(&view, 0, order, &number);
}

/** As mbm_words_setUint32, for a double of four words, an IEEE 754 binary64. */
static inline uint8_t mbm_words_setDouble(uint16_t *words, uint8_t order, double number)
{
    const mbm_registers view = {words, 0, 4, MBM_REGISTERS_INTO_WORDS, MBM_ORDER_ABCD};

    return mbm_registers_setDouble(&view, 0, order, &number);
}

/** As mbm_words_setUint64, with a sign, in two's complement. */
static inline uint8_t mbm_words_setInt64(uint16_t *words, uint8_t order, int64_t number)
{
    return mbm_words_setUint64(words, order, (uint64_t)number);
}

/**
 * Reads a text up to its first NUL or the end of its field, as mbm_registers_getString.
 *
 * @param words     the first of its words, of which there must be enough
 * @param order     one of MBM_ORDER_...; MBM_ORDER_DEFAULT for MBM_ORDER_ABCD
 * @param length    length of the field in bytes, two for each word
 * @param text      receives the text and a NUL
 * @param capacity  size of `text` in bytes; `length + 1` are always enough
 * @return a status; MBM_BUFFER_TOO_SMALL if `text` is; MBM_NOT_INITIALISED if `words` is NULL
 */
static inline uint8_t mbm_words_getString(const uint16_t *words, uint8_t order, uint16_t length,
                                          char *text, uint16_t capacity)
{
    /* As many words as `length` may name. */
    const mbm_registers view = {words, 0, 32768u, MBM_REGISTERS_OF_WORDS, MBM_ORDER_ABCD};

    return mbm_registers_getString(&view, 0, length, order, text, capacity);
}

/**
 * Writes a text into a field, followed by NULs, as mbm_registers_setString.
 *
 * @param words   the first of its words, of which there must be enough
 * @param order   one of MBM_ORDER_...; MBM_ORDER_DEFAULT for MBM_ORDER_ABCD
 * @param length  length of the field in bytes, two for each word
 * @param text    the text; a NUL ends it, for which the field needs no space
 * @return a status; MBM_BUFFER_TOO_SMALL if the field is; MBM_NOT_INITIALISED if `words` is NULL
 */
static inline uint8_t mbm_words_setString(uint16_t *words, uint8_t order, uint16_t length,
                                          const char *text)
{
    /* As many words as `length` may name. */
    const mbm_registers view = {words, 0, 32768u, MBM_REGISTERS_INTO_WORDS, MBM_ORDER_ABCD};

    return mbm_registers_setString(&view, 0, length, order, text);
}

#ifdef __cplusplus
}  // extern "C"
#endif

#endif  /* MBM_VALUES_H */
