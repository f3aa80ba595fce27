/* Names, sizes and ranges of the types of values, and their integers. */
#include "value_types.h"

#include <stddef.h>

const char *const value_type_names[] = {"",
                                        "bit",
                                        "uint16",
                                        "int16",
                                        "uint32",
                                        "int32",
                                        "uint64",
                                        "int64",
                                        "float",
                                        "double",
                                        "text",
                                        "int24",
                                        "uint24",
                                        "int48",
                                        "uint48",
                                        "sign_magnitude16",
                                        "sign_magnitude32",
                                        "bcd16",
                                        "bcd32",
                                        "int32_m10k",
                                        "uint32_m10k",
                                        "int48_m10k",
                                        "uint48_m10k",
                                        "int64_m10k",
                                        "uint64_m10k",
                                        "float16",
                                        "text_spaces",
                                        "text_low",
                                        "text_low_spaces",
                                        "text_high",
                                        "text_high_spaces",
                                        "unix32",
                                        "unix64",
                                        "unix64_ms",
                                        "seconds_2000",
                                        "iec870",
                                        "iec870_3",
                                        "date",
                                        "date_bcd",
                                        NULL};

const char *value_type_name(uint8_t type)
{
    if (type >= VALUE_DATE_BCD_OF_1)
        return value_type_names[VALUE_DATE_BCD];
    if (type >= VALUE_DATE_OF_1)
        return value_type_names[VALUE_DATE];
    if (type == VALUE_BITS32)
        return "bits of 32";
    return type == VALUE_BITS64 ? "bits of 64" : value_type_names[type];
}

uint16_t value_registers(uint8_t type, uint16_t count)
{
    if (value_is_text(type))
        return type < VALUE_TEXT_LOW ? (uint16_t)((count + 1) / 2) : count;
    if (type >= VALUE_DATE_BCD_OF_1)
        return (uint16_t)(type - VALUE_DATE_BCD_OF_1 + 1);
    if (type >= VALUE_DATE_OF_1)
        return (uint16_t)(type - VALUE_DATE_OF_1 + 1);
    switch (type) {
    case 0:
    case VALUE_DATE:
    case VALUE_DATE_BCD: return 0;
    case MBM_TYPE_BIT:
    case MBM_TYPE_UINT16:
    case MBM_TYPE_INT16:
    case VALUE_SIGN_MAGNITUDE16:
    case VALUE_BCD16:
    case VALUE_FLOAT16: return 1;
    case VALUE_INT48:
    case VALUE_UINT48:
    case VALUE_INT48_M10K:
    case VALUE_UINT48_M10K:
    case VALUE_IEC870_3: return 3;
    case MBM_TYPE_UINT64:
    case MBM_TYPE_INT64:
    case MBM_TYPE_DOUBLE:
    case VALUE_INT64_M10K:
    case VALUE_UINT64_M10K:
    case VALUE_UNIX64:
    case VALUE_UNIX64_MS:
    case VALUE_IEC870:
    case VALUE_BITS64: return 4;
    default: return 2;
    }
}

int value_is_float(uint8_t type)
{
    return type == MBM_TYPE_FLOAT || type == MBM_TYPE_DOUBLE || type == VALUE_FLOAT16;
}

int value_is_text(uint8_t type)
{
    return type == MBM_TYPE_TEXT || (type >= VALUE_TEXT_SPACES && type <= VALUE_TEXT_HIGH_SPACES);
}

int value_is_date(uint8_t type)
{
    return (type >= VALUE_UNIX32 && type <= VALUE_DATE_BCD) || type >= VALUE_DATE_OF_1;
}

int value_is_integer(uint8_t type)
{
    return !value_is_float(type) && !value_is_text(type) && !value_is_date(type);
}

int value_is_wide_bits(uint8_t type)
{
    return type == VALUE_BITS32 || type == VALUE_BITS64;
}

int value_is_of_plan(uint8_t type, uint8_t order)
{
    return type <= MBM_TYPE_TEXT && order <= MBM_ORDER_DCBA;
}

uint8_t value_text_form(uint8_t type)
{
    switch (type) {
    case VALUE_TEXT_SPACES: return MBM_TEXT_SPACES;
    case VALUE_TEXT_LOW: return MBM_TEXT_LOW_BYTES;
    case VALUE_TEXT_LOW_SPACES: return MBM_TEXT_LOW_BYTES | MBM_TEXT_SPACES;
    case VALUE_TEXT_HIGH: return MBM_TEXT_HIGH_BYTES;
    case VALUE_TEXT_HIGH_SPACES: return MBM_TEXT_HIGH_BYTES | MBM_TEXT_SPACES;
    default: return 0;
    }
}

uint16_t value_mask(uint8_t type, uint8_t order, uint8_t first, uint8_t bits, uint32_t nth)
{
    enum { MOST = 4 };
    uint16_t words[MOST] = {0};
    mbm_registers registers;
    uint64_t ones;

    if (!value_is_wide_bits(type))
        return 0xFFFF;
    ones = UINT64_MAX >> (64u - bits) % 64u;
    (void)mbm_registers_intoWords(&registers, words, MOST, 0);
    (void)mbm_registers_setBits(&registers, 0, value_registers(type, 1), order, first, bits, &ones);
    return nth < MOST ? words[nth] : 0;
}

/* --- integers --- */

value_range value_range_of(uint8_t type)
{
#define SIGNED(bits)                                                                               \
    {                                                                                              \
        UINT64_C(1) << ((bits)-1), (UINT64_C(1) << ((bits)-1)) - 1                                 \
    }
#define EVEN(most)                                                                                 \
    {                                                                                              \
        most, most                                                                                 \
    }
    static const value_range RANGES[VALUE_FLOAT16] = {
        [MBM_TYPE_BIT] = {0, 1},
        [MBM_TYPE_UINT16] = {0, UINT16_MAX},
        [MBM_TYPE_INT16] = SIGNED(16),
        [MBM_TYPE_UINT32] = {0, UINT32_MAX},
        [MBM_TYPE_INT32] = SIGNED(32),
        [MBM_TYPE_UINT64] = {0, UINT64_MAX},
        [MBM_TYPE_INT64] = SIGNED(64),
        [VALUE_INT24] = SIGNED(24),
        [VALUE_UINT24] = {0, 0xFFFFFF},
        [VALUE_INT48] = SIGNED(48),
        [VALUE_UINT48] = {0, 0xFFFFFFFFFFFF},
        [VALUE_SIGN_MAGNITUDE16] = EVEN(INT16_MAX),
        [VALUE_SIGN_MAGNITUDE32] = EVEN(INT32_MAX),
        [VALUE_BCD16] = {0, 9999},
        [VALUE_BCD32] = {0, 99999999},
        [VALUE_INT32_M10K] = EVEN(99999999),
        [VALUE_UINT32_M10K] = {0, 99999999},
        [VALUE_INT48_M10K] = EVEN(999999999999),
        [VALUE_UINT48_M10K] = {0, 999999999999},
        [VALUE_INT64_M10K] = EVEN(9999999999999999),
        [VALUE_UINT64_M10K] = {0, 9999999999999999},
    };

    return type < VALUE_FLOAT16 ? RANGES[type] : (value_range){0, 0};
}

/* Takes an integer with a sign apart. */
static void take(int64_t number, uint64_t *amount, int *is_negative)
{
    *is_negative = number < 0;
    *amount = number < 0 ? ~(uint64_t)number + 1 : (uint64_t)number;
}

uint8_t value_get_integer(uint8_t type, uint8_t order, const mbm_registers *registers,
                          uint16_t address, uint64_t *amount, int *is_negative)
{
    const uint16_t count = value_registers(type, 1);
    uint16_t word = 0;
    uint32_t whole = 0;
    uint64_t wide = 0;
    int64_t number = 0;
    int32_t two = 0;
    uint8_t status;

    *amount = 0;
    *is_negative = 0;
    switch (type) {
    case MBM_TYPE_INT16:
        status = mbm_registers_getUint16(registers, address, order, &word);
        number = (int16_t)word;
        break;
    case MBM_TYPE_INT32:
        status = mbm_registers_getUint32(registers, address, order, &whole);
        number = (int32_t)whole;
        break;
    case MBM_TYPE_INT64:
        status = mbm_registers_getUint64(registers, address, order, (uint64_t *)&number);
        break;
    case VALUE_INT24:
        status = mbm_registers_getInt24(registers, address, order, &two);
        number = two;
        break;
    case VALUE_SIGN_MAGNITUDE16:
    case VALUE_SIGN_MAGNITUDE32:
        status = mbm_registers_getSignMagnitude(registers, address, count, order, &two);
        number = two;
        break;
    case VALUE_INT48: status = mbm_registers_getInt48(registers, address, order, &number); break;
    case VALUE_INT32_M10K:
    case VALUE_INT48_M10K:
    case VALUE_INT64_M10K:
        status = mbm_registers_getSignedM10k(registers, address, count, order, &number);
        break;
    case MBM_TYPE_UINT32:
        status = mbm_registers_getUint32(registers, address, order, &whole);
        wide = whole;
        break;
    case MBM_TYPE_UINT64: status = mbm_registers_getUint64(registers, address, order, &wide); break;
    case VALUE_UINT24:
        status = mbm_registers_getUint24(registers, address, order, &whole);
        wide = whole;
        break;
    case VALUE_UINT48: status = mbm_registers_getUint48(registers, address, order, &wide); break;
    case VALUE_BCD16:
    case VALUE_BCD32:
        status = mbm_registers_getBcd(registers, address, count, order, &whole);
        wide = whole;
        break;
    case VALUE_UINT32_M10K:
    case VALUE_UINT48_M10K:
    case VALUE_UINT64_M10K:
        status = mbm_registers_getM10k(registers, address, count, order, &wide);
        break;
    default:
        status = mbm_registers_getUint16(registers, address,
                                         type == MBM_TYPE_BIT ? MBM_ORDER_ABCD : order, &word);
        wide = word;
    }
    take(number, amount, is_negative);
    *amount |= wide;
    return status;
}

void value_set_integer(uint8_t type, uint8_t order, const mbm_registers *registers,
                       uint16_t address, uint64_t integer)
{
    const uint16_t count = value_registers(type, 1);
    const int64_t number = (int64_t)integer;

    switch (type) {
    case MBM_TYPE_UINT32:
    case MBM_TYPE_INT32:
        (void)mbm_registers_setUint32(registers, address, order, (uint32_t)integer);
        return;
    case MBM_TYPE_UINT64:
    case MBM_TYPE_INT64: (void)mbm_registers_setUint64(registers, address, order, &integer); return;
    case VALUE_INT24:
        (void)mbm_registers_setInt24(registers, address, order, (int32_t)number);
        return;
    case VALUE_UINT24:
        (void)mbm_registers_setUint24(registers, address, order, (uint32_t)integer);
        return;
    case VALUE_INT48: (void)mbm_registers_setInt48(registers, address, order, &number); return;
    case VALUE_UINT48: (void)mbm_registers_setUint48(registers, address, order, &integer); return;
    case VALUE_SIGN_MAGNITUDE16:
    case VALUE_SIGN_MAGNITUDE32:
        (void)mbm_registers_setSignMagnitude(registers, address, count, order, (int32_t)number);
        return;
    case VALUE_BCD16:
    case VALUE_BCD32:
        (void)mbm_registers_setBcd(registers, address, count, order, (uint32_t)integer);
        return;
    case VALUE_INT32_M10K:
    case VALUE_INT48_M10K:
    case VALUE_INT64_M10K:
        (void)mbm_registers_setSignedM10k(registers, address, count, order, &number);
        return;
    case VALUE_UINT32_M10K:
    case VALUE_UINT48_M10K:
    case VALUE_UINT64_M10K:
        (void)mbm_registers_setM10k(registers, address, count, order, &integer);
        return;
    case MBM_TYPE_BIT:
        (void)mbm_registers_setUint16(registers, address, MBM_ORDER_ABCD, (uint16_t)integer);
        return;
    default: (void)mbm_registers_setUint16(registers, address, order, (uint16_t)integer);
    }
}
