/* Records that are given to a mbm_server_serve function a second time: for the same unit,
 * zeroed before or not, and for another unit; and tables that their hooks change. */
#include "crc.h"
#include "mbm.h"
#include "test.h"

/* Lets a unit serve a PDU in an RTU frame to the unit `id`. Returns the function code of the
 * response, or 0 if there is none. */
static unsigned answer(mbm_unit *unit, uint8_t id, const char *pdu, size_t length)
{
    uint8_t frame[MBM_MAX_FRAME];
    uint16_t response = 0xFFFF;

    frame[0] = id;
    memcpy(frame + 1, pdu, length);
    length = seal(frame, length + 1);
    OK(mbm_unit_respond(unit, 1, NULL, FRAMING(MBM_FRAMING_RTU), frame, (uint16_t)length,
                        sizeof frame, &response));
    assert_int_not_equal(response, 0xFFFF);
    return response == 0 ? 0 : frame[1];
}

enum { FAMILIES = 11 };

/* One record of every family, with the data that it needs. */
typedef struct {
    mbm_bitTable coils, discrete;
    mbm_registerTable holding, inputs;
    mbm_exceptionStatus status;
    mbm_diagnostics diagnostics;
    mbm_serverId id;
    mbm_files files;
    mbm_fifos fifos;
    mbm_serverIdentification identification;
    mbm_custom custom;
    mbm_dataCallbacks cells;
    mbm_functionMask switches;
} records;

static records first;
static mbm_unit units[2];

static uint8_t bits[2] = {0x55, 0x55};
static uint16_t words[4] = {0x1234, 2, 3, 4};
static const mbm_file files[] = {{words, 4, 1}};
static const mbm_fifo fifos[] = {{words, 0, 2}};
static const mbm_object objects[] = {{(const uint8_t *)"a", 1, 0}};

static uint16_t echo(void *context, const mbm_request *request, uint8_t *response,
                     uint16_t capacity)
{
    memcpy(response, request->data, request->length);
    return request->length;
}

static uint16_t get(void *context, uint16_t address)
{
    return address;
}

/* Fills the record of one family anew and registers it. */
static uint8_t serve(mbm_unit *unit, records *r, int family)
{
    switch (family) {
    case 0:
        r->coils.bits = bits;
        r->coils.size = 16;
        return mbm_unit_serveCoils(unit, &r->coils);
    case 1:
        r->discrete.bits = bits;
        r->discrete.size = 16;
        return mbm_unit_serveDiscreteInputs(unit, &r->discrete);
    case 2:
        r->holding.words = words;
        r->holding.size = 4;
        return mbm_unit_serveHoldingRegisters(unit, &r->holding);
    case 3: r->cells.get = get; return mbm_unit_serveCallbacks(unit, &r->cells, 4);
    case 4: return mbm_unit_serveExceptionStatus(unit, &r->status);
    case 5: return mbm_unit_serveDiagnostics(unit, &r->diagnostics);
    case 6:
        r->id.id = (const uint8_t *)"x";
        r->id.idLength = 1;
        return mbm_unit_serveServerId(unit, &r->id);
    case 7:
        r->files.files = files;
        r->files.count = 1;
        return mbm_unit_serveFiles(unit, &r->files);
    case 8:
        r->fifos.fifos = fifos;
        r->fifos.count = 1;
        return mbm_unit_serveFifos(unit, &r->fifos);
    case 9:
        r->identification.objects = objects;
        r->identification.count = 1;
        return mbm_unit_serveIdentification(unit, &r->identification);
    default:
        r->custom.serve = echo;
        r->custom.code = 65;
        return mbm_unit_serveCustom(unit, &r->custom);
    }
}

static void zero(records *r, int family)
{
    void *record[FAMILIES] = {&r->coils,  &r->discrete,       &r->holding, &r->cells,
                              &r->status, &r->diagnostics,    &r->id,      &r->files,
                              &r->fifos,  &r->identification, &r->custom};
    const size_t size[FAMILIES] = {
        sizeof r->coils,  sizeof r->discrete,       sizeof r->holding, sizeof r->cells,
        sizeof r->status, sizeof r->diagnostics,    sizeof r->id,      sizeof r->files,
        sizeof r->fifos,  sizeof r->identification, sizeof r->custom};

    memset(record[family], 0, size[family]);
}

/* A request to each family that gets a response without an exception. */
static const struct {
    const char *pdu;
    size_t length;
} requests[FAMILIES] = {
    {"\x01\0\0\0\1", 5}, {"\x02\0\0\0\1", 5}, {"\x03\0\0\0\1", 5}, {"\x04\0\0\0\1", 5},
    {"\x07", 1},         {"\x08\0\0\1\2", 5}, {"\x11", 1},         {"\x14\7\6\0\1\0\0\0\1", 9},
    {"\x18\0\0", 3},     {"\x2B\x0E\1\0", 4}, {"\x41\1", 2},
};

static unsigned answered(mbm_unit *unit, int family)
{
    return answer(unit, (uint8_t)unit->id, requests[family].pdu, requests[family].length);
}

static unsigned function(int family)
{
    return (uint8_t)requests[family].pdu[0];
}

static void all_are_answered(mbm_unit *unit)
{
    for (int i = 0; i < FAMILIES; i++)
        assert_int_equal(answered(unit, i), function(i));
}

static void reset(void)
{
    memset(&first, 0, sizeof first);
    memset(units, 0, sizeof units);
    units[0].id = 17;
    units[1].id = 18;
    words[0] = 0x1234;
    for (int i = 0; i < FAMILIES; i++)
        OK(serve(&units[0], &first, i));
    all_are_answered(&units[0]);
}

fixture each_test = {reset, NULL};

TEST(a_record_that_is_served_again_leaves_the_others_served)
{
    for (int i = 0; i < FAMILIES; i++) {
        OK(serve(&units[0], &first, i));
        all_are_answered(&units[0]);
    }
}

TEST(a_record_that_is_zeroed_and_served_again_leaves_the_others_served)
{
    for (int i = 0; i < FAMILIES; i++) {
        zero(&first, i);
        OK(serve(&units[0], &first, i));
        all_are_answered(&units[0]);
    }
}

TEST(a_record_that_is_zeroed_serves_nothing_and_the_others_go_on)
{
    for (int i = 0; i < FAMILIES; i++) {
        zero(&first, i);
        for (int other = 0; other < FAMILIES; other++)
            assert_int_equal(answered(&units[0], other),
                             other == i ? function(i) | 0x80 : function(other));
        OK(serve(&units[0], &first, i));
    }
}

TEST(all_records_may_be_zeroed_and_served_again)
{
    for (int i = 0; i < FAMILIES; i++)
        zero(&first, i);
    for (int i = 0; i < FAMILIES; i++)
        assert_int_equal(answered(&units[0], i), function(i) | 0x80);
    for (int i = FAMILIES; i-- > 0;)
        OK(serve(&units[0], &first, i));
    all_are_answered(&units[0]);
}

TEST(one_record_serves_two_units)
{
    static records own;

    memset(&own, 0, sizeof own);
    /* The second unit has a record of its own first, then the records of the first unit. */
    OK(serve(&units[1], &own, 10));
    for (int i = 0; i < FAMILIES - 1; i++) {
        OK(serve(&units[1], &first, i));
        all_are_answered(&units[0]);
        assert_int_equal(answered(&units[1], i), function(i));
        assert_int_equal(answered(&units[1], 10), function(10));
    }
    all_are_answered(&units[1]);
    /* A write through one unit is seen through the other. */
    assert_int_equal(answer(&units[1], 18, "\x06\0\0\x56\x78", 5), 6);
    assert_int_equal(words[0], 0x5678);
    zero(&first, 2);
    OK(serve(&units[0], &first, 2));
    all_are_answered(&units[0]);
    all_are_answered(&units[1]);
}

TEST(functions_16_and_17_stay_when_another_unit_is_given_the_table)
{
    OK(mbm_registerTable_serveMaskAndReadWrite(&first.holding));
    OK(serve(&units[1], &first, 2));
    assert_int_equal(answer(&units[0], 17, "\x16\0\0\xFF\xFF\0\0", 7), 0x16);
    assert_int_equal(answer(&units[1], 18, "\x16\0\0\xFF\xFF\0\0", 7), 0x16);
}

/* A table of another kind would answer other functions, on every unit that has it. */
TEST(a_table_that_is_served_as_one_kind_is_refused_as_another)
{
    records before;

    memcpy(&before, &first, sizeof first);
    IS(MBM_BUSY, mbm_unit_serveInputRegisters(&units[0], &first.holding));
    IS(MBM_BUSY, mbm_unit_serveInputRegisters(&units[1], &first.holding));
    IS(MBM_BUSY, mbm_unit_serveDiscreteInputs(&units[1], &first.coils));
    IS(MBM_BUSY, mbm_unit_serveCoils(&units[1], &first.discrete));
    IS(MBM_BUSY, mbm_unit_serveCallbacks(&units[1], &first.cells, 2));
    assert_memory_equal(&before, &first, sizeof first);
    all_are_answered(&units[0]);
    assert_int_equal(answered(&units[1], 3), 0);
    /* A zeroed record can be registered as any kind. */
    zero(&first, 2);
    first.holding.words = words;
    first.holding.size = 4;
    OK(mbm_unit_serveInputRegisters(&units[1], &first.holding));
    assert_int_equal(answered(&units[1], 3), 4);
}

/* A unit would call only the first of two. */
TEST(a_second_record_of_a_kind_that_a_unit_has_once_is_refused)
{
    static records second;
    static const int once[] = {4, 5, 6, 9};
    mbm_unit before = units[0];

    for (size_t i = 0; i < COUNT(once); i++) {
        memset(&second, 0, sizeof second);
        IS(MBM_BUSY, serve(&units[0], &second, once[i]));
        assert_int_equal(second.status.service.kind | second.diagnostics.service.kind |
                             second.id.service.kind | second.identification.service.kind,
                         0);
        assert_memory_equal(&before, &units[0], sizeof before);
        all_are_answered(&units[0]);
        /* Another unit may serve it. */
        OK(serve(&units[1], &second, once[i]));
        memset(&units[1], 0, sizeof units[1]);
        units[1].id = 18;
    }
    /* So may this one, instead of the first. */
    zero(&first, 6);
    memset(&second, 0, sizeof second);
    OK(serve(&units[0], &second, 6));
    all_are_answered(&units[0]);
}

TEST(a_service_without_a_free_place_is_refused)
{
    static mbm_custom more[MBM_MAX_SERVICES];
    mbm_unit before;
    int i, served = FAMILIES;

    memset(more, 0, sizeof more);
    for (i = 0; i < MBM_MAX_SERVICES; i++) {
        more[i].serve = echo;
        more[i].code = (uint8_t)(66 + i);
    }
    for (i = 0; served < MBM_MAX_SERVICES; i++, served++)
        OK(mbm_unit_serveCustom(&units[0], &more[i]));
    memcpy(&before, &units[0], sizeof before);
    IS(MBM_BUFFER_TOO_SMALL, mbm_unit_serveCustom(&units[0], &more[i]));
    IS(MBM_BUFFER_TOO_SMALL, mbm_unit_switchFunction(&units[0], &first.switches, 3, 0));
    assert_int_equal(first.switches.off[0], 0);
    assert_memory_equal(&before, &units[0], sizeof before);
    assert_int_equal(answer(&units[0], 17, "\x50", 1), 0x50 | 0x80);
    /* Records that are registered already can still be registered again. */
    for (i = 0; i < FAMILIES; i++) {
        zero(&first, i);
        OK(serve(&units[0], &first, i));
    }
    all_are_answered(&units[0]);
}

static mbm_diagnostics late;

static uint16_t give_diagnostics(void *context, const mbm_request *request, uint8_t *response,
                                 uint16_t capacity)
{
    OK(mbm_unit_serveDiagnostics((mbm_unit *)context, &late));
    return 0;
}

/* It takes the last place, and the unit gets a function that counts frames. */
static uint16_t give_diagnostics_and_decline(void *context, const mbm_request *request,
                                             uint8_t *response, uint16_t capacity)
{
    (void)give_diagnostics(context, request, response, capacity);
    return MBM_REPLY_DECLINED;
}

TEST(a_function_that_declines_may_fill_the_last_place)
{
    static mbm_custom all[MBM_MAX_SERVICES - 1];
    static mbm_unit full;

    memset(all, 0, sizeof all);
    memset(&late, 0, sizeof late);
    full = (mbm_unit){.id = 17};
    for (int i = 0; i < MBM_MAX_SERVICES - 1; i++) {
        all[i].serve = echo;
        all[i].code = (uint8_t)(66 + i);
        OK(mbm_unit_serveCustom(&full, &all[i]));
    }
    all[0].serve = give_diagnostics_and_decline;
    all[0].context = &full;
    assert_int_equal(answer(&full, 17, "\x42", 1), 0xC2);
    assert_int_equal(answer(&full, 17, "\x43", 1), 0x43);
}

TEST(a_unit_with_all_places_taken_refuses_other_functions)
{
    static mbm_custom all[MBM_MAX_SERVICES];
    static mbm_unit full;

    memset(all, 0, sizeof all);
    memset(&late, 0, sizeof late);
    full = (mbm_unit){.id = 17};
    for (int i = 0; i < MBM_MAX_SERVICES; i++) {
        all[i].serve = echo;
        all[i].code = (uint8_t)(66 + i);
    }
    for (int i = 0; i < MBM_MAX_SERVICES - 1; i++)
        OK(mbm_unit_serveCustom(&full, &all[i]));
    /* A hook registers the diagnostics, which count every frame, in the last place. */
    all[0].serve = give_diagnostics;
    all[0].context = &full;
    assert_int_equal(answer(&full, 17, "\x42", 1), 0x42);
    assert_int_equal(answer(&full, 17, "\x03\0\0\0\1", 5), 0x83);
    /* All places taken, without diagnostics. */
    memset(&full, 0, sizeof full);
    full.id = 17;
    for (int i = 0; i < MBM_MAX_SERVICES; i++)
        OK(mbm_unit_serveCustom(&full, &all[i]));
    assert_int_equal(answer(&full, 17, "\x51", 1), 0x51);
    assert_int_equal(answer(&full, 17, "\x03\0\0\0\1", 5), 0x83);
}

TEST(switches_can_be_registered_again_like_any_record)
{
    OK(mbm_unit_switchFunction(&units[0], &first.switches, 3, 0));
    assert_int_equal(answered(&units[0], 2), 0x83);
    memset(&first.switches, 0, sizeof first.switches);
    all_are_answered(&units[0]);
    OK(mbm_unit_switchFunction(&units[0], &first.switches, 4, 0));
    assert_int_equal(answered(&units[0], 2), 3);
    assert_int_equal(answered(&units[0], 3), 0x84);
    /* Two units may share a record of switches. */
    OK(serve(&units[1], &first, 2));
    OK(mbm_unit_switchFunction(&units[1], &first.switches, 3, 0));
    assert_int_equal(answered(&units[0], 2), 0x83);
    assert_int_equal(answered(&units[1], 2), 0x83);
    OK(mbm_unit_switchFunction(&units[0], &first.switches, 3, 1));
    OK(mbm_unit_switchFunction(&units[0], &first.switches, 4, 1));
    all_are_answered(&units[0]);
}

/* --- hooks that change their own table while a request is carried out, which goes on with the
 * table as it was --- */

/* The table is on the heap, so that the sanitizer finds an access beyond its end. */
static mbm_registerTable *changing;
static mbm_unit hooked_unit;
static uint16_t cells[4];
static uint16_t fewer[1];

static uint8_t zero_before(void *context, const mbm_access *access)
{
    memset(changing, 0, sizeof *changing);
    return 0;
}

static uint8_t shrink_before(void *context, const mbm_access *access)
{
    zero_before(context, access);
    changing->words = fewer;
    changing->size = 1;
    OK(mbm_unit_serveHoldingRegisters(&hooked_unit, changing));
    return 0;
}

static void shrink_after(void *context, const mbm_access *access)
{
    shrink_before(context, access);
}

static uint8_t become_bits(void *context, const mbm_access *access)
{
    static uint8_t bit[1];
    mbm_bitTable *other = (mbm_bitTable *)(void *)changing;

    zero_before(context, access);
    other->bits = bit;
    other->size = 8;
    OK(mbm_unit_serveCoils(&hooked_unit, other));
    return 0;
}

/* Serves four registers with these hooks, from new. */
static void serve_hooked(const mbm_accessHooks *hooks)
{
    hooked_unit = (mbm_unit){.id = 17};
    memset(changing, 0, sizeof *changing);
    changing->words = cells;
    changing->size = 4;
    cells[3] = 0x00F0;
    OK(mbm_registerTable_setHooks(changing, hooks));
    OK(mbm_unit_serveHoldingRegisters(&hooked_unit, changing));
    OK(mbm_registerTable_serveMaskAndReadWrite(changing));
}

TEST(a_write_goes_on_with_the_old_table_if_its_hook_changes_it)
{
    static const mbm_accessHooks hooks[] = {
        {.beforeWrite = zero_before},
        {.beforeWrite = shrink_before},
        {.beforeWrite = become_bits},
    };

    for (int i = 0; i < 3; i++) {
        serve_hooked(&hooks[i]);
        assert_int_equal(answer(&hooked_unit, 17, "\x10\0\0\0\4\x08\0\1\0\2\0\3\0\4", 14), 0x10);
        assert_int_equal(cells[3], 4);
        assert_int_equal(fewer[0], 0);
    }
}

TEST(function_17_reads_from_the_old_table_if_the_hook_after_its_write_changes_it)
{
    static const mbm_accessHooks hooks = {.afterWrite = shrink_after};

    serve_hooked(&hooks);
    assert_int_equal(answer(&hooked_unit, 17, "\x17\0\0\0\4\0\0\0\1\2\0\1", 12), 0x17);
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
    } reads[] = {
        {"\3\0\0\0\4", 5, 0x00F0},
        {"\x16\0\3\0\xFF\x0F\0", 7, 0x0FF0},
        {"\x17\0\0\0\4\0\3\0\1\2\x0F\xF0", 12, 0x0FF0},
    };

    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) {
            serve_hooked(&hooks[j]);
            assert_int_equal(answer(&hooked_unit, 17, reads[i].pdu, reads[i].length),
                             reads[i].pdu[0]);
            assert_int_equal(cells[3], reads[i].last);
            assert_int_equal(fewer[0], 0);
        }
}

static void make_table(void)
{
    changing = (mbm_registerTable *)malloc(sizeof *changing);
    assert_non_null(changing);
}

static void free_table(void)
{
    free(changing);
}

fixture all_tests = {make_table, free_table};
