#define _GNU_SOURCE
#include "asked.h"
#include "await.h"
#include "crc.h"
#include "test.h"

#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

int asked_connect(modbus_t *client, int unit)
{
    if (!client || modbus_set_slave(client, unit) || modbus_connect(client))
        return -1;
    return modbus_set_response_timeout(client, PATIENCE_MS / 1000, 0);
}

void asked_reads(modbus_t *client)
{
    static const int quantities[] = {1, 2, 7, 8, 9, 64, 125};
    static const int bits[] = {1, 7, 8, 9, 16, 17, 1999, 2000};
    uint16_t words[MODBUS_MAX_READ_REGISTERS];
    uint8_t cells[MODBUS_MAX_READ_BITS];

    for (size_t q = 0; q < COUNT(quantities); q++) {
        int n = quantities[q];

        assert_int_equal(modbus_read_registers(client, SERVED_BASE + 3, n, words), n);
        for (int i = 0; i < n; i++)
            assert_int_equal(words[i], served_pattern((unsigned)(SERVED_BASE + 3 + i)));
        assert_int_equal(modbus_read_input_registers(client, SERVED_BASE + 5, n, words), n);
        for (int i = 0; i < n; i++)
            assert_int_equal(words[i], (uint16_t)~served_pattern((unsigned)(SERVED_BASE + 5 + i)));
    }
    for (size_t q = 0; q < COUNT(bits); q++) {
        int n = bits[q];

        assert_int_equal(modbus_read_bits(client, SERVED_BASE + 11, n, cells), n);
        for (int i = 0; i < n; i++)
            assert_int_equal(cells[i], served_bit_pattern((unsigned)(SERVED_BASE + 11 + i)));
        assert_int_equal(modbus_read_input_bits(client, SERVED_BASE + 1, n, cells), n);
        for (int i = 0; i < n; i++)
            assert_int_equal(cells[i], !served_bit_pattern((unsigned)(SERVED_BASE + 1 + i)));
    }
}

void asked_writes(modbus_t *client, served *s)
{
    uint16_t words[MODBUS_MAX_WR_WRITE_REGISTERS + 2], back[MODBUS_MAX_READ_REGISTERS];
    uint8_t cells[MODBUS_MAX_WRITE_BITS];
    unsigned i, before = s->written;

    assert_int_equal(modbus_write_register(client, SERVED_BASE, 0xABCD), 1);
    assert_int_equal(s->words[0], 0xABCD);
    assert_int_equal(modbus_write_bit(client, SERVED_BASE, 1), 1);
    assert_int_equal(s->bits[0] & 1, 1);
    assert_int_equal(modbus_write_bit(client, SERVED_BASE, 0), 1);
    assert_int_equal(s->bits[0] & 1, 0);
    assert_int_equal(s->written - before, 3);

    for (i = 0; i < MODBUS_MAX_WRITE_REGISTERS; i++)
        words[i] = (uint16_t)(i * 257);
    assert_int_equal(
        modbus_write_registers(client, SERVED_BASE + 20, MODBUS_MAX_WRITE_REGISTERS, words),
        MODBUS_MAX_WRITE_REGISTERS);
    assert_memory_equal(&s->words[20], words, 2 * MODBUS_MAX_WRITE_REGISTERS);
    for (i = 0; i < MODBUS_MAX_WRITE_BITS; i++)
        cells[i] = i % 3 == 0;
    uint16_t kept = s->bits[5 + MODBUS_MAX_WRITE_BITS / 8 + 1];
    assert_int_equal(modbus_write_bits(client, SERVED_BASE + 43, MODBUS_MAX_WRITE_BITS, cells),
                     MODBUS_MAX_WRITE_BITS);
    for (i = 0; i < MODBUS_MAX_WRITE_BITS; i++)
        assert_int_equal(s->bits[(43 + i) / 8] >> (43 + i) % 8 & 1, cells[i]);
    assert_int_equal(s->bits[5 + MODBUS_MAX_WRITE_BITS / 8 + 1], kept);

    s->words[1] = 0x0012;
    assert_int_equal(modbus_mask_write_register(client, SERVED_BASE + 1, 0x00F2, 0x0025), 1);
    assert_int_equal(s->words[1], 0x0017);
    for (i = 0; i < MODBUS_MAX_WR_WRITE_REGISTERS; i++)
        words[i] = (uint16_t)(i + 7);
    assert_int_equal(
        modbus_write_and_read_registers(client, SERVED_BASE + 2, MODBUS_MAX_WR_WRITE_REGISTERS,
                                        words, SERVED_BASE + 1, MODBUS_MAX_WR_READ_REGISTERS, back),
        MODBUS_MAX_WR_READ_REGISTERS);
    assert_int_equal(back[0], 0x0017);
    assert_memory_equal(&back[1], words, 2 * MODBUS_MAX_WR_WRITE_REGISTERS);
}

void asked_edges(modbus_t *client)
{
    const int last = SERVED_BASE + SERVED_REGISTERS - 1, last_bit = SERVED_BASE + SERVED_BITS - 1;
    uint16_t words[125] = {0};
    uint8_t cells[8] = {0};

    assert_int_equal(modbus_read_registers(client, last, 1, words), 1);
    EXCEPTION(2, modbus_read_registers(client, last, 2, words));
    EXCEPTION(2, modbus_read_registers(client, last + 1, 1, words));
    EXCEPTION(2, modbus_read_registers(client, SERVED_BASE - 1, 1, words));
    EXCEPTION(2, modbus_read_input_registers(client, last, 2, words));
    EXCEPTION(2, modbus_read_registers(client, 65535, 2, words));
    EXCEPTION(2, modbus_read_registers(client, SERVED_HOLE - 1, 2, words));
    EXCEPTION(2, modbus_write_register(client, SERVED_HOLE, 1));
    EXCEPTION(2, modbus_write_registers(client, last, 2, words));
    EXCEPTION(2, modbus_mask_write_register(client, last + 1, 0, 0));
    EXCEPTION(2, modbus_write_and_read_registers(client, last, 2, words, last, 1, words));
    EXCEPTION(2, modbus_write_and_read_registers(client, last, 1, words, last, 2, words));
    assert_int_equal(modbus_read_bits(client, last_bit, 1, cells), 1);
    EXCEPTION(2, modbus_read_bits(client, last_bit, 2, cells));
    EXCEPTION(2, modbus_read_input_bits(client, SERVED_BASE - 1, 1, cells));
    EXCEPTION(2, modbus_write_bit(client, last_bit + 1, 1));
    EXCEPTION(2, modbus_write_bits(client, last_bit, 2, cells));
}

void asked_refusals(modbus_t *client, served *s)
{
    const uint16_t words[] = {1, 0xBEEF, 3};
    const uint16_t before[] = {s->words[159], s->words[160], s->words[161]};
    uint16_t back[1];

    EXCEPTION(3, modbus_write_register(client, SERVED_REFUSED, 0xBEEF));
    EXCEPTION(3, modbus_write_registers(client, SERVED_REFUSED - 1, 3, words));
    EXCEPTION(3, modbus_write_and_read_registers(client, SERVED_REFUSED - 1, 3, words, SERVED_BASE,
                                                 1, back));
    assert_memory_equal(&s->words[159], before, sizeof before);
    assert_int_equal(modbus_write_register(client, SERVED_REFUSED, 0xBEEE), 1);
}

static uint8_t hex(int digit)
{
    return (uint8_t)(digit < 10 ? '0' + digit : 'A' + digit - 10);
}

/* Builds the frame of a PDU to a unit, without mbm. */
static size_t frame_of(int framing, uint8_t unit, const uint8_t *pdu, size_t length, uint8_t *frame)
{
    size_t i, n = 0;
    uint8_t sum = unit;

    switch (framing) {
    case MBM_FRAMING_TCP:
        frame[0] = 0xAB;
        frame[1] = 0xCD;
        frame[2] = frame[3] = 0;
        frame[4] = (uint8_t)((length + 1) >> 8);
        frame[5] = (uint8_t)(length + 1);
        frame[6] = unit;
        memcpy(frame + 7, pdu, length);
        return length + 7;
    case MBM_FRAMING_ASCII:
        frame[n++] = ':';
        for (i = 0; i <= length + 1; i++) {
            uint8_t byte = i == 0 ? unit : i <= length ? pdu[i - 1] : (uint8_t)-sum;

            frame[n++] = hex(byte >> 4);
            frame[n++] = hex(byte & 15);
            sum = (uint8_t)(i > 0 && i <= length ? sum + byte : sum);
        }
        frame[n++] = '\r';
        frame[n++] = '\n';
        return n;
    default:
        frame[0] = unit;
        memcpy(frame + 1, pdu, length);
        seal(frame, length + 1);
        return length + 3;
    }
}

/* How long to wait for bytes that should not come. */
enum { PAUSE_MS = 30 };

size_t asked_bytes(int fd, const uint8_t *bytes, size_t length, uint8_t *answer, size_t expected)
{
    struct pollfd readable = {fd, POLLIN, 0};
    size_t got = 0;

    assert_int_equal(write(fd, bytes, length), length);
    while (poll(&readable, 1, got < expected ? PATIENCE_MS : PAUSE_MS) > 0) {
        ssize_t count = read(fd, answer + got, 600 - got);

        if (count <= 0)
            break;
        got += (size_t)count;
    }
    return got;
}

int asked_is_served(int fd, uint8_t unit, uint8_t last)
{
    const uint8_t request[] = {0, 1, 0, 0, 0, 2, unit, 7};
    struct pollfd input = {fd, POLLIN, 0};
    uint8_t answer[9];

    if (send(fd, request, sizeof request, MSG_NOSIGNAL) != sizeof request)
        return 0;
    assert_int_equal(poll(&input, 1, PATIENCE_MS), 1);
    ssize_t count = recv(fd, answer, sizeof answer, 0);
    if (count <= 0)
        return 0;
    assert_int_equal(count, sizeof answer);
    assert_int_equal(answer[8], last);
    return 1;
}

void asked_frames(int fd, int framing, uint8_t unit, const uint8_t *pdu, size_t length,
                  const uint8_t *response, size_t expected)
{
    uint8_t frame[600], answer[600], wanted[600];
    size_t size = frame_of(framing, unit, pdu, length, frame);

    if (expected)
        expected = frame_of(framing, unit, response, expected, wanted);
    size_t got = asked_bytes(fd, frame, size, answer, expected);
    assert_int_equal(got, expected);
    assert_memory_equal(answer, wanted, expected);
}

/* Sends a request and expects a response; both string literals without their final zero byte. */
#define ANSWERS(request, response)                                                                 \
    asked_frames(fd, framing, SERVED_UNIT, (const uint8_t *)request, sizeof request - 1,           \
                 (const uint8_t *)response, sizeof response - 1)

void asked_functions(int fd, int framing, served *s)
{
    static const uint8_t long_query[253] = {8};
    uint8_t group[] = {0x14, 7, 6, 0, 4, 0, 0, 0, 20}, records[4 + 40] = {0x14, 42, 41, 6};

    ANSWERS("\x07", "\x07\x6D");
    ANSWERS("\x11", "\x11\x08mbm\xFFtest");
    ANSWERS("\x08\x00\x00\xA5\x37", "\x08\x00\x00\xA5\x37");
    asked_frames(fd, framing, SERVED_UNIT, long_query, sizeof long_query, long_query,
                 sizeof long_query);
    ANSWERS("\x08\x00\x01\xFF\x00", "\x08\x00\x01\xFF\x00");
    ANSWERS("\x03\x00\x00\x00\x01", "\x83\x02");
    ANSWERS("\x08\x00\x0D\x00\x00", "\x08\x00\x0D\x00\x01");
    ANSWERS("\x0B", "\x0B\x00\x00\x00\x01");
    /* The event log, the latest event first: received 80, sent 40, exception 41, restart 00. */
    ANSWERS("\x0C", "\x0C\x0F\x00\x00\x00\x01\x00\x04"
                    "\x80\x40\x80\x40\x80\x41\x80\x40\x00");
    ANSWERS("\x08\x00\x07\x00\x00", "\x88\x01");
    ANSWERS("\x18\x04\xDE", "\x18\x00\x06\x00\x02\x01\xB8\x12\x84");
    ANSWERS("\x18\x04\xDF", "\x98\x02");
    ANSWERS("\x15\x0B\x06\x00\x04\x00\x07\x00\x02\x12\x34\x56\x78",
            "\x15\x0B\x06\x00\x04\x00\x07\x00\x02\x12\x34\x56\x78");
    assert_int_equal(s->records[7], 0x1234);
    for (unsigned i = 0; i < 20; i++) {
        records[4 + 2 * i] = (uint8_t)(s->records[i] >> 8);
        records[5 + 2 * i] = (uint8_t)s->records[i];
    }
    asked_frames(fd, framing, SERVED_UNIT, group, sizeof group, records, sizeof records);
    ANSWERS("\x14\x07\x06\x00\x04\x00\x13\x00\x02", "\x94\x02");
    ANSWERS("\x2B\x0E\x01\x00",
            "\x2B\x0E\x01\x83\x00\x00\x03\x00\x05Maker\x01\x05Thing\x02\x04V1.0");
    ANSWERS("\x2B\x0E\x04\x80", "\x2B\x0E\x04\x83\x00\x00\x01\x80\x03own");
    ANSWERS("\x2B\x0E\x04\x44", "\xAB\x02");
    ANSWERS("\x41own data", "\x41own data");
    ANSWERS("\x41", "\xC1\x03");
    ANSWERS("\x42", "\xC2\x01");
    asked_frames(fd, framing, SERVED_UNIT + 1, (const uint8_t *)"\x06\x00\x03\x01\x02", 5,
                 (const uint8_t *)"\x06\x00\x03\x01\x02", 5);
    assert_int_equal(s->other_words[3], 0x0102);
    asked_frames(fd, framing, SERVED_UNIT + 2, (const uint8_t *)"\x07", 1, NULL, 0);
}

void asked_lies(int fd, int framing, served *s)
{
    uint16_t words[SERVED_REGISTERS];
    uint8_t bits[sizeof s->bits];

    memcpy(words, s->words, sizeof words);
    memcpy(bits, s->bits, sizeof bits);
    ANSWERS("\x03\x00\x64\x00\x00", "\x83\x03");
    ANSWERS("\x03\x00\x64\x00\x7E", "\x83\x03");
    ANSWERS("\x01\x00\x64\x07\xD1", "\x81\x03");
    ANSWERS("\x05\x00\x64\x00\x01", "\x85\x03");
    ANSWERS("\x10\x00\x64\x00\x00\x00", "\x90\x03");
    ANSWERS("\x10\x00\x64\x00\x02\x04\x00\x01\x00\x02", "\x10\x00\x64\x00\x02");
    s->words[0] = words[0];
    s->words[1] = words[1];
    ANSWERS("\x17\x00\x64\x00\x01\x00\x64\x00\x00\x00", "\x97\x03");
    ANSWERS("\x14\x00", "\x94\x03");
    if (framing != MBM_FRAMING_RTU_OVER_TCP) {
        /* Their byte counts are longer or shorter than the data. */
        ANSWERS("\x10\x00\x64\x00\x00\x00\x12\x34", "\x90\x03");
        ANSWERS("\x10\x00\x64\x00\x02\x02\x12\x34", "\x90\x03");
        ANSWERS("\x10\x00\x64\x00\x02\x04\x12\x34", "\x90\x03");
        ANSWERS("\x10\x00\x64\x00\x02\x04\x12\x34\x56\x78\x9A", "\x90\x03");
        ANSWERS("\x0F\x00\x64\x00\x09\x01\x12", "\x8F\x03");
        ANSWERS("\x03\x00\x64\x00", "\x83\x03");
        ANSWERS("\x03\x00\x64\x00\x01\x00", "\x83\x03");
    }
    assert_memory_equal(s->words, words, sizeof words);
    assert_memory_equal(s->bits, bits, sizeof bits);
}
