/* The library accesses a server's frame buffer without checks. The tests use buffers of
 * exactly the size that begin is given, from malloc, so that the address sanitizer reports
 * an access to one byte before or after. The port checks too that each pointer that it is
 * given lies in the buffer, for builds without the sanitizer. */
#include "crc.h"
#include "mbm.h"
#include "test.h"

enum { UNIT = 17, WORDS = 125, MOST = 530, ECHO_CODE = 65 };

typedef uint8_t begin_function(mbm_server *, const mbm_port *, mbm_unit *, uint8_t, uint8_t *,
                               uint16_t);

static mbm_server server;
static mbm_unit unit;
static mbm_registerTable holding;
static mbm_bitTable coils;
static mbm_custom custom;
static uint16_t words[WORDS];
static uint8_t bits[250];

/* The line: bytes that are still to arrive, and how the port behaves. */
static struct {
    uint8_t bytes[4 * MOST];
    unsigned length, next;
    unsigned at_once; /* the most bytes that a read returns */
    int lies;         /* 1: a read or write claims more bytes than it moved */
    unsigned sent;
    uint32_t now;
    uint8_t *frame;
    unsigned size;
} line;

static void check_place(const uint8_t *bytes, uint16_t count)
{
    assert_true(bytes >= line.frame);
    assert_true(bytes + count <= line.frame + line.size);
}

static int16_t port_read(void *context, uint8_t *bytes, uint16_t capacity)
{
    unsigned count = line.length - line.next;

    check_place(bytes, capacity);
    if (count > line.at_once)
        count = line.at_once;
    if (count > capacity)
        count = capacity;
    memcpy(bytes, line.bytes + line.next, count);
    line.next += count;
    if (line.lies && count) {
        /* The port fills all of the place that it claims to have filled. */
        memset(bytes + count, 0xA5, capacity - count);
        return INT16_MAX;
    }
    return (int16_t)count;
}

static int16_t port_write(void *context, const uint8_t *bytes, uint16_t length)
{
    static uint8_t sink[65536];

    check_place(bytes, length);
    assert_int_not_equal(length, 0);
    memcpy(sink, bytes, length);
    if (line.lies) {
        line.sent += length;
        return INT16_MAX;
    }
    if (length > line.at_once)
        length = (uint16_t)line.at_once;
    line.sent += length;
    return (int16_t)length;
}

static uint32_t port_micros(void *context)
{
    return line.now;
}

/* Writes to the whole capacity for the response, which is larger than the request's data. */
static uint16_t fill(void *context, const mbm_request *request, uint8_t *response,
                     uint16_t capacity)
{
    uint8_t sum = 0;

    for (uint16_t i = 0; i < request->length; i++)
        sum = (uint8_t)(sum + request->data[i]);
    check_place(response, capacity);
    memset(response, sum, capacity);
    return capacity < 253 ? capacity : 252;
}

static const mbm_port port = {.read = port_read, .write = port_write, .micros = port_micros};

/* Begins with a buffer of this size. Returns whether begin accepted it. */
static int begin(begin_function *how, unsigned size)
{
    free(line.frame);
    line.frame = malloc(size);
    assert_non_null(line.frame);
    memset(line.frame, 0x5A, size);
    line.size = size;
    line.length = line.next = line.sent = 0;
    line.at_once = MOST;
    line.lies = 0;
    memset(&server, 0, sizeof server);
    return how(&server, &port, &unit, 1, line.frame, (uint16_t)size) == MBM_OK;
}

static void put(const uint8_t *bytes, unsigned count)
{
    assert_true(line.length + count <= sizeof line.bytes);
    memcpy(line.bytes + line.length, bytes, count);
    line.length += count;
}

/* Polls until all bytes were read, then until the silence of any framing is over. */
static void run(void)
{
    for (unsigned turn = 0; turn < 5000 && (line.next < line.length || turn % 8); turn++) {
        (void)mbm_server_poll(&server);
        line.now += 10;
    }
    assert_int_equal(line.next, line.length);
    for (unsigned turn = 0; turn < 40; turn++) {
        line.now += 2000000;
        (void)mbm_server_poll(&server);
    }
    line.length = line.next = 0;
}

/* Writes the frame of this PDU in the framing. Returns its length. */
static unsigned framed(uint8_t *frame, begin_function *how, const uint8_t *pdu, unsigned length)
{
    static const char digits[] = "0123456789ABCDEF";
    unsigned i, n = 0;
    uint8_t sum = UNIT;

    if (how == mbm_server_beginTcp) {
        memcpy(frame, "\0\1\0\0", 4);
        frame[4] = (uint8_t)((length + 1) >> 8);
        frame[5] = (uint8_t)(length + 1);
        frame[6] = UNIT;
        memcpy(frame + 7, pdu, length);
        return length + 7;
    }
    if (how != mbm_server_beginAscii) {
        frame[0] = UNIT;
        memcpy(frame + 1, pdu, length);
        seal(frame, length + 1);
        return length + 3;
    }
    frame[n++] = ':';
    for (i = 0; i < length + 2; i++) {
        const uint8_t byte = i == 0 ? UNIT : i <= length ? pdu[i - 1] : (uint8_t)-sum;

        if (i > 0)
            sum = (uint8_t)(sum + byte);
        frame[n++] = (uint8_t)digits[byte >> 4];
        frame[n++] = (uint8_t)digits[byte & 15];
    }
    frame[n++] = '\r';
    frame[n++] = '\n';
    return n;
}

static void exchange(begin_function *how, const uint8_t *pdu, unsigned length)
{
    uint8_t frame[2 * MOST];

    put(frame, framed(frame, how, pdu, length));
    run();
}

/* Sends requests of every length, reads of every length, and functions that fill the whole
 * buffer. */
static void ask_everything(begin_function *how, unsigned pieces)
{
    uint8_t pdu[260] = {0x10, 0, 0};

    line.at_once = pieces;
    for (unsigned n = 1; n <= 123; n += n < 8 || n > 118 ? 1 : 9) {
        pdu[0] = 0x10;
        memset(pdu + 1, 0, 3);
        pdu[4] = (uint8_t)n;
        pdu[5] = (uint8_t)(2 * n);
        memset(pdu + 6, (int)n, 2 * n);
        exchange(how, pdu, 6 + 2 * n);
    }
    for (unsigned n = 1; n <= 125; n++) {
        const uint8_t read[] = {3, 0, 0, 0, (uint8_t)n};
        const uint8_t read_coils[] = {1, 0, 3, (uint8_t)(16 * n >> 8), (uint8_t)(16 * n - 3)};

        line.sent = 0;
        exchange(how, read, sizeof read);
        assert_int_not_equal(line.sent, 0);
        line.sent = 0;
        exchange(how, read_coils, sizeof read_coils);
        assert_int_not_equal(line.sent, 0);
    }
    pdu[0] = ECHO_CODE;
    for (unsigned n = 1; n <= 253; n += n < 20 || n > 245 ? 1 : 7)
        exchange(how, pdu, n);
}

/* Appends bytes that are no frame. */
static void noise(unsigned count, unsigned seed)
{
    for (unsigned i = 0; i < count; i++) {
        seed = seed * 1103515245 + 12345;
        line.bytes[line.length++] = (uint8_t)(seed >> 16);
    }
}

static void flood(begin_function *how, unsigned size)
{
    static const uint8_t read[] = {3, 0, 0, 0, 2};
    const unsigned counts[] = {1,        2,        3,        4,           size - 5, size - 4,
                               size - 3, size - 2, size - 1, size,        size + 1, size + 3,
                               size + 4, size + 5, 2 * size, 2 * size + 3};
    uint8_t frame[2 * MOST];

    for (unsigned pieces = 1; pieces <= MOST; pieces = pieces == 1   ? 3
                                                       : pieces == 3 ? MOST
                                                                     : MOST + 1) {
        for (unsigned i = 0; i < sizeof counts / sizeof counts[0]; i++) {
            assert_true(begin(how, size));
            line.at_once = pieces;
            noise(counts[i], i);
            run();
            /* And noise with a request right after it. */
            assert_true(begin(how, size));
            line.at_once = pieces;
            noise(counts[i], i);
            put(frame, framed(frame, how, read, sizeof read));
            run();
        }
    }
}

TEST(a_frame_of_each_framing_is_kept_inside_a_buffer_of_any_size)
{
    static begin_function *const all[] = {mbm_server_beginRtu, mbm_server_beginAscii,
                                          mbm_server_beginTcp, mbm_server_beginRtuOverTcp};
    static const unsigned least[] = {16, 32, 260, 16};

    for (unsigned how = 0; how < 4; how++) {
        for (unsigned size = least[how] - 1; size <= MOST;
             size += size < least[how] + 12 ? 1 : 61) {
            if (!begin(all[how], size)) {
                assert_int_equal(size, least[how] - 1);
                continue;
            }
            assert_int_not_equal(size, least[how] - 1);
            ask_everything(all[how], size % 2 ? 5 : MOST);
        }
    }
}

TEST(noise_of_any_length_is_kept_inside_the_buffer)
{
    for (unsigned size = 16; size <= 300; size += size < 24 ? 1 : 92)
        flood(mbm_server_beginRtu, size);
    flood(mbm_server_beginRtuOverTcp, 16);
    flood(mbm_server_beginRtuOverTcp, 41);
    flood(mbm_server_beginAscii, 32);
    flood(mbm_server_beginAscii, 33);
    /* Noise ends a TCP stream. */
    assert_true(begin(mbm_server_beginTcp, 260));
    noise(600, 1);
    for (unsigned size = 0; size < 100; size++)
        (void)mbm_server_poll(&server);
}

TEST(a_port_that_lies_is_kept_inside_the_buffer)
{
    static const uint8_t read[] = {3, 0, 0, 0, 2};
    uint8_t frame[2 * MOST];

    for (unsigned size = 16; size < 40; size++) {
        assert_true(begin(mbm_server_beginRtu, size));
        line.lies = 1;
        noise(3 * size, size);
        run();
        line.lies = 0;
        assert_true(begin(mbm_server_beginRtu, size));
        put(frame, framed(frame, mbm_server_beginRtu, read, sizeof read));
        for (unsigned turn = 0; turn < 40 && line.next < line.length; turn++)
            (void)mbm_server_poll(&server);
        line.lies = 1;
        run();
        assert_int_not_equal(line.sent, 0);
    }
}

TEST(an_echo_of_any_length_is_kept_inside_the_buffer)
{
    static const uint8_t read[] = {3, 0, 0, 0, 2};
    uint8_t frame[2 * MOST];

    unsigned length = framed(frame, mbm_server_beginRtu, read, sizeof read);
    for (unsigned size = 16; size < 24; size++) {
        for (unsigned pieces = 1; pieces < 12; pieces++) {
            for (unsigned more = 0; more < 3 * size; more += 5) {
                assert_true(begin(mbm_server_beginRtu, size));
                OK(mbm_server_setEchoDiscard(&server, 1));
                put(frame, length);
                run();
                line.at_once = pieces;
                noise(more, size);
                put(frame, length);
                run();
            }
        }
    }
}

static void prepare(void)
{
    unit.id = UNIT;
    holding.words = words;
    holding.size = WORDS;
    coils.bits = bits;
    coils.size = 2000;
    custom.serve = fill;
    custom.code = ECHO_CODE;
    OK(mbm_unit_serveHoldingRegisters(&unit, &holding));
    OK(mbm_unit_serveCoils(&unit, &coils));
    OK(mbm_unit_serveCustom(&unit, &custom));
}

static void finish(void)
{
    free(line.frame);
}

fixture all_tests = {prepare, finish};
