/* Data callbacks: read-only cells, and hooks around them. */
#include "crc.h"
#include "mbm.h"
#include "test.h"
#include "watched.h"

enum { UNIT = 17 };

static mbm_unit unit;
static mbm_dataCallbacks cells;
static mbm_registerTable table;
static mbm_bitTable bits;
static uint16_t words[8], gets, sets;
static uint8_t coils[1];
static uint8_t frame[MBM_MAX_FRAME];
static int connection;

static uint16_t get(void *context, uint16_t address)
{
    gets++;
    return (uint16_t)(0x100 + address);
}

static void set(void *context, uint16_t address, uint16_t value)
{
    sets++;
}

static void reset(void)
{
    memset(&cells, 0, sizeof cells);
    memset(&table, 0, sizeof table);
    memset(&bits, 0, sizeof bits);
    memset(words, 0, sizeof words);
    gets = sets = 0;
    unit = (mbm_unit){.id = UNIT};
    cells.get = get;
    table.words = words;
    table.size = 8;
    bits.bits = coils;
    bits.size = 8;
    watched_reset();
}

fixture each_test = {reset, NULL};

/* Sends a PDU, a string literal without its final zero byte, and expects another. */
#define ANSWERS(pdu, response) answers(pdu, sizeof pdu - 1, response, sizeof response - 1)

static void answers(const char *pdu, size_t length, const char *response, size_t expected)
{
    uint16_t answered;

    frame[0] = UNIT;
    memcpy(frame + 1, pdu, length);
    seal(frame, length + 1);
    OK(mbm_unit_respond(&unit, 1, &connection, FRAMING(MBM_FRAMING_RTU), frame,
                        (uint16_t)(length + 3), sizeof frame, &answered));
    assert_int_equal(answered, expected + 3);
    assert_memory_equal(frame + 1, response, expected);
}

TEST(registers_without_set_are_read_only)
{
    OK(mbm_unit_serveCallbacks(&unit, &cells, 3));
    ANSWERS("\3\0\1\0\2", "\3\4\1\1\1\2");
    gets = 0;
    ANSWERS("\6\0\1\0\2", "\x86\1");
    ANSWERS("\x10\0\1\0\1\2\0\1", "\x90\1");
    ANSWERS("\x16\0\1\0\1\0\1", "\x96\1");
    ANSWERS("\x17\0\1\0\1\0\1\0\1\2\0\1", "\x97\1");
    assert_int_equal(gets, 0);
}

TEST(coils_without_set_are_read_only)
{
    OK(mbm_unit_serveCallbacks(&unit, &cells, 1));
    ANSWERS("\1\0\1\0\3", "\1\1\7");
    gets = 0;
    ANSWERS("\5\0\1\xFF\0", "\x85\1");
    ANSWERS("\xF\0\1\0\1\1\1", "\x8F\1");
    assert_int_equal(gets, 0);
}

TEST(a_later_record_takes_the_writes_of_read_only_cells)
{
    OK(mbm_unit_serveCallbacks(&unit, &cells, 3));
    OK(mbm_unit_serveHoldingRegisters(&unit, &table));
    OK(mbm_registerTable_serveMaskAndReadWrite(&table));
    ANSWERS("\6\0\1\0\2", "\6\0\1\0\2");
    ANSWERS("\x16\0\1\0\xFF\1\0", "\x16\0\1\0\xFF\1\0");
    ANSWERS("\3\0\1\0\1", "\3\2\1\1");
    assert_int_equal(words[1], 0x102);
}

TEST(cells_that_get_a_set_can_be_written_from_then_on)
{
    OK(mbm_unit_serveCallbacks(&unit, &cells, 3));
    ANSWERS("\6\0\1\0\2", "\x86\1");
    cells.set = set;
    ANSWERS("\6\0\1\0\2", "\6\0\1\0\2");
    assert_int_equal(sets, 1);
}

TEST(hooks_of_callbacks_are_called_with_the_arguments)
{
    cells.set = set;
    OK(mbm_unit_serveCallbacks(&unit, &cells, 3));
    OK(mbm_dataCallbacks_setHooks(&cells, &watching.hooks));
    ANSWERS("\3\0\1\0\2", "\3\4\1\1\1\2");
    ANSWERS("\6\0\1\0\2", "\6\0\1\0\2");
    ANSWERS("\x10\0\1\0\2\4\0\1\0\2", "\x10\0\1\0\2");
    watched_were("r17/03 1+2;w17/06 1+1 0002;a17/06 1+1 0002;"
                 "w17/10 1+2 00010002;a17/10 1+2 00010002;");
    assert_ptr_equal(watching.connection, &connection);
    ANSWERS("\x16\0\1\0\xFF\1\0", "\x16\0\1\0\xFF\1\0");
    watched_were("r17/16 1+1;w17/16 1+1 0101;a17/16 1+1 0101;");
    ANSWERS("\x17\0\1\0\1\0\2\0\1\2\0\1", "\x17\2\1\1");
    watched_were("r17/17 1+1;w17/17 2+1 0001;a17/17 2+1 0001;");
    sets = gets = 0;
    watching.refuse_read = 6;
    ANSWERS("\3\0\1\0\2", "\x83\6");
    ANSWERS("\x16\0\1\0\xFF\1\0", "\x96\6");
    ANSWERS("\x17\0\1\0\1\0\2\0\1\2\0\1", "\x97\6");
    watching.refuse_read = 0;
    watching.refuse_write = 4;
    ANSWERS("\6\0\1\0\2", "\x86\4");
    ANSWERS("\x17\0\1\0\1\0\2\0\1\2\0\1", "\x97\4");
    assert_int_equal(gets + sets, 0);
}

TEST(hooks_of_bits_see_one_bit_for_each_cell)
{
    cells.set = set;
    OK(mbm_unit_serveCallbacks(&unit, &cells, 1));
    OK(mbm_dataCallbacks_setHooks(&cells, &watching.hooks));
    ANSWERS("\xF\0\1\0\xA\2\x55\1", "\xF\0\1\0\xA");
    ANSWERS("\1\0\1\0\3", "\1\1\7");
    watched_were("w17/0F 1+10 5501;a17/0F 1+10 5501;r17/01 1+3;");
}

/* Sets and removes the hooks of each kind of record. */
TEST(hooks_are_set_before_or_after_registering_and_removed)
{
    static mbm_files files;
    static mbm_file file;

    file.records = words;
    file.size = 8;
    file.number = 1;
    files = (mbm_files){.files = &file, .count = 1};
    OK(mbm_registerTable_setHooks(&table, &watching.hooks));
    OK(mbm_unit_serveHoldingRegisters(&unit, &table));
    OK(mbm_unit_serveCoils(&unit, &bits));
    OK(mbm_bitTable_setHooks(&bits, &watching.hooks));
    OK(mbm_dataCallbacks_setHooks(&cells, &watching.hooks));
    OK(mbm_unit_serveCallbacks(&unit, &cells, 4));
    OK(mbm_unit_serveFiles(&unit, &files));
    OK(mbm_files_setHooks(&files, &watching.hooks));
    ANSWERS("\3\0\0\0\1", "\3\2\0\0");
    ANSWERS("\1\0\0\0\1", "\1\1\0");
    ANSWERS("\4\0\0\0\1", "\4\2\1\0");
    ANSWERS("\x14\7\6\0\1\0\0\0\1", "\x14\4\3\6\0\0");
    watched_were("r17/03 0+1;r17/01 0+1;r17/04 0+1;r17/14 1:0+1;");
    /* The hooks stay when a record is registered again. */
    OK(mbm_unit_serveHoldingRegisters(&unit, &table));
    ANSWERS("\3\0\0\0\1", "\3\2\0\0");
    watched_were("r17/03 0+1;");
    OK(mbm_registerTable_setHooks(&table, NULL));
    OK(mbm_bitTable_setHooks(&bits, NULL));
    OK(mbm_dataCallbacks_setHooks(&cells, NULL));
    OK(mbm_files_setHooks(&files, NULL));
    ANSWERS("\3\0\0\0\1", "\3\2\0\0");
    ANSWERS("\1\0\0\0\1", "\1\1\0");
    ANSWERS("\4\0\0\0\1", "\4\2\1\0");
    ANSWERS("\x14\7\6\0\1\0\0\0\1", "\x14\4\3\6\0\0");
    watched_were("");
    IS(MBM_INVALID_ARGUMENT, mbm_registerTable_setHooks(NULL, &watching.hooks));
    IS(MBM_INVALID_ARGUMENT, mbm_bitTable_setHooks(NULL, &watching.hooks));
    IS(MBM_INVALID_ARGUMENT, mbm_dataCallbacks_setHooks(NULL, &watching.hooks));
    IS(MBM_INVALID_ARGUMENT, mbm_files_setHooks(NULL, &watching.hooks));
}

TEST(hooks_that_are_all_null_change_nothing)
{
    static const mbm_accessHooks none;

    OK(mbm_registerTable_setHooks(&table, &none));
    OK(mbm_unit_serveHoldingRegisters(&unit, &table));
    OK(mbm_registerTable_serveMaskAndReadWrite(&table));
    ANSWERS("\6\0\1\0\2", "\6\0\1\0\2");
    ANSWERS("\x16\0\1\0\xFF\1\0", "\x16\0\1\0\xFF\1\0");
    ANSWERS("\x17\0\1\0\1\0\2\0\1\2\0\1", "\x17\2\1\2");
    ANSWERS("\3\0\1\0\2", "\3\4\1\2\0\1");
}

/* A hook removes the hooks of its table, or gives it others. */
static mbm_accessHooks others;

static void remove_hooks(char hook, const mbm_access *access)
{
    OK(mbm_registerTable_setHooks(&table, &others));
    OK(mbm_registerTable_setHooks(&table, NULL));
}

TEST(a_hook_that_removes_the_hooks_is_the_last_for_its_request)
{
    OK(mbm_unit_serveHoldingRegisters(&unit, &table));
    OK(mbm_registerTable_setHooks(&table, &watching.hooks));
    watching.within = remove_hooks;
    ANSWERS("\6\0\1\0\2", "\6\0\1\0\2");
    watched_were("w17/06 1+1 0002;a17/06 1+1 0002;");
    ANSWERS("\6\0\1\0\2", "\6\0\1\0\2");
    watched_were("");
    OK(mbm_registerTable_serveMaskAndReadWrite(&table));
    OK(mbm_registerTable_setHooks(&table, &watching.hooks));
    ANSWERS("\x16\0\1\0\xFF\1\0", "\x16\0\1\0\xFF\1\0");
    watched_were("r17/16 1+1;w17/16 1+1 0102;a17/16 1+1 0102;");
    OK(mbm_registerTable_setHooks(&table, &watching.hooks));
    ANSWERS("\x17\0\1\0\1\0\2\0\1\2\0\1", "\x17\2\1\2");
    watched_were("r17/17 1+1;w17/17 2+1 0001;a17/17 2+1 0001;");
    ANSWERS("\x17\0\1\0\1\0\2\0\1\2\0\1", "\x17\2\1\2");
    watched_were("");
}

TEST(a_response_that_does_not_fit_calls_no_hook)
{
    uint8_t small[12] = {UNIT, 3, 0, 0, 0, 8};
    uint16_t answered;

    OK(mbm_unit_serveHoldingRegisters(&unit, &table));
    OK(mbm_registerTable_setHooks(&table, &watching.hooks));
    seal(small, 6);
    OK(mbm_unit_respond(&unit, 1, NULL, FRAMING(MBM_FRAMING_RTU), small, 8, sizeof small,
                        &answered));
    assert_memory_equal(small, "\x11\x83\4", 3);
    watched_were("");
}
