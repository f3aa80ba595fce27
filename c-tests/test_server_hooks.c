/* The hooks around reads and writes, on lines and connections. libmodbus's client and the test
 * itself send requests. */
#include "asked.h"
#include "await.h"
#include "tcp_server.h"
#include "test.h"
#include "watched.h"

#include <errno.h>
#include <unistd.h>

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

static void reset(void)
{
    watched_reset();
}

fixture each_test = {reset, NULL};

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
