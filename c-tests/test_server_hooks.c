/* The hooks around reads and writes, on lines and connections and around data callbacks.
 * libmodbus's client and the test itself send requests. */
#include "asked.h"
#include "await.h"
#include "crc.h"
#include "tcp_server.h"
#include "test.h"

/* Hooks that write down what they are called with. */
static struct {
    /* Each call as a text: the hook (r before a read, w before a write, a after a write), the
     * unit, the function in hex, the first address and the quantity, and the data in hex. Before
     * the address of a record stands the file. "w17/10 104+2 00010002;" */
    char text[4000];
    size_t length;
    const void *connection;            /* that the last call came from */
    uint8_t refuse_read, refuse_write; /* what the hooks return */
    /* Unless NULL, called within each hook. */
    void (*within)(char hook, const mbm_access *access);
    mbm_accessHooks hooks;
} watching;

static void add(const char *text)
{
    size_t length = strlen(text);

    if (watching.length + length >= sizeof watching.text)
        abort();
    memcpy(watching.text + watching.length, text, length + 1);
    watching.length += length;
}

static void note(char hook, const mbm_access *access)
{
    int is_bits = access->function == 0x05 || access->function == 0x0F;
    unsigned i, bytes = is_bits ? (access->quantity + 7u) / 8 : 2u * access->quantity;
    char text[40], file[8] = "";

    if (access->file != 0)
        snprintf(file, sizeof file, "%u:", access->file);
    snprintf(text, sizeof text, "%c%u/%02X %s%u+%u", hook, access->unit, access->function, file,
             access->address, access->quantity);
    add(text);
    for (i = 0; access->data != NULL && i < bytes; i++) {
        snprintf(text, sizeof text, "%s%02X", i == 0 ? " " : "", access->data[i]);
        add(text);
    }
    add(";");
    watching.connection = access->connection;
    if (watching.within != NULL)
        watching.within(hook, access);
}

static uint8_t before_read(void *context, const mbm_access *access)
{
    assert_ptr_equal(context, &watching);
    note('r', access);
    return watching.refuse_read;
}

static uint8_t before_write(void *context, const mbm_access *access)
{
    assert_ptr_equal(context, &watching);
    note('w', access);
    return watching.refuse_write;
}

static void after_write(void *context, const mbm_access *access)
{
    assert_ptr_equal(context, &watching);
    note('a', access);
}

/* Zeroes `watching` but for its hooks, whose context is `watching`. */
static void watched_reset(void)
{
    memset(&watching, 0, sizeof watching);
    watching.hooks.context = &watching;
    watching.hooks.beforeRead = before_read;
    watching.hooks.beforeWrite = before_write;
    watching.hooks.afterWrite = after_write;
}

/* Sets the hooks of the tables and the files of a server. */
static void watched_set(served *s)
{
    OK(mbm_registerTable_setHooks(&s->holding, &watching.hooks));
    OK(mbm_registerTable_setHooks(&s->inputs, &watching.hooks));
    OK(mbm_bitTable_setHooks(&s->coils, &watching.hooks));
    OK(mbm_bitTable_setHooks(&s->discrete, &watching.hooks));
    OK(mbm_files_setHooks(&s->files, &watching.hooks));
}

/* Fails unless these were the calls; then forgets them. */
static void watched_were(const char *calls)
{
    assert_string_equal(watching.text, calls);
    watching.length = 0;
    watching.text[0] = 0;
}

static served rtu, ascii, tcp;
static modbus_t *line, *first, *second;

static modbus_t *ready(modbus_t *client)
{
    if (!client || modbus_set_slave(client, SERVED_UNIT) || modbus_connect(client))
        fail_msg("no connection");
    modbus_set_response_timeout(client, PATIENCE_MS / 1000, 0);
    return client;
}

static void start(void)
{
    watched_reset();
    served_prepare(&rtu);
    served_prepare(&ascii);
    served_prepare(&tcp);
    watched_set(&rtu);
    watched_set(&ascii);
    watched_set(&tcp);
    served_on_line(&rtu, MBM_FRAMING_RTU);
    served_on_line(&ascii, MBM_FRAMING_ASCII);
    served_on_tcp(&tcp, MBM_FRAMING_TCP);
    line = ready(modbus_new_rtu(rtu.line.path, 115200, 'N', 8, 1));
    first = ready(modbus_new_tcp("127.0.0.1", tcp.port));
    second = ready(modbus_new_tcp("127.0.0.1", tcp.port));
}

static void stop(void)
{
    modbus_close(line);
    modbus_close(first);
    modbus_close(second);
    modbus_free(line);
    modbus_free(first);
    modbus_free(second);
    served_stop(&rtu);
    served_stop(&ascii);
    served_stop(&tcp);
}

fixture all_tests = {start, stop};

fixture each_test = {watched_reset, NULL};

static void reads_are_refused_by(modbus_t *client, uint8_t code)
{
    uint16_t words[4];
    uint8_t bits[8];

    EXCEPTION(code, modbus_read_bits(client, SERVED_BASE, 8, bits));
    EXCEPTION(code, modbus_read_input_bits(client, SERVED_BASE + 1, 3, bits));
    EXCEPTION(code, modbus_read_registers(client, SERVED_BASE + 2, 4, words));
    EXCEPTION(code, modbus_read_input_registers(client, SERVED_BASE + 3, 1, words));
    watched_were("r17/01 100+8;r17/02 101+3;r17/03 102+4;r17/04 103+1;");
}

TEST(a_read_is_refused_with_every_exception)
{
    uint16_t word;

    for (uint8_t code = 1; code <= 11; code++) {
        watching.refuse_read = code;
        reads_are_refused_by(line, code);
        reads_are_refused_by(first, code);
    }
    watching.refuse_read = 0;
    assert_int_equal(modbus_read_registers(line, SERVED_BASE, 1, &word), 1);
    assert_int_equal(word, served_pattern(SERVED_BASE));
}

TEST(a_code_that_is_no_exception_refuses_with_04)
{
    uint16_t word;

    for (watching.refuse_read = 255; watching.refuse_read > 127; watching.refuse_read--) {
        EXCEPTION(4, modbus_read_registers(first, SERVED_BASE, 1, &word));
        watching.refuse_write = watching.refuse_read;
        EXCEPTION(4, modbus_write_register(first, SERVED_BASE, 1));
        watched_were("r17/03 100+1;w17/06 100+1 0001;");
    }
    assert_int_equal(tcp.words[0], served_pattern(SERVED_BASE));
    asked_frames(modbus_get_socket(first), MBM_FRAMING_TCP, SERVED_UNIT,
                 (const uint8_t *)"\3\0\144\0\1", 5, (const uint8_t *)"\x83\x7F", 2);
}

static unsigned refreshed;

static void refresh(char hook, const mbm_access *access)
{
    if (hook != 'r')
        return;
    refreshed++;
    for (unsigned i = access->address - SERVED_BASE;
         i < access->address - SERVED_BASE + 0u + access->quantity; i++)
        if (access->function == 3)
            rtu.words[i] = (uint16_t)(1000 * refreshed + i);
        else if (access->function == 1)
            rtu.bits[i / 8] = (uint8_t)(refreshed % 2 ? 0x55 : 0xAA);
}

TEST(a_hook_refreshes_the_cells_that_are_read)
{
    uint16_t words[3];
    uint8_t bits[3];

    refreshed = 0;
    watching.within = refresh;
    assert_int_equal(modbus_read_registers(line, SERVED_BASE + 5, 3, words), 3);
    assert_int_equal(words[0], 1005);
    assert_int_equal(words[2], 1007);
    assert_int_equal(modbus_read_registers(line, SERVED_BASE + 5, 3, words), 3);
    assert_int_equal(words[0], 2005);
    assert_int_equal(modbus_read_bits(line, SERVED_BASE + 800, 3, bits), 3);
    assert_true(bits[0] == 1 && bits[1] == 0 && bits[2] == 1);
    assert_int_equal(modbus_read_bits(line, SERVED_BASE + 800, 3, bits), 3);
    assert_true(bits[0] == 0 && bits[1] == 1 && bits[2] == 0);
}

static void writes_are_watched(modbus_t *client)
{
    static const uint8_t bits[] = {1, 0, 1, 1, 0, 0, 0, 0, 1, 1};
    static const uint16_t words[] = {1, 0x203, 0xFFFF};

    assert_int_equal(modbus_write_bit(client, SERVED_BASE + 9, 1), 1);
    watched_were("w17/05 109+1 FF;a17/05 109+1 FF;");
    assert_int_equal(modbus_write_bit(client, SERVED_BASE + 9, 0), 1);
    watched_were("w17/05 109+1 00;a17/05 109+1 00;");
    assert_int_equal(modbus_write_register(client, SERVED_BASE, 0x1234), 1);
    watched_were("w17/06 100+1 1234;a17/06 100+1 1234;");
    assert_int_equal(modbus_write_bits(client, SERVED_BASE + 1, 10, bits), 10);
    watched_were("w17/0F 101+10 0D03;a17/0F 101+10 0D03;");
    assert_int_equal(modbus_write_registers(client, SERVED_BASE + 1, 3, words), 3);
    watched_were("w17/10 101+3 00010203FFFF;a17/10 101+3 00010203FFFF;");
}

TEST(a_write_is_watched_with_its_arguments)
{
    writes_are_watched(line);
    assert_ptr_equal(watching.connection, &rtu.fds[0]);
    writes_are_watched(first);
    writes_are_watched(second);
}

TEST(a_write_over_ascii_is_watched_too)
{
    asked_frames(ascii.line.theirs, MBM_FRAMING_ASCII, SERVED_UNIT,
                 (const uint8_t *)"\x10\0\144\0\1\2\xAB\xCD", 8, (const uint8_t *)"\x10\0\144\0\1",
                 5);
    watched_were("w17/10 100+1 ABCD;a17/10 100+1 ABCD;");
    assert_ptr_equal(watching.connection, &ascii.fds[0]);
    asked_frames(ascii.line.theirs, MBM_FRAMING_ASCII, SERVED_UNIT, (const uint8_t *)"\3\0\144\0\1",
                 5, (const uint8_t *)"\3\2\xAB\xCD", 4);
    watched_were("r17/03 100+1;");
}

TEST(a_write_is_refused_with_every_exception)
{
    static const uint16_t words[] = {1, 2};
    static const uint8_t bits[] = {1, 1};
    uint16_t before[sizeof rtu.words / 2];
    uint8_t coils[sizeof rtu.bits], code;

    memcpy(before, rtu.words, sizeof before);
    memcpy(coils, rtu.bits, sizeof coils);
    for (code = 1; code <= 11; code++) {
        watching.refuse_write = code;
        EXCEPTION(code, modbus_write_bit(line, SERVED_BASE, 1));
        EXCEPTION(code, modbus_write_register(line, SERVED_BASE, 1));
        EXCEPTION(code, modbus_write_bits(line, SERVED_BASE, 2, bits));
        EXCEPTION(code, modbus_write_registers(line, SERVED_BASE, 2, words));
        watched_were("w17/05 100+1 FF;w17/06 100+1 0001;w17/0F 100+2 03;w17/10 100+2 00010002;");
    }
    assert_memory_equal(before, rtu.words, sizeof before);
    assert_memory_equal(coils, rtu.bits, sizeof coils);
}

/* Writes are for the first connection only. */
static const void *writer;

static void let_one_write(char hook, const mbm_access *access)
{
    watching.refuse_write =
        (uint8_t)(hook != 'w' || access->connection == writer ? 0 : MBM_ILLEGAL_FUNCTION);
}

TEST(two_connections_are_told_apart)
{
    uint16_t word;

    assert_int_equal(modbus_read_registers(first, SERVED_BASE, 1, &word), 1);
    writer = watching.connection;
    assert_int_equal(modbus_read_registers(second, SERVED_BASE, 1, &word), 1);
    assert_ptr_not_equal(watching.connection, writer);
    assert_true((const int *)writer >= tcp.fds &&
                (const int *)writer < tcp.fds + SERVED_CONNECTIONS);
    watching.within = let_one_write;
    assert_int_equal(modbus_write_register(first, SERVED_BASE, 77), 1);
    EXCEPTION(1, modbus_write_register(second, SERVED_BASE, 78));
    assert_int_equal(modbus_read_registers(second, SERVED_BASE, 1, &word), 1);
    assert_int_equal(word, 77);
}

TEST(a_broadcast_is_watched_as_unit_0)
{
    uint16_t word;

    asked_frames(modbus_get_socket(line), MBM_FRAMING_RTU, 0, (const uint8_t *)"\x06\0\x64\x33\x44",
                 5, NULL, 0);
    AWAIT(rtu.words[0] == 0x3344);
    /* The response to the next request comes after the hooks of the broadcast. */
    assert_int_equal(modbus_read_registers(line, SERVED_BASE, 1, &word), 1);
    watched_were("w0/06 100+1 3344;a0/06 100+1 3344;r17/03 100+1;");
    /* A broadcast read is not carried out. */
    asked_frames(modbus_get_socket(line), MBM_FRAMING_RTU, 0, (const uint8_t *)"\x03\0\x64\0\1", 5,
                 NULL, 0);
    assert_int_equal(modbus_read_registers(line, SERVED_BASE, 1, &word), 1);
    watched_were("r17/03 100+1;");
}

TEST(read_write_multiple_calls_all_hooks_before_it_writes)
{
    static const uint16_t words[] = {0x1111, 0x2222};
    uint16_t back[3], before[sizeof rtu.words / 2];

    assert_int_equal(
        modbus_write_and_read_registers(line, SERVED_BASE + 1, 2, words, SERVED_BASE, 3, back), 3);
    watched_were("r17/17 100+3;w17/17 101+2 11112222;a17/17 101+2 11112222;");
    assert_true(back[0] == rtu.words[0] && back[1] == 0x1111 && back[2] == 0x2222);
    memcpy(before, rtu.words, sizeof before);
    watching.refuse_read = 5;
    EXCEPTION(
        5, modbus_write_and_read_registers(line, SERVED_BASE + 1, 1, words, SERVED_BASE, 3, back));
    watched_were("r17/17 100+3;");
    watching.refuse_read = 0;
    watching.refuse_write = 6;
    EXCEPTION(
        6, modbus_write_and_read_registers(line, SERVED_BASE + 2, 1, words, SERVED_BASE, 3, back));
    watched_were("r17/17 100+3;w17/17 102+1 1111;");
    assert_memory_equal(before, rtu.words, sizeof before);
}

/* A request and a response in one register: the response replaces it after the write. */
static void answer_in_place(char hook, const mbm_access *access)
{
    if (hook == 'a')
        rtu.words[access->address - SERVED_BASE] ^= 0xFFFF;
}

TEST(read_write_multiple_reads_what_the_hook_after_the_write_has_left)
{
    static const uint16_t command = 0x1234;
    uint16_t back;

    watching.within = answer_in_place;
    assert_int_equal(
        modbus_write_and_read_registers(line, SERVED_BASE, 1, &command, SERVED_BASE, 1, &back), 1);
    assert_int_equal(back, 0xEDCB);
}

TEST(mask_write_calls_the_hooks_of_a_read_and_a_write)
{
    assert_int_equal(modbus_write_register(line, SERVED_BASE, 0x12), 1);
    watched_were("w17/06 100+1 0012;a17/06 100+1 0012;");
    assert_int_equal(modbus_mask_write_register(line, SERVED_BASE, 0xF2, 0x25), 1);
    watched_were("r17/16 100+1;w17/16 100+1 0017;a17/16 100+1 0017;");
    assert_int_equal(rtu.words[0], 0x17);
    watching.refuse_read = 3;
    EXCEPTION(3, modbus_mask_write_register(line, SERVED_BASE, 0, 1));
    watched_were("r17/16 100+1;");
    watching.refuse_read = 0;
    watching.refuse_write = 8;
    EXCEPTION(8, modbus_mask_write_register(line, SERVED_BASE, 0, 1));
    watched_were("r17/16 100+1;w17/16 100+1 0001;");
    assert_int_equal(rtu.words[0], 0x17);
}

TEST(a_wrong_request_calls_no_hook)
{
    static const char *const wrong[] = {
        "\3\0\144\0\0",                   /* no register */
        "\3\0\143\0\2",                   /* the first does not exist */
        "\3\0\372\0\1",                   /* a hole */
        "\6\0\143\0\1",                   /* a register that does not exist */
        "\5\0\144\1\0",                   /* neither on nor off */
        "\x10\0\144\0\1\1\0",             /* a wrong byte count */
        "\x16\0\143\0\1\0\1",             /* a register that does not exist */
        "\x17\0\143\0\1\0\144\0\1\2\0\1", /* reads what does not exist */
        "\x17\0\144\0\1\0\143\0\1\2\0\1", /* writes what does not exist */
    };
    static const struct {
        size_t length;
        uint8_t code;
    } of[] = {{5, 3}, {5, 2}, {5, 2}, {5, 2}, {5, 3}, {7, 3}, {7, 2}, {12, 2}, {12, 2}};

    for (unsigned i = 0; i < COUNT(wrong); i++) {
        const uint8_t response[] = {(uint8_t)(wrong[i][0] | 0x80), of[i].code};

        asked_frames(modbus_get_socket(first), MBM_FRAMING_TCP, SERVED_UNIT,
                     (const uint8_t *)wrong[i], of[i].length, response, sizeof response);
    }
    watched_were("");
}

TEST(records_of_files_are_watched_in_each_group)
{
    static const char write[] = "\x15\x14\6\0\4\0\1\0\2\1\2\3\4\6\0\4\0\7\0\1\5\6";
    static const char read[] = "\x14\x0E\6\0\4\0\1\0\2\6\0\4\0\7\0\1";
    int fd = modbus_get_socket(first);

    asked_frames(fd, MBM_FRAMING_TCP, SERVED_UNIT, (const uint8_t *)write, sizeof write - 1,
                 (const uint8_t *)write, sizeof write - 1);
    watched_were(
        "w17/15 4:1+2 01020304;w17/15 4:7+1 0506;a17/15 4:1+2 01020304;a17/15 4:7+1 0506;");
    asked_frames(fd, MBM_FRAMING_TCP, SERVED_UNIT, (const uint8_t *)read, sizeof read - 1,
                 (const uint8_t *)"\x14\x0A\5\6\1\2\3\4\3\6\5\6", 12);
    watched_were("r17/14 4:1+2;r17/14 4:7+1;");
    watching.refuse_write = 9;
    asked_frames(fd, MBM_FRAMING_TCP, SERVED_UNIT, (const uint8_t *)"\x15\x09\6\0\4\0\1\0\1\7\7",
                 11, (const uint8_t *)"\x95\x09", 2);
    watching.refuse_read = 10;
    asked_frames(fd, MBM_FRAMING_TCP, SERVED_UNIT, (const uint8_t *)read, sizeof read - 1,
                 (const uint8_t *)"\x94\x0A", 2);
    watched_were("w17/15 4:1+1 0707;r17/14 4:1+2;");
    assert_int_equal(tcp.records[1], 0x102);
}

/* --- data callbacks: read-only cells, and hooks around them --- */

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

static void reset_cells(void)
{
    memset(&cells, 0, sizeof cells);
    memset(&table, 0, sizeof table);
    memset(&bits, 0, sizeof bits);
    memset(words, 0, sizeof words);
    gets = sets = 0;
    unit = (mbm_unit){.id = SERVED_UNIT};
    cells.get = get;
    table.words = words;
    table.size = 8;
    bits.bits = coils;
    bits.size = 8;
    watched_reset();
}

#define CELLS_TEST(name) TEST_WITH(name, reset_cells, NULL)

/* Sends a PDU, a string literal without its final zero byte, and expects another. */
#define ANSWERS(pdu, response) answers(pdu, sizeof pdu - 1, response, sizeof response - 1)

static void answers(const char *pdu, size_t length, const char *response, size_t expected)
{
    uint16_t answered;

    frame[0] = SERVED_UNIT;
    memcpy(frame + 1, pdu, length);
    seal(frame, length + 1);
    OK(mbm_unit_respond(&unit, 1, &connection, FRAMING(MBM_FRAMING_RTU), frame,
                        (uint16_t)(length + 3), sizeof frame, &answered));
    assert_int_equal(answered, expected + 3);
    assert_memory_equal(frame + 1, response, expected);
}

CELLS_TEST(registers_without_set_are_read_only)
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

CELLS_TEST(coils_without_set_are_read_only)
{
    OK(mbm_unit_serveCallbacks(&unit, &cells, 1));
    ANSWERS("\1\0\1\0\3", "\1\1\7");
    gets = 0;
    ANSWERS("\5\0\1\xFF\0", "\x85\1");
    ANSWERS("\xF\0\1\0\1\1\1", "\x8F\1");
    assert_int_equal(gets, 0);
}

CELLS_TEST(a_later_record_takes_the_writes_of_read_only_cells)
{
    OK(mbm_unit_serveCallbacks(&unit, &cells, 3));
    OK(mbm_unit_serveHoldingRegisters(&unit, &table));
    OK(mbm_registerTable_serveMaskAndReadWrite(&table));
    ANSWERS("\6\0\1\0\2", "\6\0\1\0\2");
    ANSWERS("\x16\0\1\0\xFF\1\0", "\x16\0\1\0\xFF\1\0");
    ANSWERS("\3\0\1\0\1", "\3\2\1\1");
    assert_int_equal(words[1], 0x102);
}

CELLS_TEST(cells_that_get_a_set_can_be_written_from_then_on)
{
    OK(mbm_unit_serveCallbacks(&unit, &cells, 3));
    ANSWERS("\6\0\1\0\2", "\x86\1");
    cells.set = set;
    ANSWERS("\6\0\1\0\2", "\6\0\1\0\2");
    assert_int_equal(sets, 1);
}

CELLS_TEST(hooks_of_callbacks_are_called_with_the_arguments)
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

CELLS_TEST(hooks_of_bits_see_one_bit_for_each_cell)
{
    cells.set = set;
    OK(mbm_unit_serveCallbacks(&unit, &cells, 1));
    OK(mbm_dataCallbacks_setHooks(&cells, &watching.hooks));
    ANSWERS("\xF\0\1\0\xA\2\x55\1", "\xF\0\1\0\xA");
    ANSWERS("\1\0\1\0\3", "\1\1\7");
    watched_were("w17/0F 1+10 5501;a17/0F 1+10 5501;r17/01 1+3;");
}

/* Sets and removes the hooks of each kind of record. */
CELLS_TEST(hooks_are_set_before_or_after_registering_and_removed)
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

CELLS_TEST(hooks_that_are_all_null_change_nothing)
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

CELLS_TEST(a_hook_that_removes_the_hooks_is_the_last_for_its_request)
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

CELLS_TEST(a_response_that_does_not_fit_calls_no_hook)
{
    uint8_t small[12] = {SERVED_UNIT, 3, 0, 0, 0, 8};
    uint16_t answered;

    OK(mbm_unit_serveHoldingRegisters(&unit, &table));
    OK(mbm_registerTable_setHooks(&table, &watching.hooks));
    seal(small, 6);
    OK(mbm_unit_respond(&unit, 1, NULL, FRAMING(MBM_FRAMING_RTU), small, 8, sizeof small,
                        &answered));
    assert_memory_equal(small, "\x11\x83\4", 3);
    watched_were("");
}
