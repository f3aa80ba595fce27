/* Hooks that change their own table while a request is carried out. The request goes on with the
 * table as it was. */
#include "answer.h"

/* The table is on the heap, so that the sanitizer finds an access beyond its end. */
static mbm_registerTable *table;
static mbm_unit unit;
static uint16_t words[4];
static uint16_t fewer[1];

static uint8_t zero_before(void *context, const mbm_access *access)
{
    memset(table, 0, sizeof *table);
    return 0;
}

static uint8_t shrink_before(void *context, const mbm_access *access)
{
    zero_before(context, access);
    table->words = fewer;
    table->size = 1;
    OK(mbm_unit_serveHoldingRegisters(&unit, table));
    return 0;
}

static void shrink_after(void *context, const mbm_access *access)
{
    shrink_before(context, access);
}

static uint8_t become_bits(void *context, const mbm_access *access)
{
    static uint8_t bit[1];
    mbm_bitTable *bits = (mbm_bitTable *)(void *)table;

    zero_before(context, access);
    bits->bits = bit;
    bits->size = 8;
    OK(mbm_unit_serveCoils(&unit, bits));
    return 0;
}

/* Serves four registers with these hooks, from new. */
static void serve(const mbm_accessHooks *hooks)
{
    memset(&unit, 0, sizeof unit);
    unit.id = 17;
    memset(table, 0, sizeof *table);
    table->words = words;
    table->size = 4;
    words[3] = 0x00F0;
    OK(mbm_registerTable_setHooks(table, hooks));
    OK(mbm_unit_serveHoldingRegisters(&unit, table));
    OK(mbm_registerTable_serveMaskAndReadWrite(table));
}

TEST(a_write_goes_on_with_the_old_table_if_its_hook_changes_it)
{
    static const mbm_accessHooks hooks[] = {
        {.beforeWrite = zero_before},
        {.beforeWrite = shrink_before},
        {.beforeWrite = become_bits},
    };

    for (int i = 0; i < 3; i++) {
        serve(&hooks[i]);
        assert_int_equal(answer(&unit, 17, "\x10\0\0\0\4\x08\0\1\0\2\0\3\0\4", 14), 0x10);
        assert_int_equal(words[3], 4);
        assert_int_equal(fewer[0], 0);
    }
}

TEST(function_17_reads_from_the_old_table_if_the_hook_after_its_write_changes_it)
{
    static const mbm_accessHooks hooks = {.afterWrite = shrink_after};

    serve(&hooks);
    assert_int_equal(answer(&unit, 17, "\x17\0\0\0\4\0\0\0\1\2\0\1", 12), 0x17);
}

/* Each function that reads, with a hook before the read. */
TEST(a_read_goes_on_with_the_old_table_if_its_hook_changes_it)
{
    static const mbm_accessHooks hooks[] = {
        {.beforeRead = zero_before},
        {.beforeRead = shrink_before},
        {.beforeRead = become_bits},
    };
    static const struct {
        const char *pdu;
        size_t length;
        uint16_t last; /* the last register afterwards */
    } requests[] = {
        {"\3\0\0\0\4", 5, 0x00F0},
        {"\x16\0\3\0\xFF\x0F\0", 7, 0x0FF0},
        {"\x17\0\0\0\4\0\3\0\1\2\x0F\xF0", 12, 0x0FF0},
    };

    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) {
            serve(&hooks[j]);
            assert_int_equal(answer(&unit, 17, requests[i].pdu, requests[i].length),
                             requests[i].pdu[0]);
            assert_int_equal(words[3], requests[i].last);
            assert_int_equal(fewer[0], 0);
        }
}

static void make_table(void)
{
    table = (mbm_registerTable *)malloc(sizeof *table);
    assert_non_null(table);
}

static void free_table(void)
{
    free(table);
}

fixture all_tests = {make_table, free_table};
