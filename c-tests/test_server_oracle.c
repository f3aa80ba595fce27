/* A million requests to the tables of a server, most of them nearly right, compared with a
 * model of the test's own: every response agrees, and so does every register and bit
 * afterwards. The cells are in one record of each kind, or in several. */
#include "crc.h"
#include "mbm.h"
#include "test.h"

#include <stdlib.h>
#include <string.h>

enum { CELLS = 64, BASE = 0xFFC0 - CELLS, UNIT = 9, GUARD = 8 };

static uint64_t seed = 0x9E3779B97F4A7C15u;

static unsigned below(unsigned limit)
{
    seed ^= seed << 13;
    seed ^= seed >> 7;
    seed ^= seed << 17;
    return (unsigned)(seed >> 24) % limit;
}

/* The server's tables, with guard bytes around them that must not change. */
static struct {
    uint16_t before[GUARD], holding[CELLS], between[GUARD], inputs[CELLS], after[GUARD];
    uint8_t bits_before[GUARD], coils[CELLS / 8], bits_between[GUARD], discrete[CELLS / 8];
    uint8_t bits_after[GUARD];
} memory;

/* The contents that the tables should have. */
static struct {
    uint16_t words[2][CELLS];
    uint8_t bits[2][CELLS];
} model;

static mbm_unit unit;
static mbm_registerTable holding, inputs;
static mbm_bitTable coils, discrete;
static uint8_t valid[CELLS / 8];

/* The records of a unit that has several of each kind. They begin at these cells, where the bytes
 * of bits begin too. */
enum { PIECES = 3 };
static const unsigned first_of[PIECES + 1] = {0, 8, 32, CELLS};
static int is_split;

static int is_in_one_piece(unsigned first, unsigned quantity)
{
    unsigned i = 0;

    while (first >= first_of[i + 1])
        i++;
    return first + quantity <= first_of[i + 1];
}

static int exists(unsigned address, unsigned quantity)
{
    if (address < BASE || address + quantity > BASE + CELLS)
        return 0;
    for (unsigned i = address - BASE; i < address - BASE + quantity; i++)
        if (i == 20 || i == 33)
            return 0;
    return !is_split || quantity == 0 || is_in_one_piece(address - BASE, quantity);
}

/* Both ranges exist, and one record has them. */
static int exist(unsigned one, unsigned quantity, unsigned other, unsigned others)
{
    unsigned first = one < other ? one : other;
    unsigned end = one + quantity > other + others ? one + quantity : other + others;

    return exists(one, quantity) && exists(other, others) &&
           (!is_split || is_in_one_piece(first - BASE, end - first));
}

static unsigned word(const uint8_t *bytes)
{
    return (unsigned)(bytes[0] << 8 | bytes[1]);
}

static size_t refuse(uint8_t *out, uint8_t function, uint8_t code)
{
    out[0] = function | 0x80;
    out[1] = code;
    return 2;
}

static size_t words_of(uint8_t *out, uint8_t function, const uint16_t *cells, unsigned quantity)
{
    out[0] = function;
    out[1] = (uint8_t)(2 * quantity);
    for (unsigned i = 0; i < quantity; i++) {
        out[2 + 2 * i] = (uint8_t)(cells[i] >> 8);
        out[3 + 2 * i] = (uint8_t)cells[i];
    }
    return 2 + 2 * quantity;
}

/* Writes the response by the standard, and changes the model as the server should change
 * its tables. */
static size_t expected_response(const uint8_t *pdu, size_t length, uint8_t *out)
{
    uint8_t function = pdu[0];
    unsigned address = length >= 3 ? word(pdu + 1) : 0, quantity = length >= 5 ? word(pdu + 3) : 0;
    unsigned bytes, written, to;

    memcpy(out, pdu, length < 7 ? length : 7);
    switch (function) {
    case 1:
    case 2:
        if (length != 5 || quantity < 1 || quantity > 2000)
            return refuse(out, function, 3);
        if (!exists(address, quantity))
            return refuse(out, function, 2);
        bytes = (quantity + 7) / 8;
        memset(out + 1, 0, 1 + bytes);
        out[1] = (uint8_t)bytes;
        for (unsigned i = 0; i < quantity; i++)
            out[2 + i / 8] |= (uint8_t)(model.bits[function - 1][address - BASE + i] << i % 8);
        return 2 + bytes;
    case 3:
    case 4:
        if (length != 5 || quantity < 1 || quantity > 125)
            return refuse(out, function, 3);
        if (!exists(address, quantity))
            return refuse(out, function, 2);
        return words_of(out, function, &model.words[function - 3][address - BASE], quantity);
    case 5:
    case 6:
        if (length != 5 || (function == 5 && quantity != 0 && quantity != 0xFF00))
            return refuse(out, function, 3);
        if (!exists(address, 1))
            return refuse(out, function, 2);
        if (function == 5)
            model.bits[0][address - BASE] = quantity != 0;
        else
            model.words[0][address - BASE] = (uint16_t)quantity;
        return 5;
    case 0x0F:
    case 0x10:
        bytes = function == 0x0F ? (quantity + 7) / 8 : 2 * quantity;
        if (length < 6 || quantity < 1 || quantity > (function == 0x0F ? 1968 : 123) ||
            pdu[5] != bytes || length != 6 + bytes)
            return refuse(out, function, 3);
        if (!exists(address, quantity))
            return refuse(out, function, 2);
        for (unsigned i = 0; i < quantity; i++)
            if (function == 0x0F)
                model.bits[0][address - BASE + i] = pdu[6 + i / 8] >> i % 8 & 1;
            else
                model.words[0][address - BASE + i] = (uint16_t)word(pdu + 6 + 2 * i);
        return 5;
    case 0x16:
        if (length != 7)
            return refuse(out, function, 3);
        if (!exists(address, 1))
            return refuse(out, function, 2);
        to = model.words[0][address - BASE];
        model.words[0][address - BASE] = (uint16_t)((to & quantity) | (word(pdu + 5) & ~quantity));
        return 7;
    case 0x17:
        to = length >= 10 ? word(pdu + 5) : 0;
        written = length >= 10 ? word(pdu + 7) : 0;
        if (length < 10 || quantity < 1 || quantity > 125 || written < 1 || written > 121 ||
            pdu[9] != 2 * written || length != 10 + 2 * written)
            return refuse(out, function, 3);
        if (!exist(address, quantity, to, written))
            return refuse(out, function, 2);
        for (unsigned i = 0; i < written; i++)
            model.words[0][to - BASE + i] = (uint16_t)word(pdu + 10 + 2 * i);
        return words_of(out, function, &model.words[0][address - BASE], quantity);
    default: return refuse(out, function, 1);
    }
}

static size_t put(uint8_t *place, unsigned value)
{
    place[0] = (uint8_t)(value >> 8);
    place[1] = (uint8_t)value;
    return 2;
}

static unsigned some_address(void)
{
    return below(8) ? BASE - 2 + below(CELLS + 4) : below(0x10000);
}

static unsigned some_quantity(void)
{
    static const unsigned edges[] = {0, 1, 121, 122, 123, 124, 125, 126, 1968, 1969, 2000, 2001};

    switch (below(8)) {
    case 0: return below(0x10000);
    case 1: return edges[below(COUNT(edges))];
    default: return below(20);
    }
}

static size_t some_request(uint8_t *pdu)
{
    static const uint8_t functions[] = {1,    2,    3,    4,    5,    6, 0x0F,
                                        0x10, 0x16, 0x17, 0x18, 0x41, 0, 0x83};
    static const unsigned values[] = {0, 0xFF00, 0x100, 0xFF01};
    size_t n = 1;
    unsigned quantity, bytes;

    pdu[0] = functions[below(COUNT(functions))];
    n += put(pdu + n, some_address());
    switch (pdu[0]) {
    case 5: n += put(pdu + n, values[below(COUNT(values))]); break;
    case 0x16:
        n += put(pdu + n, below(0x10000));
        n += put(pdu + n, below(0x10000));
        break;
    case 0x0F:
    case 0x10:
    case 0x17:
        if (pdu[0] == 0x17) {
            n += put(pdu + n, some_quantity());
            n += put(pdu + n, some_address());
        }
        quantity = some_quantity();
        n += put(pdu + n, quantity);
        bytes = pdu[0] == 0x0F ? (quantity + 7) / 8 : 2 * quantity;
        bytes = bytes < 240 ? bytes : 240;
        pdu[n++] = (uint8_t)bytes;
        while (bytes--)
            pdu[n++] = (uint8_t)below(256);
        break;
    default: n += put(pdu + n, pdu[0] == 6 ? below(0x10000) : some_quantity());
    }
    switch (below(24)) {
    case 0: return 1 + below((unsigned)n);
    case 1: pdu[n] = (uint8_t)below(256); return n < 253 ? n + 1 : n;
    case 2: pdu[below((unsigned)n)] = (uint8_t)below(256); return n;
    default: return n;
    }
}

static void prepare(void)
{
    memset(&memory, 0xA5, sizeof memory);
    memset(memory.coils, 0, sizeof memory.coils);
    memset(memory.discrete, 0, sizeof memory.discrete);
    memset(valid, 0xFF, sizeof valid);
    valid[20 / 8] &= (uint8_t) ~(1u << 20 % 8);
    valid[33 / 8] &= (uint8_t) ~(1u << 33 % 8);
    for (unsigned i = 0; i < CELLS; i++) {
        model.words[0][i] = memory.holding[i] = (uint16_t)below(0x10000);
        model.words[1][i] = memory.inputs[i] = (uint16_t)below(0x10000);
        model.bits[0][i] = (uint8_t)below(2);
        model.bits[1][i] = (uint8_t)below(2);
        memory.coils[i / 8] |= (uint8_t)(model.bits[0][i] << i % 8);
        memory.discrete[i / 8] |= (uint8_t)(model.bits[1][i] << i % 8);
    }
    unit.id = UNIT;
    holding.words = memory.holding;
    inputs.words = memory.inputs;
    coils.bits = memory.coils;
    discrete.bits = memory.discrete;
    holding.base = inputs.base = coils.base = discrete.base = BASE;
    holding.size = inputs.size = coils.size = discrete.size = CELLS;
    holding.valid = inputs.valid = coils.valid = discrete.valid = valid;
    OK(mbm_unit_serveHoldingRegisters(&unit, &holding));
    OK(mbm_unit_serveInputRegisters(&unit, &inputs));
    OK(mbm_unit_serveCoils(&unit, &coils));
    OK(mbm_unit_serveDiscreteInputs(&unit, &discrete));
    OK(mbm_registerTable_serveMaskAndReadWrite(&holding));
}

fixture all_tests = {prepare, NULL};

/* The same memory, accessed by callback functions, register by register. */
static mbm_unit called;
static mbm_dataCallbacks callbacks[4];

static uint8_t is_valid(void *context, uint16_t address)
{
    (void)context;
    return (uint8_t)exists(address, 1);
}

static uint16_t get(void *context, uint16_t address)
{
    unsigned i = (unsigned)address - BASE;

    assert_true(exists(address, 1));
    switch ((int)((mbm_dataCallbacks *)context - callbacks) + 1) {
    case 1: return memory.coils[i / 8] >> i % 8 & 1;
    case 2: return memory.discrete[i / 8] >> i % 8 & 1 ? 0x100 : 0;
    case 3: return memory.holding[i];
    default: return memory.inputs[i];
    }
}

static void set(void *context, uint16_t address, uint16_t value)
{
    unsigned i = (unsigned)address - BASE;

    assert_true(exists(address, 1));
    if (context == &callbacks[2]) {
        memory.holding[i] = value;
        return;
    }
    assert_true(context == &callbacks[0] && value <= 1);
    memory.coils[i / 8] &= (uint8_t) ~(1u << i % 8);
    memory.coils[i / 8] |= (uint8_t)(value << i % 8);
}

static void prepare_callbacks(void)
{
    uint8_t i, status = MBM_OK;

    called.id = UNIT;
    for (i = 0; i < 4; i++) {
        callbacks[i].isValid = is_valid;
        callbacks[i].get = get;
        callbacks[i].context = &callbacks[i];
        if (i % 2 == 0)
            callbacks[i].set = set;
        status |= mbm_unit_serveCallbacks(&called, &callbacks[i], (uint8_t)(i + 1));
    }
    IS(MBM_INVALID_ARGUMENT, mbm_unit_serveCallbacks(&called, &callbacks[0], 5));
    OK(status);
}

/* The same memory in several records: two tables of each kind, then callback functions. */
static mbm_unit split;
static mbm_registerTable word_pieces[2][2];
static mbm_bitTable bit_pieces[2][2];
static mbm_dataCallbacks last_pieces[4];

static uint8_t is_in_last_piece(void *context, uint16_t address)
{
    (void)context;
    return address >= BASE + first_of[2] && exists(address, 1);
}

static uint8_t serve_piece(unsigned i)
{
    const unsigned first = first_of[i];
    uint8_t status = MBM_OK;

    for (unsigned kind = 0; kind < 2; kind++) {
        mbm_registerTable *words = &word_pieces[kind][i];
        mbm_bitTable *bits = &bit_pieces[kind][i];

        words->words = (kind == 0 ? memory.holding : memory.inputs) + first;
        bits->bits = (kind == 0 ? memory.coils : memory.discrete) + first / 8;
        words->valid = bits->valid = valid + first / 8;
        words->base = bits->base = (uint16_t)(BASE + first);
        words->size = bits->size = (uint16_t)(first_of[i + 1] - first);
    }
    status |= mbm_unit_serveHoldingRegisters(&split, &word_pieces[0][i]);
    status |= mbm_registerTable_serveMaskAndReadWrite(&word_pieces[0][i]);
    status |= mbm_unit_serveInputRegisters(&split, &word_pieces[1][i]);
    status |= mbm_unit_serveCoils(&split, &bit_pieces[0][i]);
    return status | mbm_unit_serveDiscreteInputs(&split, &bit_pieces[1][i]);
}

static void prepare_pieces(void)
{
    uint8_t i, status = MBM_OK;

    split.id = UNIT;
    for (i = 0; i < 4; i++) {
        callbacks[i].context = &callbacks[i];
        last_pieces[i] = (mbm_dataCallbacks){.isValid = is_in_last_piece, .get = get};
        last_pieces[i].context = &callbacks[i];
        if (i % 2 == 0)
            last_pieces[i].set = set;
    }
    status |= serve_piece(1);
    for (i = 0; i < 4; i++)
        status |= mbm_unit_serveCallbacks(&split, &last_pieces[i], (uint8_t)(i + 1));
    status |= serve_piece(0);
    is_split = 1;
    OK(status);
}

static void end_pieces(void)
{
    is_split = 0;
}

static int untouched(const void *guard, size_t bytes)
{
    const uint8_t *byte = (const uint8_t *)guard;

    while (bytes--)
        if (*byte++ != 0xA5)
            return 0;
    return 1;
}

static void compare_with_model(mbm_unit *asked)
{
    const char *fewer = getenv("MBM_TRANSACTIONS");
    long rounds = fewer ? atol(fewer) : 1000000, round;
    uint8_t packed[2][CELLS / 8];

    for (round = 0; round < rounds; round++) {
        uint8_t pdu[300], expected[300], frame[256];
        uint16_t answered;
        size_t length = some_request(pdu), wanted;
        int damaged = below(16) == 0;

        frame[0] = UNIT;
        memcpy(frame + 1, pdu, length);
        seal(frame, length + 1);
        if (damaged)
            frame[below((unsigned)length + 3)] ^= (uint8_t)(1u << below(8));
        OK(mbm_unit_respond(asked, 1, NULL, FRAMING(MBM_FRAMING_RTU), frame, (uint16_t)(length + 3),
                            sizeof frame, &answered));
        /* A function code from 0x80 on is that of a response. */
        if (damaged || pdu[0] >= 0x80) {
            assert_int_equal(answered, 0);
        } else {
            wanted = expected_response(pdu, length, expected);
            assert_int_equal(answered, wanted + 3);
            assert_memory_equal(frame + 1, expected, wanted);
            assert_int_equal(crc16(frame, answered), 0);
        }
        memset(packed, 0, sizeof packed);
        for (unsigned i = 0; i < CELLS; i++) {
            packed[0][i / 8] |= (uint8_t)(model.bits[0][i] << i % 8);
            packed[1][i / 8] |= (uint8_t)(model.bits[1][i] << i % 8);
        }
        assert_memory_equal(memory.holding, model.words[0], sizeof memory.holding);
        assert_memory_equal(memory.inputs, model.words[1], sizeof memory.inputs);
        assert_memory_equal(memory.coils, packed[0], sizeof packed[0]);
        assert_memory_equal(memory.discrete, packed[1], sizeof packed[1]);
    }
    assert_true(untouched(memory.before, sizeof memory.before));
    assert_true(untouched(memory.between, sizeof memory.between));
    assert_true(untouched(memory.after, sizeof memory.after));
    assert_true(untouched(memory.bits_before, GUARD) && untouched(memory.bits_between, GUARD) &&
                untouched(memory.bits_after, GUARD));
}

TEST(only_valid_writes_change_an_array)
{
    compare_with_model(&unit);
}

TEST_WITH(only_valid_writes_reach_a_callback, prepare_callbacks, NULL)
{
    compare_with_model(&called);
}

TEST_WITH(only_the_record_with_the_cells_changes_them, prepare_pieces, end_pieces)
{
    compare_with_model(&split);
}
