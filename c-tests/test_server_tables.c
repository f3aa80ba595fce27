/* Several records of one kind on one unit: each serves its own cells, files or queues, and leaves
 * a request for others to the records after it. */
#include "crc.h"
#include "mbm.h"
#include "test.h"

enum { UNIT = 17, CATCH_ALL = 0 };

static mbm_unit unit;
static uint16_t low[4], high[4];
static mbm_registerTable low_table, high_table;
static mbm_diagnostics diagnostics;
static mbm_custom custom;
static uint16_t custom_result;
static unsigned custom_calls, reads[2];
static uint8_t response[MBM_MAX_FRAME];

static void fill(mbm_registerTable *table, uint16_t *words, uint16_t base)
{
    memset(table, 0, sizeof *table);
    for (unsigned i = 0; i < 4; i++)
        words[i] = (uint16_t)(base + i);
    table->words = words;
    table->base = base;
    table->size = 4;
}

/* Registers 100 to 103 and 200 to 203. */
static void reset(void)
{
    memset(&diagnostics, 0, sizeof diagnostics);
    memset(&custom, 0, sizeof custom);
    unit = (mbm_unit){.id = UNIT};
    custom_calls = reads[0] = reads[1] = 0;
    fill(&low_table, low, 100);
    fill(&high_table, high, 200);
}

fixture each_test = {reset, NULL};

static void serve_both(void)
{
    OK(mbm_unit_serveHoldingRegisters(&unit, &low_table));
    OK(mbm_unit_serveHoldingRegisters(&unit, &high_table));
}

/* Lets the unit serve a PDU. Returns the length of the PDU of the response, which is in
 * `response`. */
static unsigned ask_unit(uint8_t id, const char *pdu, size_t length)
{
    uint8_t frame[MBM_MAX_FRAME];
    uint16_t count;

    frame[0] = id;
    memcpy(frame + 1, pdu, length);
    length = seal(frame, length + 1);
    OK(mbm_unit_respond(&unit, 1, NULL, FRAMING(MBM_FRAMING_RTU), frame, (uint16_t)length,
                        sizeof frame, &count));
    if (count == 0)
        return 0;
    memcpy(response, frame + 1, count - 3u);
    return count - 3u;
}

#define ASK(pdu) ask_unit(UNIT, pdu, sizeof pdu - 1)
#define IS_ANSWERED(pdu, expected)                                                                 \
    do {                                                                                           \
        assert_int_equal(ASK(pdu), sizeof expected - 1);                                           \
        assert_memory_equal(response, expected, sizeof expected - 1);                              \
    } while (0)

TEST(a_register_of_either_table_is_read_and_written)
{
    serve_both();
    IS_ANSWERED("\x03\0\144\0\4", "\x03\x08\0\144\0\145\0\146\0\147");
    IS_ANSWERED("\x03\0\310\0\1", "\x03\x02\0\310");
    IS_ANSWERED("\x06\0\145\x12\x34", "\x06\0\145\x12\x34");
    IS_ANSWERED("\x06\0\311\x56\x78", "\x06\0\311\x56\x78");
    IS_ANSWERED("\x10\0\312\0\1\2\x9A\xBC", "\x10\0\312\0\1");
    assert_int_equal(low[1], 0x1234);
    assert_int_equal(high[1], 0x5678);
    assert_int_equal(high[2], 0x9ABC);
}

TEST(cells_that_no_table_has_are_answered_with_exception_02)
{
    serve_both();
    IS_ANSWERED("\x03\0\150\0\1", "\x83\2");
    IS_ANSWERED("\x06\0\1\0\1", "\x86\2");
    IS_ANSWERED("\x04\0\144\0\1", "\x84\1");
    IS_ANSWERED("\x03\0\144\0\0", "\x83\3");
}

/* The tables need not have gaps between them. */
TEST(a_request_that_needs_two_tables_is_answered_with_exception_02)
{
    fill(&high_table, high, 104);
    serve_both();
    IS_ANSWERED("\x03\0\146\0\2", "\x03\x04\0\146\0\147");
    IS_ANSWERED("\x03\0\150\0\2", "\x03\x04\0\150\0\151");
    IS_ANSWERED("\x03\0\147\0\2", "\x83\2");
    IS_ANSWERED("\x10\0\147\0\2\4\1\1\1\1", "\x90\2");
    assert_int_equal(low[3], 103);
    assert_int_equal(high[0], 104);
}

TEST(the_first_of_two_tables_with_the_same_cell_answers)
{
    fill(&high_table, high, 102);
    high[0] = 9999;
    serve_both();
    IS_ANSWERED("\x03\0\146\0\1", "\x03\x02\0\146");
    IS_ANSWERED("\x03\0\150\0\1", "\x03\x02\0\150");
    /* Only the second one has all of these. */
    IS_ANSWERED("\x03\0\146\0\4", "\x03\x08\x27\x0F\0\147\0\150\0\151");
}

TEST(functions_16_and_17_find_the_table_of_their_registers)
{
    serve_both();
    OK(mbm_registerTable_serveMaskAndReadWrite(&low_table));
    OK(mbm_registerTable_serveMaskAndReadWrite(&high_table));
    IS_ANSWERED("\x16\0\310\0\0\0\7", "\x16\0\310\0\0\0\7");
    assert_int_equal(high[0], 7);
    IS_ANSWERED("\x17\0\310\0\1\0\311\0\1\2\0\5", "\x17\2\0\7");
    assert_int_equal(high[1], 5);
    /* It reads one table and writes the other: no table has all of these registers. */
    IS_ANSWERED("\x17\0\144\0\1\0\311\0\1\2\0\6", "\x97\2");
    assert_int_equal(high[1], 5);
    IS_ANSWERED("\x16\0\1\0\0\0\7", "\x96\2");
}

static uint8_t count_read(void *context, const mbm_access *access)
{
    assert_int_equal(access->quantity, 1);
    ++*(unsigned *)context;
    return 2;
}

/* A hook that refuses a read with exception 02 decides for the whole request. */
TEST(only_the_table_with_the_cells_calls_its_hooks)
{
    static const mbm_accessHooks of_low = {.context = &reads[0], .beforeRead = count_read};
    static const mbm_accessHooks of_high = {.context = &reads[1], .beforeRead = count_read};

    fill(&high_table, high, 100);
    serve_both();
    OK(mbm_registerTable_setHooks(&low_table, &of_low));
    IS_ANSWERED("\x03\0\144\0\1", "\x83\2");
    high_table.base = 200;
    OK(mbm_registerTable_setHooks(&high_table, &of_high));
    IS_ANSWERED("\x03\0\310\0\1", "\x83\2");
    assert_int_equal(reads[0] * 10 + reads[1], 11);
}

static uint16_t get(void *context, uint16_t address)
{
    return address;
}

static uint8_t is_valid(void *context, uint16_t address)
{
    return address >= 300;
}

TEST(a_table_and_callbacks_serve_one_kind_side_by_side)
{
    static mbm_dataCallbacks cells;

    cells = (mbm_dataCallbacks){.get = get, .isValid = is_valid};
    OK(mbm_unit_serveHoldingRegisters(&unit, &low_table));
    OK(mbm_unit_serveCallbacks(&unit, &cells, 3));
    OK(mbm_unit_serveHoldingRegisters(&unit, &high_table));
    IS_ANSWERED("\x03\0\144\0\1", "\x03\x02\0\144");
    IS_ANSWERED("\x03\1\54\0\1", "\x03\x02\1\54");
    IS_ANSWERED("\x03\0\310\0\1", "\x03\x02\0\310");
    IS_ANSWERED("\x03\0\1\0\1", "\x83\2");
}

TEST(bits_of_several_tables_are_read_and_written)
{
    static uint8_t bits[2];
    static mbm_bitTable coils[2];

    memset(coils, 0, sizeof coils);
    for (unsigned i = 0; i < 2; i++) {
        bits[i] = 0;
        coils[i].bits = &bits[i];
        coils[i].base = (uint16_t)(100 * i);
        coils[i].size = 8;
        OK(mbm_unit_serveCoils(&unit, &coils[i]));
    }
    IS_ANSWERED("\x05\0\145\xFF\0", "\x05\0\145\xFF\0");
    assert_int_equal(bits[1], 2);
    IS_ANSWERED("\x01\0\144\0\3", "\x01\1\2");
    IS_ANSWERED("\x01\0\7\0\2", "\x81\2");
}

static uint16_t answer_custom(void *context, const mbm_request *request, uint8_t *out,
                              uint16_t capacity)
{
    custom_calls++;
    out[0] = 0x5A;
    return custom_result;
}

static void serve_custom(uint8_t code)
{
    custom.serve = answer_custom;
    custom.code = code;
    OK(mbm_unit_serveCustom(&unit, &custom));
}

/* The unit serves function 03; it only lacks the registers. */
TEST(a_function_for_all_others_is_not_called_for_cells_that_tables_lack)
{
    custom_result = 1;
    OK(mbm_unit_serveHoldingRegisters(&unit, &low_table));
    serve_custom(CATCH_ALL);
    IS_ANSWERED("\x03\0\1\0\1", "\x83\2");
    assert_int_equal(custom_calls, 0);
    IS_ANSWERED("\x04\0\1\0\1", "\x04\x5A");
    /* The next request is another one. */
    OK(mbm_unit_serveHoldingRegisters(&unit, &high_table));
    IS_ANSWERED("\x03\0\310\0\1", "\x03\x02\0\310");
    IS_ANSWERED("\x04\0\1\0\1", "\x04\x5A");
}

TEST(a_function_after_a_table_answers_for_the_cells_that_it_lacks)
{
    OK(mbm_unit_serveHoldingRegisters(&unit, &low_table));
    serve_custom(3);
    custom_result = 1;
    IS_ANSWERED("\x03\0\144\0\1", "\x03\x02\0\144");
    assert_int_equal(custom_calls, 0);
    IS_ANSWERED("\x03\0\1\0\1", "\x03\x5A");
    custom_result = MBM_REPLY_EXCEPTION | 6;
    IS_ANSWERED("\x03\0\1\0\1", "\x83\6");
    custom_result = MBM_REPLY_DECLINED;
    IS_ANSWERED("\x03\0\1\0\1", "\x83\2");
}

/* One that is registered first decides for all cells. */
TEST(exception_02_of_a_function_before_the_tables_is_final)
{
    serve_custom(3);
    serve_both();
    custom_result = MBM_REPLY_EXCEPTION | 2;
    IS_ANSWERED("\x03\0\144\0\1", "\x83\2");
    custom_result = MBM_REPLY_DECLINED;
    IS_ANSWERED("\x03\0\310\0\1", "\x03\x02\0\310");
}

TEST(a_unit_with_diagnostics_counts_a_request_once)
{
    OK(mbm_unit_serveDiagnostics(&unit, &diagnostics));
    serve_both();
    IS_ANSWERED("\x03\0\310\0\1", "\x03\x02\0\310");
    assert_int_equal(diagnostics.exceptionErrors, 0);
    IS_ANSWERED("\x03\0\1\0\1", "\x83\2");
    assert_int_equal(diagnostics.exceptionErrors, 1);
    assert_int_equal(diagnostics.serverMessages, 2);
    assert_int_equal(diagnostics.events, 1);
}

TEST(a_broadcast_reaches_the_table_that_has_the_cells)
{
    serve_both();
    assert_int_equal(ask_unit(0, "\x06\0\311\x56\x78", 5), 0);
    assert_int_equal(high[1], 0x5678);
    assert_int_equal(ask_unit(0, "\x06\0\1\x56\x78", 5), 0);
}

TEST(files_of_several_records_are_read_and_written)
{
    static const mbm_file files[2] = {{low, 4, 1}, {high, 4, 2}};
    static mbm_files records[2];

    memset(records, 0, sizeof records);
    for (unsigned i = 0; i < 2; i++) {
        records[i].files = &files[i];
        records[i].count = 1;
        OK(mbm_unit_serveFiles(&unit, &records[i]));
    }
    IS_ANSWERED("\x14\7\6\0\2\0\1\0\1", "\x14\4\3\6\0\311");
    IS_ANSWERED("\x14\7\6\0\3\0\1\0\1", "\x94\2");
    IS_ANSWERED("\x15\x09\6\0\2\0\1\0\1\x12\x34", "\x15\x09\6\0\2\0\1\0\1\x12\x34");
    assert_int_equal(high[1], 0x1234);
}

TEST(queues_of_several_records_are_read)
{
    static const mbm_fifo fifos[2] = {{low, 50, 1}, {high, 60, 2}};
    static mbm_fifos records[2];

    memset(records, 0, sizeof records);
    for (unsigned i = 0; i < 2; i++) {
        records[i].fifos = &fifos[i];
        records[i].count = 1;
        OK(mbm_unit_serveFifos(&unit, &records[i]));
    }
    IS_ANSWERED("\x18\0\74", "\x18\0\6\0\2\0\310\0\311");
    IS_ANSWERED("\x18\0\1", "\x98\2");
}
