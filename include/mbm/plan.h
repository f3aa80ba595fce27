/**
 * @file mbm/plan.h
 * @brief A plan: the values that a client reads again and again.
 *
 * Licence: MIT OR Apache-2.0. Generated from the source of mbm; do not edit. A part of
 * mbm.h, at whose head are the rules of every function.
 */

#ifndef MBM_PLAN_H
#define MBM_PLAN_H

#include "client.h"
#include "values.h"

#if defined(__AVR__) && __SIZEOF_DOUBLE__ != 4
/* The archive has a double of 32 bits: what calls these must not link. */
#define mbm_plan_getNumber mbm_plan_getNumber_wants_mdouble_32
#define mbm_plan_getConverted mbm_plan_getConverted_wants_mdouble_32
#define mbm_registers_getConverted mbm_registers_getConverted_wants_mdouble_32
#endif

#ifdef __cplusplus
extern "C" {
#endif

/* ==== Plan: a table of values that a client reads again and again =================== */

/** A table of the data model (V1.1b3, 4.3): coils. The number of each table is that of the
 *  function that reads it. */
#define MBM_TABLE_COILS 1u
/** The discrete inputs. */
#define MBM_TABLE_DISCRETE_INPUTS 2u
/** The holding registers. */
#define MBM_TABLE_HOLDING_REGISTERS 3u
/** The input registers. */
#define MBM_TABLE_INPUT_REGISTERS 4u
/** The type of a value: a coil or a discrete input, 0 or 1. */
#define MBM_TYPE_BIT 1u
/** One register, 0 to 65535. */
#define MBM_TYPE_UINT16 2u
/** One register, -32768 to 32767. */
#define MBM_TYPE_INT16 3u
/** Two registers. */
#define MBM_TYPE_UINT32 4u
/** Two registers, two's complement. */
#define MBM_TYPE_INT32 5u
/** Four registers. */
#define MBM_TYPE_UINT64 6u
/** Four registers, two's complement. */
#define MBM_TYPE_INT64 7u
/** Two registers, an IEEE 754 binary32. */
#define MBM_TYPE_FLOAT 8u
/** Four registers, an IEEE 754 binary64. */
#define MBM_TYPE_DOUBLE 9u
/** A text, two characters a register, which ends at its first NUL or with its field. */
#define MBM_TYPE_TEXT 10u
/** `count` registers as they are, for a type that the plan does not know. mbm_plan_getRegisters
 *  returns them, and a function mbm_registers_get... their value. */
#define MBM_TYPE_REGISTERS 11u
/** The longest interval of a field in milliseconds: a day. */
#define MBM_PLAN_LONGEST_INTERVAL 86400000
/** The most fields of one plan. */
#define MBM_PLAN_MAX_FIELDS 16383
/** mbm_planConversion.flags: the number that SunSpec reserves in the type of the field means "not
 *  available": 0x8000 of MBM_TYPE_INT16, 0xFFFF of MBM_TYPE_UINT16, the numbers like them of 32 and
 *  64 bits; of a text that all its registers are 0. */
#define MBM_CONVERSION_STANDARD 1u
/** mbm_planConversion.flags: `powerField` has the power of ten. */
#define MBM_CONVERSION_POWER 2u

/**
 * A plan: a table of fields that a client reads from units again and again.
 *
 * You own the storage. Initialise it with MBM_INIT. Call mbm_plan_begin first. Use it from
 * the thread that uses its client, and never from an interrupt. It stays where it is until
 * mbm_plan_end.
 */
typedef struct mbm_plan {
    void *pointers[3]; /**< Private. */
    uint32_t words[4]; /**< Private. */
} mbm_plan;

/**
 * A field of a plan: a value, or several of one type in a row, that a program wants from a
 * unit again and again. A table of them may be constant.
 */
typedef struct mbm_planField {
    /** The unit, 1 to 255; in TCP frames also 0. mbm_plan_begin refuses any other number. */
    uint16_t unit;
    /** One of MBM_TABLE_... */
    uint8_t table;
    /** One of MBM_TYPE_...: MBM_TYPE_BIT for coils and discrete inputs, each for registers.
     *  MBM_TYPE_BIT of a register is `count` of its bits from `bit` on, as one number. */
    uint8_t type;
    /** One of MBM_ORDER_...; MBM_ORDER_DEFAULT is MBM_ORDER_ABCD. */
    uint8_t order;
    /** For MBM_TYPE_BIT in a table of registers: the lowest bit, 0 (the least significant) to 15.
     *  Otherwise 0. */
    uint8_t bit;
    /** The first bit or register, 0 to 65535, as on the wire. */
    uint16_t address;
    /** The number of values, of the characters of a text, of the bits of a register, or of the
     *  registers of MBM_TYPE_REGISTERS. 0 means 1. */
    uint16_t count;
    /** The time from one read to the next in milliseconds, 1 to MBM_PLAN_LONGEST_INTERVAL. */
    uint32_t intervalMs;
    /** mbm_plan_getNumber, mbm_plan_getInteger and mbm_plan_getInt32 multiply by this; 0 means 1.
     *  It is 0 for a text and for MBM_TYPE_REGISTERS. */
    int32_t multiplier;
    /** They divide by this after that; 0 means 1. It must not be negative, and must be 0 for a
     *  text and for MBM_TYPE_REGISTERS. */
    int32_t divisor;
} mbm_planField;

/** Storage of a plan, one for each field. */
typedef struct mbm_planPosition {
    uint32_t words[2]; /**< Private. */
} mbm_planPosition;

/** Storage of a plan, one for each read. */
typedef struct mbm_planRead {
    uint32_t words[8]; /**< Private. */
} mbm_planRead;

/** How much one read of a unit may request, if not as much as the plan's other reads. */
typedef struct mbm_planUnitLimits {
    /** Bits, 1 to 2000; 0 means as `bitsPerRead` of the plan. */
    uint16_t bitsPerRead;
    /** Registers, 1 to 125; 0 means as `registersPerRead` of the plan. */
    uint16_t registersPerRead;
    /** The unit, 0 to 255. mbm_plan_begin refuses a greater number. */
    uint16_t unit;
} mbm_planUnitLimits;

/** Addresses that no read of a plan may touch. */
typedef struct mbm_planExcludedRange {
    /** The first address. */
    uint16_t first;
    /** The last address, not less than `first`. */
    uint16_t last;
    /** The unit, 1 to 255; 0 for every unit. mbm_plan_begin refuses a greater number. */
    uint16_t unit;
    /** One of MBM_TABLE_... */
    uint8_t table;
} mbm_planExcludedRange;

/**
 * The parts of a plan. The struct may be constant. It must stay valid and unchanged, with
 * everything that it points to, for as long as the plan is used.
 */
typedef struct mbm_planSetup {
    /** The fields, in any order. */
    const mbm_planField *fields;
    /** Storage: as many as fields. */
    mbm_planPosition *positions;
    /** Storage: as many as reads; there are never more reads than fields. */
    mbm_planRead *reads;
    /** Storage: the registers of all reads and the bits of all reads, 16 to a word. */
    uint16_t *data;
    /** Storage: the requests with which the plan reads, initialised with MBM_INIT; they are the
     *  plan's alone. With one it sends one read after the other; more are for Modbus TCP, where
     *  several may be in flight at once. */
    mbm_clientRequest *requests;
    /** Units with limits of their own; NULL for none. */
    const mbm_planUnitLimits *units;
    /** Addresses that no read may touch; NULL for none. */
    const mbm_planExcludedRange *excluded;
    /** Optional: called by mbm_plan_poll for each field of a read that has ended, and for each
     *  field of a unit that the plan takes for silent. It may call every function on the plan
     *  and on the client. */
    void (*update)(void *context, mbm_plan *plan, uint16_t field);
    /** Handed to `update`. Yours, may be NULL. */
    void *context;
    /** How long the plan leaves a unit alone after a first request without an answer, in
     *  milliseconds; each further one doubles it. 0 means 1000. */
    uint32_t backoffMs;
    /** The longest such time in milliseconds; 0 means 60000. */
    uint32_t longestBackoffMs;
    /** How many fields, 1 to MBM_PLAN_MAX_FIELDS. */
    uint16_t fieldCount;
    /** How many reads there is storage for. */
    uint16_t readCount;
    /** How many words there are in `data`. */
    uint16_t dataWords;
    /** The most bits that one read requests, 1 to 2000; 0 means 2000. */
    uint16_t bitsPerRead;
    /** The most bits between two fields that one read may cover as well. */
    uint16_t bitGap;
    /** The most registers that one read requests, 1 to 125; 0 means 125. */
    uint16_t registersPerRead;
    /** The most registers between two fields that one read may cover as well. */
    uint16_t registerGap;
    /** How many requests, 1 to 16. */
    uint8_t requestCount;
    /** How many units with limits of their own. */
    uint8_t unitCount;
    /** How many excluded ranges. */
    uint8_t excludedCount;
} mbm_planSetup;

/**
 * What the numbers of a field mean, beyond what mbm_planField says of it: the value is number *
 * multiplier / divisor * 10^power + offset, or it is not available. A float that is not a number
 * is not available even without a conversion. A struct of zeros changes nothing else.
 *
 * It may be constant. A program that calls no function with a conversion does not contain them.
 */
typedef struct mbm_planConversion {
    /** The numbers that mean "not available", as the bits that the registers have in
     *  MBM_ORDER_ABCD: each has as many words as a value of the field has registers, the most
     *  significant first. Of bits of a register each is the number that these bits are. NULL if
     *  `notAvailableCount` is 0. A text has none. */
    const uint16_t *notAvailable;
    /** Is added, times 10^-`offsetDecimals`: -27315 with 2 decimals is -273.15. */
    int32_t offset;
    /** With MBM_CONVERSION_POWER: the index of the field that has the power of ten. That field has
     *  an integer, the same unit, and no scale. If its number is not -10 to 10, the value is not
     *  available. */
    uint16_t powerField;
    /** How many words there are in `notAvailable`: for a type of two registers twice as many as
     *  numbers. */
    uint16_t notAvailableCount;
    /** 0 to 9. */
    uint8_t offsetDecimals;
    /** MBM_CONVERSION_..., added. */
    uint8_t flags;
} mbm_planConversion;

/**
 * Storage of mbm_plan_pollSplitting. Initialise it with MBM_INIT, and set `blocks`. It is one
 * plan's alone.
 */
typedef struct mbm_planSplitting {
    /** Storage: as many as fields. */
    uint16_t *blocks;
    /** After this time a field that the device does not have is tried again, and neighbours that
     *  could not be joined are tried as one, in milliseconds; 0 means 600000, ten minutes. */
    uint32_t retryMs;
    uint32_t triedAt; /**< Private. */
    /** How many reads there is storage for in `reads` of the setup; 0 means `readCount` of the
     *  setup. As many as fields always suffice. */
    uint16_t readCount;
    uint8_t begins; /**< Private. */
    uint8_t state; /**< Private. */
} mbm_planSplitting;

/** A read of a plan: one request that it repeats. */
typedef struct mbm_planReadInfo {
    /** The time from one read to the next, in milliseconds. */
    uint32_t intervalMs;
    /** The first bit or register, as on the wire. */
    uint16_t address;
    /** How many bits or registers. */
    uint16_t quantity;
    /** The unit. */
    uint8_t unit;
    /** One of MBM_TABLE_... */
    uint8_t table;
    /** How it ended last; MBM_PENDING before it has ended once. */
    uint8_t status;
} mbm_planReadInfo;

/**
 * Groups the fields of a table into reads. mbm_plan_poll sends them from then on.
 *
 * Fields with the same unit, table and interval are read together, and may overlap: what
 * several of them share is read once. The plan covers them within the limits by the fewest
 * reads, and among such plans by the fewest bits or registers. All reads are due at once; the
 * rounds after the first are spread, so that reads of one interval follow each other at equal
 * distances.
 *
 * You may call it again at any time, also from `update`, but not from a hook of the client's
 * port. The plan then first ends, as by mbm_plan_end, unless the call is refused for NULL, a
 * count out of range, a unit above 255 of limits or of an excluded range, or a client that was
 * never begun.
 *
 * @param client  the client that sends the reads, begun; the program may use it too, and other
 *                plans
 * @param setup   table, limits and storage; it stays valid and as it is until the plan ends
 * @param field   gets the index of the field that is wrong, 0xFFFF if it is none; may be NULL
 * @return MBM_OK. The status of a field: MBM_INVALID_ARGUMENT for an unknown table, type or order,
 *         a type that the table does not have, bits beyond those of a register, a unit above 255,
 *         an interval out of range, a negative divisor or a scale of a text;
 *         MBM_BROADCAST_NOT_ALLOWED for unit 0, unless the client has TCP frames;
 *         MBM_ILLEGAL_DATA_ADDRESS if it goes beyond address
 *         65535 or into an excluded range; MBM_ILLEGAL_DATA_VALUE if it is longer than a read may
 *         be; MBM_BUFFER_TOO_SMALL for the first without storage for its read or its data. After
 *         such a status the plan has ended, and `positions` and `reads` may be changed.
 *         MBM_INVALID_ARGUMENT also for a unit above 255 of limits or of an excluded range
 */
uint8_t mbm_plan_begin(mbm_plan *plan, mbm_client *client, const mbm_planSetup *setup,
                       uint16_t *field);

/**
 * As mbm_plan_begin, for fields that were grouped before: `mbm header` writes such a table. A
 * program that calls only this function does not contain the code that groups fields, a quarter of
 * a plan.
 *
 * The fields of a read stand side by side in `setup->fields`, the one with the lowest address
 * first, and have the same unit, table and interval. `setup->readCount` is the number of reads.
 * The limits, gaps and excluded ranges of `setup` have no meaning.
 *
 * @param client  as for mbm_plan_begin
 * @param setup   table and storage; it stays valid and as it is until the plan ends
 * @param counts  how many fields each read has: `setup->readCount` numbers, each at least 1,
 *                `setup->fieldCount` in total; used during the call
 * @param field   gets the index of the field that is wrong, 0xFFFF if it is none; may be NULL
 * @return as mbm_plan_begin; MBM_INVALID_ARGUMENT also for a field that does not fit into its
 *         read: it differs from the first one in unit, table or interval, has a lower address, or
 *         makes the read longer than 125 registers or 2000 bits; for counts of 0 or with another
 *         total; and for more fields than MBM_PLAN_MAX_FIELDS
 */
uint8_t mbm_plan_beginGrouped(mbm_plan *plan, mbm_client *client, const mbm_planSetup *setup,
                              const uint16_t *counts, uint16_t *field);

/** Ends a plan: gives its requests up and lets go of its storage. */
uint8_t mbm_plan_end(mbm_plan *plan);

/**
 * A value as a double, converted: with the multiplier and the divisor of its field, the power
 * of ten and the offset, rounded once, to the nearest. On AVR, where C's double has 32 bits,
 * it is rounded to these after that.
 *
 * The power and the number are of one reply if one read of the plan has both, as it has if
 * they stand side by side with one interval.
 *
 * @param field       the index of the field, of a bit, an integer or a float
 * @param index       which of its values, 0 for the first
 * @param conversion  that of the field; NULL for none
 * @param value       gets the number; a float that is infinite stays so
 * @return a status; MBM_NOT_AVAILABLE if the device says that it has no value, if its power of
 *         ten was never read, if that is not -10 to 10, or if the last read of the power
 *         failed although that of the number did not; MBM_INVALID_ARGUMENT for a text or
 *         MBM_TYPE_REGISTERS, and for a conversion that is not as it must be; if no value has
 *         arrived yet the status that mbm_plan_getStatus returns
 */
uint8_t mbm_plan_getConverted(const mbm_plan *plan, uint16_t field, uint16_t index,
                              const mbm_planConversion *conversion, double *value);

/**
 * As mbm_plan_getConverted, as an integer: the value times 10^`decimals`, rounded to the
 * nearest, halves away from 0. It needs no arithmetic on floats: less code on a
 * microcontroller.
 *
 * @param field     the index of the field, of a bit or of an integer of 16 or 32 bits
 * @param decimals  0 to 9: 21.5 is 215 with 1 decimal
 * @return as mbm_plan_getConverted; MBM_OUT_OF_RANGE if the result, or a number on the way to
 *         it, is too large: number * multiplier * 10^(power + decimals) must be below 2^64
 */
uint8_t mbm_plan_getDecimal(const mbm_plan *plan, uint16_t field, uint16_t index,
                            const mbm_planConversion *conversion, uint8_t decimals, int32_t *value);

/**
 * Whether the last value that was read is available: for a value that the program takes in
 * another way, such as with mbm_plan_getInt32 or mbm_plan_getText.
 *
 * @param field  the index of the field, of any type
 * @return MBM_OK or MBM_NOT_AVAILABLE, or another status as mbm_plan_getConverted
 */
uint8_t mbm_plan_checkAvailable(const mbm_plan *plan, uint16_t field, uint16_t index,
                                const mbm_planConversion *conversion);

/**
 * As mbm_plan_getConverted, for registers that a program has read without a plan. On a
 * Cortex-M it takes 420 bytes of stack.
 *
 * @param registers   the registers of the field, and of its power of ten
 * @param fields      a table of fields, each as for mbm_plan_begin; they say where in the
 *                    registers the numbers are; their unit does not count
 * @param field       the index of the field in the table
 * @param index       which of its values, 0 for the first
 * @param conversion  that of the field; NULL for none
 * @param value       gets the number
 * @return as mbm_plan_getConverted; MBM_ILLEGAL_DATA_ADDRESS if `registers` lack one that is
 *         needed; otherwise a status as mbm_plan_begin for the field; see mbm_registers
 */
uint8_t mbm_registers_getConverted(const mbm_registers *registers, const mbm_planField *fields,
                                   uint16_t field, uint16_t index,
                                   const mbm_planConversion *conversion, double *value);

/**
 * As mbm_plan_getDecimal, for registers that a program has read without a plan.
 *
 * @param decimals  0 to 9
 * @return as mbm_registers_getConverted and mbm_plan_getDecimal
 */
uint8_t mbm_registers_getDecimal(const mbm_registers *registers, const mbm_planField *fields,
                                 uint16_t field, uint16_t index,
                                 const mbm_planConversion *conversion, uint8_t decimals,
                                 int32_t *value);

/**
 * As mbm_plan_checkAvailable, for registers that a program has read without a plan.
 *
 * @return MBM_OK or MBM_NOT_AVAILABLE, or another status as mbm_registers_getConverted
 */
uint8_t mbm_registers_checkAvailable(const mbm_registers *registers, const mbm_planField *fields,
                                     uint16_t field, uint16_t index,
                                     const mbm_planConversion *conversion);

/**
 * Takes the replies that have arrived, calls `update` for the fields of each read that has
 * ended, and queues the reads that are due, as far as there are requests for them. It does not
 * poll the client: call mbm_client_poll after it.
 */
uint8_t mbm_plan_poll(mbm_plan *plan);

/**
 * How long mbm_plan_poll has nothing to do, so that a program may sleep until then or until
 * mbm_client_pollDelay is over, whichever comes first.
 *
 * @return microseconds; 0 means poll now, and is returned within a hook of the client's port;
 *         0xFFFFFFFF if there is nothing to do before a request of the client has ended, and for
 *         an object that was never begun
 */
uint32_t mbm_plan_pollDelay(mbm_plan *plan);

/**
 * As mbm_plan_poll, for devices that lack some fields of the table, or that refuse long reads:
 * call it instead. Zeroed storage is a plan that has found nothing yet.
 *
 * If a device refuses a read with the exceptions 02 or 03, the read is divided, again and again,
 * until what is refused is one field. Only that field gets the status MBM_ILLEGAL_DATA_ADDRESS
 * or MBM_ILLEGAL_DATA_VALUE, with a call of `update`; mbm_plan_getStatus returns it from then on.
 * Meanwhile the other fields keep their status. Neighbours that the device has are read together
 * again. A field that was found not to be there has a read of its own, which is sent again each
 * `retryMs`: the device may have it later. Fields that share all their addresses are one.
 *
 * Where the storage does not suffice, a read stays as it is, and its fields have its status.
 * A read that is divided needs another one in `reads`. Bits, and fields that share some of their
 * addresses, also need spare words in `data`: four times the words of their reads, and
 * one for each field of bits, always suffice.
 *
 * Use only one of the two functions for a plan until it has ended or is begun again. The storage
 * stays valid until then.
 *
 * @param splitting  what was found, and storage
 * @return as mbm_plan_poll; MBM_INVALID_ARGUMENT without `blocks`
 */
uint8_t mbm_plan_pollSplitting(mbm_plan *plan, mbm_planSplitting *splitting);

/**
 * How the last read of a field ended, and how old its value is. The functions that get a value
 * return the last one that was read, also after a read has failed: this function says how old
 * that value is.
 *
 * @param field  the index of the field
 * @param ageMs  gets the milliseconds since the value arrived, 2147483647 (24 days) at most;
 *               0xFFFFFFFF if none ever did; may be NULL
 * @return MBM_PENDING before the first read has ended, then as it ended: MBM_OK, an exception of
 *         the device, or a failure such as MBM_RESPONSE_TIMED_OUT
 */
uint8_t mbm_plan_getStatus(mbm_plan *plan, uint16_t field, uint32_t *ageMs);

/**
 * A value as an integer: multiplied and divided as its field says, rounded to the nearest,
 * halves away from 0.
 *
 * @param field  the index of the field, of a bit or an integer
 * @param index  which of its values, 0 for the first
 * @param value  gets the number
 * @return a status; MBM_OUT_OF_RANGE if it is not in the range of `value`; MBM_INVALID_ARGUMENT
 *         for a float, a text or MBM_TYPE_REGISTERS; if no value has arrived yet the status that
 *         mbm_plan_getStatus returns
 */
uint8_t mbm_plan_getInteger(const mbm_plan *plan, uint16_t field, uint16_t index, int64_t *value);

/**
 * As mbm_plan_getInteger, but with 32 bits throughout: less code on a microcontroller.
 *
 * @param field  the index of the field, of a bit or of an integer of 16 or 32 bits
 * @return as mbm_plan_getInteger; MBM_OUT_OF_RANGE also if the value, multiplied, plus half of the
 *         divisor is not less than 2^32; MBM_INVALID_ARGUMENT also for an integer of 64 bits
 */
uint8_t mbm_plan_getInt32(const mbm_plan *plan, uint16_t field, uint16_t index, int32_t *value);

/**
 * A bit, an integer or a float as a double: multiplied and divided as its field says, and
 * rounded once, to the nearest. On AVR, where C's double has 32 bits, it is rounded to these after
 * that.
 *
 * @param value  gets the number; a float that is infinite or not a number stays so
 * @return as mbm_plan_getInteger; MBM_INVALID_ARGUMENT only for a text or
 *         MBM_TYPE_REGISTERS
 */
uint8_t mbm_plan_getNumber(const mbm_plan *plan, uint16_t field, uint16_t index, double *value);

/**
 * A value of type MBM_TYPE_FLOAT, whose bits are copied, or MBM_TYPE_DOUBLE, which is rounded
 * to the nearest; without the scale of its field.
 *
 * @return as mbm_plan_getInteger; MBM_INVALID_ARGUMENT for other types
 */
uint8_t mbm_plan_getFloat(const mbm_plan *plan, uint16_t field, uint16_t index, float *value);

/**
 * A text, which ends at its first NUL or with its field. In an order with the low byte first,
 * the first of two characters is a register's low byte.
 *
 * @param field     the index of the field, of type MBM_TYPE_TEXT
 * @param text      gets the text and a NUL
 * @param capacity  bytes of `text`; the field's count and one are always enough
 * @return as mbm_plan_getInteger; MBM_BUFFER_TOO_SMALL if the text does not fit
 */
uint8_t mbm_plan_getText(const mbm_plan *plan, uint16_t field, char *text, uint16_t capacity);

/**
 * The registers of a field as they were read, for mbm_registers_get... functions, in the order
 * of the field. It copies nothing: the next reply changes the words that it shows.
 *
 * @param field      the index of the field, of registers
 * @param registers  the view to fill in
 * @return as mbm_plan_getInteger
 */
uint8_t mbm_plan_getRegisters(const mbm_plan *plan, uint16_t field, mbm_registers *registers);

/**
 * Makes the read of a field due at once, for a value that is wanted now. A unit that does not
 * answer is left alone all the same.
 *
 * @param field  the index of the field
 */
uint8_t mbm_plan_refresh(mbm_plan *plan, uint16_t field);

/**
 * The reads that the plan has made of the fields: one request each.
 *
 * @param index  0 for the first read
 * @param read   gets the read
 * @return a status; MBM_INVALID_ARGUMENT after the last read
 */
uint8_t mbm_plan_getRead(const mbm_plan *plan, uint16_t index, mbm_planReadInfo *read);

#ifdef __cplusplus
}  // extern "C"
#endif

#endif  /* MBM_PLAN_H */
