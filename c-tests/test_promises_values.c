/* Each function for registers and bits, and each text of statuses, frames and events, is held to
 * its comment in mbm.h: results, limits, NULL. */
#include "refused.h"
#include "test.h"
#include "crc.h"
#include "hooked_port.h"

enum { FIRST = 65530, WORDS = 6, VALUE = 0x5A };

static uint16_t words[WORDS];
static mbm_registers r;

/* A value of any type, large enough for each. */
static union {
    uint8_t bytes[16];
    int8_t int8;
    uint16_t uint16;
    uint32_t uint32;
    uint64_t uint64;
    float single;
    int32_t int32;
    int64_t int64;
    double wide;
    char text[16];
    mbm_date date;
} value;

static const uint8_t three[] = {1, 2, 3};
static const float one = 1;
static const uint64_t five = 5;
static const int64_t minus_five = -5;
static const mbm_date noon = {.year = 2026, .month = 11, .day = 27, .hour = 12};
static const mbm_date only_noon = {.hour = 12};

static void setup(void)
{
    for (unsigned i = 0; i < WORDS; i++)
        words[i] = (uint16_t)(0x1112 + 0x0101 * i);
    memset(&value, VALUE, sizeof value);
    OK(mbm_registers_intoWords(&r, words, WORDS, FIRST));
}

fixture each_test = {setup, NULL};

/* The orders of a value: none, those of whole registers, those of values in two halves too. */
enum { NO_ORDER, WHOLE, HALVES };

/* The functions that get or set a value of one to four registers, with a call of each: ROW(name,
 * registers, orders, arguments). The argument in P is NULL if the call is to be refused. */
#define P(pointer) (is_null ? NULL : (pointer))
#define ACCESSORS(ROW)                                                                             \
    ROW(getBit, 1, NO_ORDER, (v, address, 15, P(value.bytes)))                                     \
    ROW(getUint8, 1, NO_ORDER, (v, address, 1, P(value.bytes)))                                    \
    ROW(getInt8, 1, NO_ORDER, (v, address, 0, P(&value.int8)))                                     \
    ROW(isEqualBytes, 2, NO_ORDER, (v, address, three, 3, P(value.bytes)))                         \
    ROW(getUint16, 1, HALVES, (v, address, order, P(&value.uint16)))                               \
    ROW(getUint32, 2, HALVES, (v, address, order, P(&value.uint32)))                               \
    ROW(getUint64, 4, HALVES, (v, address, order, P(&value.uint64)))                               \
    ROW(getFloat, 2, HALVES, (v, address, order, P(&value.single)))                                \
    ROW(getDouble, 4, HALVES, (v, address, order, P(&value.wide)))                                 \
    ROW(getString, 3, HALVES, (v, address, 5, order, P(value.text), 6))                            \
    ROW(getBytes, 3, HALVES, (v, address, order, P(value.bytes), 5))                               \
    ROW(setBit, 1, NO_ORDER, (P(v), address, 15, 1))                                               \
    ROW(setUint8, 1, NO_ORDER, (P(v), address, 0, 200))                                            \
    ROW(setInt8, 1, NO_ORDER, (P(v), address, 1, -100))                                            \
    ROW(setUint16, 1, HALVES, (P(v), address, order, 9))                                           \
    ROW(setUint32, 2, HALVES, (P(v), address, order, 9))                                           \
    ROW(setUint64, 4, HALVES, (v, address, order, P(&value.uint64)))                               \
    ROW(setFloat, 2, HALVES, (v, address, order, P(&value.single)))                                \
    ROW(setDouble, 4, HALVES, (v, address, order, P(&value.wide)))                                 \
    ROW(setString, 3, HALVES, (v, address, 5, order, P("text")))                                   \
    ROW(setBytes, 3, HALVES, (v, address, order, P(value.bytes), 5))                               \
    ROW(getBcd, 2, HALVES, (v, address, 2, order, P(&value.uint32)))                               \
    ROW(getM10k, 4, HALVES, (v, address, 4, order, P(&value.uint64)))                              \
    ROW(getSignedM10k, 2, HALVES, (v, address, 2, order, P(&value.int64)))                         \
    ROW(getUint24, 2, HALVES, (v, address, order, P(&value.uint32)))                               \
    ROW(getInt24, 2, HALVES, (v, address, order, P(&value.int32)))                                 \
    ROW(getUint48, 3, WHOLE, (v, address, order, P(&value.uint64)))                                \
    ROW(getInt48, 3, WHOLE, (v, address, order, P(&value.int64)))                                  \
    ROW(getSignMagnitude, 1, HALVES, (v, address, 1, order, P(&value.int32)))                      \
    ROW(getHalf, 1, HALVES, (v, address, order, P(&value.single)))                                 \
    ROW(getBits, 2, HALVES, (v, address, 2, order, 4, 8, P(&value.uint64)))                        \
    ROW(getText, 3, HALVES, (v, address, 5, order, MBM_TEXT_SPACES, P(value.text), 6))             \
    ROW(getDate, 2, HALVES, (v, address, order, "hm s-", 0, P(&value.date)))                       \
    ROW(getIecDate, 3, WHOLE, (v, address, 3, order, P(&value.date)))                              \
    ROW(setBcd, 2, HALVES, (P(v), address, 2, order, 9))                                           \
    ROW(setM10k, 4, HALVES, (v, address, 4, order, P(&five)))                                      \
    ROW(setSignedM10k, 2, HALVES, (v, address, 2, order, P(&minus_five)))                          \
    ROW(setUint24, 2, HALVES, (P(v), address, order, 9))                                           \
    ROW(setInt24, 2, HALVES, (P(v), address, order, -9))                                           \
    ROW(setUint48, 3, WHOLE, (v, address, order, P(&five)))                                        \
    ROW(setInt48, 3, WHOLE, (v, address, order, P(&minus_five)))                                   \
    ROW(setSignMagnitude, 1, HALVES, (P(v), address, 1, order, -9))                                \
    ROW(setHalf, 1, HALVES, (v, address, order, P(&one)))                                          \
    ROW(setBits, 2, HALVES, (v, address, 2, order, 4, 8, P(&five)))                                \
    ROW(setText, 3, HALVES, (v, address, 5, order, MBM_TEXT_SPACES, P("text")))                    \
    ROW(setDate, 2, HALVES, (v, address, order, "hm s-", 0, P(&only_noon)))                        \
    ROW(setIecDate, 3, WHOLE, (v, address, 3, order, P(&noon)))

typedef uint8_t (*accessor_call)(const mbm_registers *v, uint16_t address, uint8_t order,
                                 int is_null);

#define CALL(name, registers, orders, arguments)                                                   \
    static uint8_t name(const mbm_registers *v, uint16_t address, uint8_t order, int is_null)      \
    {                                                                                              \
        return mbm_registers_##name arguments;                                                     \
    }
ACCESSORS(CALL)

#define ACCESSOR(name, registers, orders, arguments) {name, #name, registers, orders},
static const struct accessor {
    accessor_call call;
    const char *name;
    uint16_t registers;
    uint8_t orders;
} accessors[] = {ACCESSORS(ACCESSOR)};

/* Asserts that a call returns a status, and changes neither value, words nor view. */
#define NOTHING(status, what)                                                                      \
    do {                                                                                           \
        uint16_t kept[WORDS];                                                                      \
        mbm_registers view = r;                                                                    \
                                                                                                   \
        memcpy(kept, words, sizeof words);                                                         \
        REFUSED(status, value, what);                                                              \
        assert_memory_equal(kept, words, sizeof words);                                            \
        assert_memory_equal(&view, &r, sizeof r);                                                  \
    } while (0)

TEST(values_end_where_the_registers_end)
{
    for (unsigned i = 0; i < COUNT(accessors); i++) {
        const struct accessor *a = &accessors[i];
        uint16_t last = (uint16_t)(FIRST + WORDS - a->registers);

        setup();
        OK(a->call(&r, FIRST, 0, 0));
        OK(a->call(&r, last, 0, 0));
        NOTHING(MBM_ILLEGAL_DATA_ADDRESS, a->call(&r, (uint16_t)(last + 1), 0, 0));
        NOTHING(MBM_ILLEGAL_DATA_ADDRESS, a->call(&r, FIRST - 1, 0, 0));
        NOTHING(MBM_ILLEGAL_DATA_ADDRESS, a->call(&r, 0, 0, 0));
        r.count = (uint16_t)(a->registers - 1);
        NOTHING(MBM_ILLEGAL_DATA_ADDRESS, a->call(&r, FIRST, 0, 0));
    }
}

TEST(null_and_views_without_data_are_refused)
{
    for (unsigned i = 0; i < COUNT(accessors); i++) {
        const struct accessor *a = &accessors[i];

        setup();
        NOTHING(MBM_INVALID_ARGUMENT, a->call(NULL, FIRST, 0, 0));
        NOTHING(MBM_INVALID_ARGUMENT, a->call(&r, FIRST, 0, 1));
        r.data = NULL;
        NOTHING(MBM_NOT_INITIALISED, a->call(&r, FIRST, 0, 0));
        memset(&r, 0, sizeof r);
        NOTHING(MBM_NOT_INITIALISED, a->call(&r, 0, 0, 0));
    }
}

TEST(only_the_orders_and_kinds_of_the_header_are_accepted)
{
    for (unsigned i = 0; i < COUNT(accessors); i++) {
        const struct accessor *a = &accessors[i];

        const unsigned last = a->orders == WHOLE ? MBM_ORDER_DCBA : MBM_ORDER_DCBAHGFE;

        for (unsigned order = 0; order < 256; order++) {
            setup();
            if (order <= last)
                OK(a->call(&r, FIRST, (uint8_t)order, 0));
            else if (a->orders != NO_ORDER)
                NOTHING(MBM_INVALID_ARGUMENT, a->call(&r, FIRST, (uint8_t)order, 0));
            setup();
            r.order = (uint8_t)order;
            if (order <= last)
                OK(a->call(&r, FIRST, 0, 0));
            else
                NOTHING(MBM_INVALID_ARGUMENT, a->call(&r, FIRST, 0, 0));
        }
        for (unsigned kind = 0; kind < 256; kind++) {
            setup();
            r.kind = (uint8_t)kind;
            if (kind == MBM_REGISTERS_INTO_WORDS || kind == MBM_REGISTERS_INTO_BYTES ||
                (a->name[0] != 's' &&
                 (kind == MBM_REGISTERS_OF_WORDS || kind == MBM_REGISTERS_OF_BYTES)))
                OK(a->call(&r, FIRST, 0, 0));
            else
                NOTHING(MBM_INVALID_ARGUMENT, a->call(&r, FIRST, 0, 0));
        }
    }
}

TEST(a_register_has_sixteen_bits_and_two_bytes)
{
    uint8_t on;

    for (unsigned bit = 0; bit < 256; bit++) {
        if (bit < 16) {
            words[1] = (uint16_t) ~(1u << bit);
            OK(mbm_registers_setBit(&r, FIRST + 1, (uint8_t)bit, 200));
            assert_int_equal(words[1], 0xFFFF);
            OK(mbm_registers_setBit(&r, FIRST + 1, (uint8_t)bit, 0));
            assert_int_equal(words[1], (uint16_t) ~(1u << bit));
            OK(mbm_registers_getBit(&r, FIRST + 1, (uint8_t)bit, &on));
            assert_int_equal(on, 0);
        } else {
            NOTHING(MBM_INVALID_ARGUMENT, mbm_registers_setBit(&r, FIRST + 1, (uint8_t)bit, 1));
            NOTHING(MBM_INVALID_ARGUMENT,
                    mbm_registers_getBit(&r, FIRST + 1, (uint8_t)bit, value.bytes));
        }
    }
    OK(mbm_registers_setBytes(&r, FIRST, MBM_ORDER_BADC, (const uint8_t *)"\x11", 1));
    OK(mbm_registers_setBytes(&r, FIRST, MBM_ORDER_ABCD, (const uint8_t *)"\x22", 1));
    assert_int_equal(words[0], 0x2211);
    OK(mbm_registers_getBytes(&r, FIRST, MBM_ORDER_BADC, &on, 1));
    assert_int_equal(on, 0x11);
    OK(mbm_registers_getBytes(&r, FIRST, MBM_ORDER_ABCD, &on, 1));
    assert_int_equal(on, 0x22);
}

TEST(a_byte_of_a_register_is_the_high_or_the_low_one_in_every_order)
{
    uint8_t byte;
    int8_t small;

    for (uint8_t order = MBM_ORDER_DEFAULT; order <= MBM_ORDER_DCBAHGFE; order++) {
        OK(mbm_registers_setByteOrder(&r, order));
        words[1] = 0x80FE;
        OK(mbm_registers_getUint8(&r, FIRST + 1, 1, &byte));
        assert_int_equal(byte, 0x80);
        OK(mbm_registers_getUint8(&r, FIRST + 1, 0, &byte));
        assert_int_equal(byte, 0xFE);
        OK(mbm_registers_getInt8(&r, FIRST + 1, 200, &small));
        assert_int_equal(small, -128);
        OK(mbm_registers_getInt8(&r, FIRST + 1, 0, &small));
        assert_int_equal(small, -2);
        OK(mbm_registers_setUint8(&r, FIRST + 1, 200, 0x12));
        assert_int_equal(words[1], 0x12FE);
        OK(mbm_registers_setInt8(&r, FIRST + 1, 0, -128));
        assert_int_equal(words[1], 0x1280);
    }
}

TEST(registers_are_compared_with_bytes_in_the_order_of_the_wire)
{
    uint8_t equal = 7;

    words[0] = 0x0102;
    words[1] = 0x03AA;
    for (uint8_t order = MBM_ORDER_DEFAULT; order <= MBM_ORDER_DCBAHGFE; order++) {
        OK(mbm_registers_setByteOrder(&r, order));
        words[1] = 0x03AA;
        OK(mbm_registers_isEqualBytes(&r, FIRST, three, 3, &equal));
        assert_int_equal(equal, 1);
        words[1] = 0x04AA;
        OK(mbm_registers_isEqualBytes(&r, FIRST, three, 3, &equal));
        assert_int_equal(equal, 0);
    }
    OK(mbm_registers_isEqualBytes(&r, FIRST, NULL, 0, &equal));
    assert_int_equal(equal, 1);
    IS(MBM_INVALID_ARGUMENT, mbm_registers_isEqualBytes(&r, FIRST, three, 3, NULL));
}

TEST(the_order_of_a_view_is_that_of_calls_without_one)
{
    uint32_t number;

    words[0] = 0x5652;
    words[1] = 0xAE41;
    OK(mbm_registers_setByteOrder(&r, MBM_ORDER_CDAB));
    OK(mbm_registers_getUint32(&r, FIRST, MBM_ORDER_DEFAULT, &number));
    assert_int_equal(number, 0xAE415652);
    OK(mbm_registers_getUint32(&r, FIRST, MBM_ORDER_ABCD, &number));
    assert_int_equal(number, 0x5652AE41);
    OK(mbm_registers_setByteOrder(&r, MBM_ORDER_DEFAULT));
    OK(mbm_registers_getUint32(&r, FIRST, MBM_ORDER_DEFAULT, &number));
    assert_int_equal(number, 0x5652AE41);
    INVALID(r, mbm_registers_setByteOrder(&r, MBM_ORDER_DCBAHGFE + 1));
    IS(MBM_INVALID_ARGUMENT, mbm_registers_setByteOrder(NULL, MBM_ORDER_ABCD));
    r.data = NULL;
    REFUSED(MBM_NOT_INITIALISED, r, mbm_registers_setByteOrder(&r, MBM_ORDER_ABCD));
}

TEST(a_text_ends_at_its_nul_or_with_its_field)
{
    OK(mbm_registers_setString(&r, FIRST, 6, 0, "ABCDEF"));
    OK(mbm_registers_getString(&r, FIRST, 5, 0, value.text, 6));
    assert_string_equal(value.text, "ABCDE");
    NOTHING(MBM_BUFFER_TOO_SMALL, mbm_registers_getString(&r, FIRST, 5, 0, value.text, 5));
    NOTHING(MBM_BUFFER_TOO_SMALL, mbm_registers_getString(&r, FIRST, 0, 0, value.text, 0));
    OK(mbm_registers_getString(&r, FIRST, 0, 0, value.text, 1));
    assert_string_equal(value.text, "");
    NOTHING(MBM_BUFFER_TOO_SMALL, mbm_registers_setString(&r, FIRST, 5, 0, "longer"));
    OK(mbm_registers_setString(&r, FIRST, 5, 0, "12345"));
    /* An odd length: the byte after the field becomes 0 too. */
    assert_int_equal(words[2], '5' << 8);
    OK(mbm_registers_setString(&r, FIRST, 6, 0, "ab"));
    assert_true(words[0] == ('a' << 8 | 'b') && words[1] == 0 && words[2] == 0);
    OK(mbm_registers_getString(&r, FIRST, 6, 0, value.text, 3));
    assert_string_equal(value.text, "ab");
}

TEST(an_odd_number_of_bytes_leaves_the_other_byte)
{
    words[1] = 0xAAAA;
    OK(mbm_registers_setBytes(&r, FIRST, 0, three, 3));
    assert_int_equal(words[0], 0x0102);
    assert_int_equal(words[1], 0x03AA);
}

/* --- views --- */

TEST(data_of_no_length_may_be_null)
{
    OK(mbm_registers_getBytes(&r, FIRST, 0, NULL, 0));
    OK(mbm_registers_setBytes(&r, FIRST, 0, NULL, 0));
#define EMPTY(view)                                                                                \
    do {                                                                                           \
        memset(&r, 0, sizeof r);                                                                   \
        OK(view);                                                                                  \
        NOTHING(MBM_ILLEGAL_DATA_ADDRESS, mbm_registers_getUint16(&r, 5, 0, &value.uint16));       \
    } while (0)
    EMPTY(mbm_registers_ofWords(&r, NULL, 0, 5));
    EMPTY(mbm_registers_ofBytes(&r, NULL, 0, 5));
    EMPTY(mbm_registers_intoWords(&r, NULL, 0, 5));
    EMPTY(mbm_registers_intoBytes(&r, NULL, 0, 5));
    OK(mbm_bits_pack(NULL, 0, NULL, 0));
    OK(mbm_bits_unpack(NULL, 0, NULL, 0));
}

TEST(a_view_ends_at_address_65535)
{
    static uint8_t bytes[4];

#define VIEW(status, call)                                                                         \
    do {                                                                                           \
        memset(&r, 0x77, sizeof r);                                                                \
        IS(status, call);                                                                          \
        assert_int_equal(r.data == NULL, (status) != MBM_OK);                                      \
        if ((status) == MBM_OK)                                                                    \
            assert_int_equal(r.order, MBM_ORDER_ABCD);                                             \
    } while (0)
    VIEW(MBM_OK, mbm_registers_ofWords(&r, words, 2, 65534));
    VIEW(MBM_ILLEGAL_DATA_ADDRESS, mbm_registers_ofWords(&r, words, 2, 65535));
    VIEW(MBM_OK, mbm_registers_intoWords(&r, words, 2, 65534));
    VIEW(MBM_ILLEGAL_DATA_ADDRESS, mbm_registers_intoWords(&r, words, 2, 65535));
    VIEW(MBM_OK, mbm_registers_ofBytes(&r, bytes, 4, 65534));
    VIEW(MBM_ILLEGAL_DATA_ADDRESS, mbm_registers_ofBytes(&r, bytes, 4, 65535));
    VIEW(MBM_OK, mbm_registers_intoBytes(&r, bytes, 4, 65534));
    VIEW(MBM_ILLEGAL_DATA_ADDRESS, mbm_registers_intoBytes(&r, bytes, 4, 65535));
    VIEW(MBM_INVALID_ARGUMENT, mbm_registers_ofBytes(&r, bytes, 3, 0));
    VIEW(MBM_INVALID_ARGUMENT, mbm_registers_intoBytes(&r, bytes, 3, 0));
    VIEW(MBM_INVALID_ARGUMENT, mbm_registers_ofBytes(&r, NULL, 1, 0));
    VIEW(MBM_INVALID_ARGUMENT, mbm_registers_intoBytes(&r, NULL, 1, 0));
    VIEW(MBM_INVALID_ARGUMENT, mbm_registers_ofBytes(&r, NULL, 2, 0));
    VIEW(MBM_INVALID_ARGUMENT, mbm_registers_intoBytes(&r, NULL, 2, 0));
    VIEW(MBM_INVALID_ARGUMENT, mbm_registers_ofWords(&r, NULL, 1, 0));
    VIEW(MBM_INVALID_ARGUMENT, mbm_registers_intoWords(&r, NULL, 1, 0));
    IS(MBM_INVALID_ARGUMENT, mbm_registers_ofWords(NULL, words, 1, 0));
    IS(MBM_INVALID_ARGUMENT, mbm_registers_ofBytes(NULL, bytes, 2, 0));
    IS(MBM_INVALID_ARGUMENT, mbm_registers_intoWords(NULL, words, 1, 0));
    IS(MBM_INVALID_ARGUMENT, mbm_registers_intoBytes(NULL, bytes, 2, 0));
}

/* --- bits --- */

TEST(bits_are_packed_from_the_lowest_on)
{
    static const uint8_t coils[] = {1, 0, 200, 0, 0, 0, 0, 0, 0, 1};
    uint8_t bytes[3] = {0xEE, 0xEE, 0xEE}, back[10];

    REFUSED(MBM_BUFFER_TOO_SMALL, bytes, mbm_bits_pack(coils, 10, bytes, 1));
    INVALID(bytes, mbm_bits_pack(NULL, 10, bytes, 3));
    IS(MBM_INVALID_ARGUMENT, mbm_bits_pack(coils, 10, NULL, 3));
    OK(mbm_bits_pack(coils, 10, bytes, 3));
    assert_true(bytes[0] == 5 && bytes[1] == 2 && bytes[2] == 0xEE);
    memset(back, 0xEE, sizeof back);
    REFUSED(MBM_ILLEGAL_DATA_ADDRESS, back, mbm_bits_unpack(bytes, 1, back, 10));
    INVALID(back, mbm_bits_unpack(NULL, 2, back, 10));
    IS(MBM_INVALID_ARGUMENT, mbm_bits_unpack(bytes, 2, NULL, 10));
    OK(mbm_bits_unpack(bytes, 2, back, 10));
    assert_true(back[0] == 1 && back[1] == 0 && back[2] == 1 && back[9] == 1);
}

TEST(a_bit_is_found_by_its_address)
{
    uint8_t bytes[2] = {0, 0}, on = 7;
    uint16_t wide[1] = {0};

    OK(mbm_bits_set(bytes, 65526, 10, 65535, 3));
    assert_true(bytes[0] == 0 && bytes[1] == 2);
    OK(mbm_bits_isSet(bytes, 65526, 10, 65535, &on));
    assert_int_equal(on, 1);
    OK(mbm_bits_setInWords(wide, 65526, 10, 65535, 3));
    assert_int_equal(wide[0], 0x0200);
    OK(mbm_bits_isSetInWords(wide, 65526, 10, 65534, &on));
    assert_int_equal(on, 0);
#define OUTSIDE(status, first, quantity, address)                                                  \
    do {                                                                                           \
        REFUSED(status, bytes, mbm_bits_set(bytes, first, quantity, address, 1));                  \
        REFUSED(status, wide, mbm_bits_setInWords(wide, first, quantity, address, 1));             \
        REFUSED(status, on, mbm_bits_isSet(bytes, first, quantity, address, &on));                 \
        REFUSED(status, on, mbm_bits_isSetInWords(wide, first, quantity, address, &on));           \
    } while (0)
    OUTSIDE(MBM_ILLEGAL_DATA_ADDRESS, 10, 10, 9);
    OUTSIDE(MBM_ILLEGAL_DATA_ADDRESS, 10, 10, 20);
    OUTSIDE(MBM_ILLEGAL_DATA_ADDRESS, 10, 0, 10);
    OUTSIDE(MBM_ILLEGAL_DATA_ADDRESS, 65527, 10, 65530);
    IS(MBM_INVALID_ARGUMENT, mbm_bits_set(NULL, 10, 10, 10, 1));
    IS(MBM_INVALID_ARGUMENT, mbm_bits_setInWords(NULL, 10, 10, 10, 1));
    INVALID(on, mbm_bits_isSet(NULL, 10, 10, 10, &on));
    INVALID(on, mbm_bits_isSetInWords(NULL, 10, 10, 10, &on));
    IS(MBM_INVALID_ARGUMENT, mbm_bits_isSet(bytes, 10, 10, 10, NULL));
    IS(MBM_INVALID_ARGUMENT, mbm_bits_isSetInWords(wide, 10, 10, 10, NULL));
}

/* --- texts of statuses, frames and events --- */

enum { TEXT_SUFFICES = 2295 };

static const mbm_framing rtu = {.kind = MBM_FRAMING_RTU};

TEST(every_number_has_a_text)
{
    unsigned status;

    for (status = 0; status < 256; status++) {
        const char *text = mbm_status_text((uint8_t)status);

        assert_non_null(text);
        assert_in_range(strlen(text), 1, 80);
    }
    assert_string_equal(mbm_status_text(MBM_OK), "success");
    assert_string_not_equal(mbm_status_text(MBM_INVALID_CRC), "success");
    assert_string_equal(mbm_status_text(200), "not a status");
}

TEST(a_request_that_was_refused_here_is_no_exception_of_the_device)
{
    static mbm_client client;
    static mbm_clientRequest request;
    static mbm_line line;
    static mbm_node node;
    static uint8_t buffer[MBM_MAX_FRAME];
    static uint16_t response[1];
    static hooked_port wire;
    const mbm_port port = hooked_port_of(&wire);

    for (unsigned status = 0; status < 256; status++) {
        for (unsigned code = 0; code < 256; code++) {
            const char *text = mbm_status_textOf((uint8_t)status, (uint8_t)code);
            int is_refused = code == 0 && status >= 1 && status <= 3;

            assert_int_equal(strstr(text, "nothing was sent") != NULL, is_refused);
            assert_true(is_refused || text == mbm_status_text((uint8_t)status));
            assert_true(!is_refused || strstr(text, "exception") == NULL);
        }
    }
    /* As a master and a client fill both in. */
    wire.step = 500;
    OK(mbm_line_beginRtu(&line, &port, buffer, sizeof buffer));
    OK(mbm_node_begin(&node, &line, 17, response, 1, NULL, 0));
    uint8_t refused = mbm_node_readHoldingRegisters(&node, 0, 126);
    IS(MBM_ILLEGAL_DATA_VALUE, refused);
    assert_string_equal(
        mbm_status_textOf(refused, mbm_node_getExceptionCode(&node)),
        "refused, nothing was sent: the standard or a buffer does not allow the quantity or value");
    OK(mbm_client_beginRtu(&client, &port, buffer, sizeof buffer));
    request.unit = 17;
    request.exception = MBM_ILLEGAL_DATA_ADDRESS;
    IS(MBM_ILLEGAL_DATA_ADDRESS, mbm_client_readHoldingRegisters(&client, &request, 65535, 2));
    assert_string_equal(mbm_status_textOf(request.status, request.exception),
                        "refused, nothing was sent: the addresses pass 65535");
    IS(MBM_PENDING, mbm_client_readHoldingRegisters(&client, &request, 65535, 1));
    while (wire.length == 0)
        IS(MBM_PENDING, mbm_client_poll(&client));
    hooked_port_arrive_rtu(&wire, 17, "\x83\2", 2);
    while (mbm_client_poll(&client) == MBM_PENDING)
        wire.now += 500;
    IS(MBM_ILLEGAL_DATA_ADDRESS, request.status);
    assert_string_equal(mbm_status_textOf(request.status, request.exception),
                        "exception 02: illegal data address");
}

TEST(the_text_of_invalid_argument_mentions_ranges)
{
    assert_non_null(strstr(mbm_status_text(MBM_INVALID_ARGUMENT), "out of range"));
    assert_non_null(strstr(mbm_status_text(MBM_INVALID_ARGUMENT), "NULL"));
    assert_non_null(strstr(mbm_status_text(MBM_BUSY), "hook"));
}

/* Writes a PDU of `size` bytes, of a shape, that is valid for some function. */
enum { SHAPES = 14 };

static void shape_pdu(uint8_t *pdu, uint16_t size, unsigned shape)
{
    static const uint8_t query[] = {0, 0}, group[] = {6, 0xFF, 0xFF, 0x27, 0x0F, 0xFF, 0xFF},
                         single[] = {6, 0xFF, 0xFF, 0x27, 0x0F, 0, 1, 0xFF, 0xFF},
                         objects[] = {0x0E, 3, 0x83, 0xFF, 0xFF};
    unsigned i, step = shape == 5 ? sizeof group : sizeof single;
    uint8_t count = (uint8_t)(size - 2);

    memset(pdu + 1, 0xFF, size - 1u);
    switch (shape) {
    case 1: pdu[1] = count; break;
    case 2: memcpy(pdu + 1, query, 2); break;
    case 3: pdu[1] = count, pdu[size - 1] = 0; break;
    case 4: /* groups of the reply of function 14 */
        for (pdu[1] = count, i = 2; i + 4 <= size; i += 4)
            pdu[i] = 3, pdu[i + 1] = 6;
        break;
    case 5:
    case 6: /* groups of requests of functions 14 and 15 */
        for (pdu[1] = count, i = 2; i + step <= size; i += step)
            memcpy(pdu + i, shape == 5 ? group : single, step);
        break;
    case 7:
    case 8: /* objects without and with single byte */
        memcpy(pdu + 1, objects, 5);
        pdu[6] = (uint8_t)((size - 7) / (shape - 5));
        for (i = 7; i + shape - 5 <= size; i += shape - 5)
            pdu[i] = 0xFF, pdu[i + 1] = (uint8_t)(shape - 7);
        break;
    case 9:
    case 10: /* 0F and 10 */
        pdu[3] = 0;
        pdu[1] = pdu[2] = 0;
        pdu[4] = (uint8_t)((size - 6) / 2);
        if (shape == 10) {
            pdu[3] = (uint8_t)((8 * (size - 6)) >> 8);
            pdu[4] = (uint8_t)(8 * (size - 6));
        }
        pdu[5] = (uint8_t)(size - 6);
        break;
    case 11: /* 17 */
        memset(pdu + 1, 0, 8);
        pdu[1] = pdu[5] = 0xFF;
        pdu[4] = 125;
        pdu[8] = (uint8_t)((size - 10) / 2);
        pdu[9] = (uint8_t)(size - 10);
        break;
    case 12: /* the reply of 18 */
        pdu[1] = pdu[3] = 0;
        pdu[2] = count - 1;
        pdu[4] = (uint8_t)((size - 5) / 2);
        break;
    case 13: pdu[1] = 0x0D; break; /* another MEI type */
    default: break;
    }
}

TEST(no_text_of_a_frame_is_longer_than_its_comment_says)
{
    static char text[8192];
    uint8_t frame[MBM_MAX_FRAME];
    size_t most = 0;
    uint16_t length, size;

    for (unsigned function = 0; function < 129; function++) {
        for (unsigned shape = 0; shape < SHAPES; shape++) {
            for (length = MBM_MAX_PDU - 16; length <= MBM_MAX_PDU; length++) {
                frame[0] = 255;
                frame[1] = (uint8_t)function;
                shape_pdu(frame + 1, length, shape);
                size = (uint16_t)seal(frame, length + 1u);
                for (uint8_t side = MBM_PACKET_REQUEST; side <= MBM_PACKET_RESPONSE; side++) {
                    OK(mbm_frame_text(&rtu, side, frame, size, text, sizeof text));
                    if (strlen(text) > most)
                        most = strlen(text);
                }
            }
        }
    }
    /* 2000 discrete inputs. */
    assert_int_equal(most + 1, TEXT_SUFFICES);
    frame[0] = 255;
    frame[1] = MBM_FC_READ_DISCRETE_INPUTS;
    shape_pdu(frame + 1, 252, 1);
    size = (uint16_t)seal(frame, 253);
    OK(mbm_frame_text(&rtu, MBM_PACKET_RESPONSE, frame, size, text, TEXT_SUFFICES));
    IS(MBM_BUFFER_TOO_SMALL,
       mbm_frame_text(&rtu, MBM_PACKET_RESPONSE, frame, size, text, TEXT_SUFFICES - 1));
    assert_int_equal(strlen(text), TEXT_SUFFICES - 2);
}

TEST(the_longest_text_of_an_event_fits_too)
{
    static char text[2400];
    static mbm_sniffer sniffer;
    static uint8_t buffer[2 * MBM_MAX_FRAME];
    uint8_t frame[MBM_MAX_FRAME] = {255, 2, 0xF8, 0x30, 0x07, 0xD0};
    mbm_event event;

    OK(mbm_sniffer_begin(&sniffer, MBM_FRAMING_RTU, buffer, sizeof buffer));
    mbm_sniffer_feed(&sniffer, MBM_DIRECTION_BOTH, frame, (uint16_t)seal(frame, 6), 0);
    assert_int_equal(mbm_sniffer_next(&sniffer, 10000, &event), 1);
    shape_pdu(frame + 1, 252, 1);
    mbm_sniffer_feed(&sniffer, MBM_DIRECTION_BOTH, frame, (uint16_t)seal(frame, 253), 20000);
    assert_int_equal(mbm_sniffer_next(&sniffer, 90000, &event), 1);
    OK(mbm_event_text(&event, text, sizeof text));
    assert_in_range(strlen(text), TEXT_SUFFICES, sizeof text - 1);
    IS(MBM_BUFFER_TOO_SMALL, mbm_event_text(&event, text, 9));
    assert_string_equal(text, "unit 255");
    IS(MBM_INVALID_ARGUMENT, mbm_event_text(&event, NULL, 9));
    IS(MBM_BUFFER_TOO_SMALL, mbm_event_text(&event, text, 0));
}

/* The version of a Cargo.toml. */
static void read_version(const char *path, char *version)
{
    FILE *file = fopen(path, "r");
    char line[200];

    assert_non_null(file);
    while (fgets(line, sizeof line, file))
        if (sscanf(line, "version = \"%19[0-9.]\"", version) == 1)
            break;
    (void)fclose(file);
}

TEST(the_version_is_that_of_the_packages_in_header_and_archive)
{
    char numbers[20], package[20];

    snprintf(numbers, sizeof numbers, "%d.%d.%d", MBM_VERSION_MAJOR, MBM_VERSION_MINOR,
             MBM_VERSION_PATCH);
    assert_string_equal(MBM_VERSION, numbers);
    assert_string_equal(mbm_version(), numbers);
    read_version("Cargo.toml", package);
    assert_string_equal(package, numbers);
}
