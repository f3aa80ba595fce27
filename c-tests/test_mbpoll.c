/* mbpoll, a program of another project, as a client of mbm's server over TCP and over a pty. */
#define _GNU_SOURCE
#include "served.h"
#include "test.h"

#include <sys/wait.h>

static served tcp, rtu;
static char place[2][128];
static char output[8192];

static void start(void)
{
    served_prepare(&tcp);
    served_on_tcp(&tcp, MBM_FRAMING_TCP);
    served_prepare(&rtu);
    served_on_line(&rtu, MBM_FRAMING_RTU);
    snprintf(place[0], sizeof place[0], "-m tcp -p %d 127.0.0.1", tcp.port);
    snprintf(place[1], sizeof place[1], "-m rtu -b 115200 -P none %s", rtu.line.path);
}

static void stop(void)
{
    served_stop(&tcp);
    served_stop(&rtu);
}

fixture all_tests = {start, stop};

/* Runs mbpoll and keeps its output. Returns its exit code. The values to write come last on
 * the command line. */
static int mbpoll(const char *where, const char *arguments, const char *values)
{
    char command[512];
    size_t length = 0, count;
    FILE *pipe;

    snprintf(command, sizeof command, "mbpoll -0 -1 -o 10 %s %s %s 2>&1", arguments, where, values);
    pipe = popen(command, "r");
    assert_non_null(pipe);
    while ((count = fread(output + length, 1, sizeof output - 1 - length, pipe)) > 0)
        length += count;
    output[length] = 0;
    count = (size_t)pclose(pipe);
    assert_true(WIFEXITED((int)count));
    return WEXITSTATUS((int)count);
}

/* The value that mbpoll printed for a reference. */
static unsigned long value(unsigned reference, int base)
{
    char label[16];

    snprintf(label, sizeof label, "[%u]: \t", reference);
    const char *found = strstr(output, label);
    if (!found)
        print_error("%s", output);
    assert_non_null(found);
    return strtoul(found + strlen(label), NULL, base);
}

static void assert_printed(const char *text)
{
    if (!strstr(output, text))
        print_error("%s", output);
    assert_non_null(strstr(output, text));
}

TEST(mbpoll_reads_every_table)
{
    for (unsigned where = 0; where < 2; where++) {
        assert_int_equal(mbpoll(place[where], "-a 17 -r 103 -c 125", ""), 0);
        for (unsigned i = 103; i < 103 + 125; i++)
            assert_int_equal(value(i, 10), served_pattern(i));
        assert_int_equal(mbpoll(place[where], "-a 17 -r 399 -c 1 -t 3:hex", ""), 0);
        assert_int_equal(value(399, 16), (uint16_t)~served_pattern(399));
        assert_int_equal(mbpoll(place[where], "-a 17 -r 111 -c 19 -t 0", ""), 0);
        for (unsigned i = 111; i < 111 + 19; i++)
            assert_int_equal(value(i, 10), served_bit_pattern(i));
        assert_int_equal(mbpoll(place[where], "-a 17 -r 101 -c 9 -t 1", ""), 0);
        for (unsigned i = 101; i < 101 + 9; i++)
            assert_int_equal(value(i, 10), !served_bit_pattern(i));
    }
}

TEST(mbpoll_writes_one_and_several_values)
{
    served *servers[] = {&tcp, &rtu};

    for (unsigned where = 0; where < 2; where++) {
        const uint16_t words[] = {7, 65535, 4711};
        uint8_t before = servers[where]->bits[2];

        assert_int_equal(mbpoll(place[where], "-a 17 -r 120", "4660"), 0);
        assert_printed("Written 1 references");
        assert_int_equal(servers[where]->words[20], 4660);
        assert_int_equal(mbpoll(place[where], "-a 17 -r 130", "7 65535 4711"), 0);
        assert_printed("Written 3 references");
        assert_memory_equal(&servers[where]->words[30], words, sizeof words);
        assert_int_equal(mbpoll(place[where], "-a 17 -r 118 -t 0", "1 0 1 1"), 0);
        assert_int_equal(servers[where]->bits[2], (before & 3) | 0x34 | (before & 0xC0));
    }
}

TEST(mbpoll_receives_exceptions)
{
    for (unsigned where = 0; where < 2; where++) {
        assert_int_equal(mbpoll(place[where], "-a 17 -r 99", ""), 1);
        assert_printed("Illegal data address");
        assert_int_equal(mbpoll(place[where], "-a 17 -r 260", "48879"), 1);
        assert_printed("Illegal data value");
        assert_int_equal(mbpoll(place[where], "-a 18 -r 0 -t 1", ""), 1);
        assert_printed("Illegal function");
    }
}

TEST(mbpoll_reads_two_units_of_one_line)
{
    rtu.other_words[3] = 1234;
    tcp.other_words[3] = 4321;
    assert_int_equal(mbpoll(place[1], "-a 18 -r 3", ""), 0);
    assert_int_equal(value(3, 10), 1234);
    assert_int_equal(mbpoll(place[0], "-a 18 -r 3", ""), 0);
    assert_int_equal(value(3, 10), 4321);
    assert_int_equal(mbpoll(place[1], "-a 17 -r 399", ""), 0);
    assert_int_equal(value(399, 10), served_pattern(399));
}

TEST(mbpoll_reads_the_server_id)
{
    assert_int_equal(mbpoll(place[1], "-a 17 -u", ""), 0);
    assert_printed("Length: 8");
    assert_printed("Data  : m\\FFtest");
}
