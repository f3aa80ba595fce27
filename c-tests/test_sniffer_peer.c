/* The sniffer on a line between a libmodbus client and a libmodbus server. A thread passes
 * the bytes on and feeds them to the sniffer. */
#define _GNU_SOURCE
#include "await.h"
#include "mbm.h"
#include "pty.h"
#include "server.h"
#include "tcp_server.h"
#include "test.h"

#include <poll.h>
#include <sys/socket.h>
#include <time.h>
#include <unistd.h>

enum { EVENTS = 64, CALLS = 12 };

/* A copy of an event. */
typedef struct reported {
    mbm_event event;
    uint8_t pdu[MBM_MAX_PDU];
    char text[400];
} reported;

typedef struct tap {
    mbm_sniffer sniffer;
    uint8_t buffer[2 * MBM_MAX_TCP_FRAME];
    int client, server, stop[2];
    uint32_t begun;
    uint8_t from_client, from_server;
    pthread_t thread;
    reported events[EVENTS];
    unsigned count;
} tap;

static tap line;

static uint32_t micros(void)
{
    struct timespec time;

    clock_gettime(CLOCK_MONOTONIC, &time);
    return (uint32_t)time.tv_sec * 1000000u + (uint32_t)time.tv_nsec / 1000u;
}

static void keep_events(void)
{
    mbm_event event;

    while (mbm_sniffer_next(&line.sniffer, micros(), &event)) {
        reported *t = &line.events[line.count++ % EVENTS];

        t->event = event;
        if (event.pduLength)
            memcpy(t->pdu, event.pdu, event.pduLength);
        mbm_event_text(&event, t->text, sizeof t->text);
    }
}

static void pass_on(int from, int to, uint8_t tap_kind)
{
    uint8_t bytes[300];
    ssize_t length = read(from, bytes, sizeof bytes);
    uint16_t fed = 0;

    while (length > 0 && fed < length) {
        fed = (uint16_t)(fed + mbm_sniffer_feed(&line.sniffer, tap_kind, bytes + fed,
                                                (uint16_t)(length - fed), micros()));
        keep_events();
    }
    if (length > 0 && write(to, bytes, (size_t)length) != length)
        abort();
}

static void *forward(void *context)
{
    for (;;) {
        struct pollfd waits[3] = {
            {line.client, POLLIN, 0}, {line.server, POLLIN, 0}, {line.stop[0], POLLIN, 0}};

        poll(waits, 3, 5);
        if (waits[2].revents)
            return NULL;
        if (waits[0].revents & POLLIN)
            pass_on(line.client, line.server, line.from_client);
        if (waits[1].revents & POLLIN)
            pass_on(line.server, line.client, line.from_server);
        keep_events();
    }
}

static void listen_between(int client, int far_end, uint8_t framing, uint8_t apart)
{
    memset(&line, 0, sizeof line);
    if (framing == MBM_FRAMING_TCP)
        OK(mbm_sniffer_begin(&line.sniffer, MBM_FRAMING_TCP, line.buffer, sizeof line.buffer));
    else
        OK(mbm_sniffer_begin(&line.sniffer, MBM_FRAMING_RTU, line.buffer, sizeof line.buffer));
    OK(mbm_sniffer_setResponseTimeout(&line.sniffer, PATIENCE_MS));
    line.begun = micros();
    line.client = client;
    line.server = far_end;
    line.from_client = apart ? MBM_DIRECTION_CLIENT : MBM_DIRECTION_BOTH;
    line.from_server = apart ? MBM_DIRECTION_SERVER : MBM_DIRECTION_BOTH;
    assert_int_equal(pipe(line.stop), 0);
    assert_int_equal(pthread_create(&line.thread, NULL, forward, NULL), 0);
}

static void stop_listening(void)
{
    assert_int_equal(write(line.stop[1], "", 1), 1);
    pthread_join(line.thread, NULL);
    close(line.stop[0]);
    close(line.stop[1]);
}

/* Calls each function that the client has. */
static void run(modbus_t *client)
{
    const uint16_t words[2] = {0x1234, 0xABCD};
    const uint8_t on[3] = {1, 0, 1};
    uint8_t bits[100];
    uint16_t registers[125];

    assert_int_equal(modbus_set_response_timeout(client, PATIENCE_MS / 1000, 0), 0);
    assert_int_equal(modbus_read_bits(client, 3, 19, bits), 19);
    assert_int_equal(modbus_read_input_bits(client, 5, 8, bits), 8);
    assert_int_equal(modbus_read_registers(client, 7, 125, registers), 125);
    assert_int_equal(modbus_read_input_registers(client, 9, 2, registers), 2);
    assert_int_equal(modbus_write_bit(client, 1, 1), 1);
    assert_int_equal(modbus_write_register(client, 2, 0x0A0B), 1);
    assert_int_equal(modbus_write_bits(client, 30, 3, on), 3);
    assert_int_equal(modbus_write_registers(client, 40, 2, words), 2);
    assert_int_equal(modbus_report_slave_id(client, sizeof bits, bits) > 0, 1);
    assert_int_equal(modbus_mask_write_register(client, 2, 0xFF00, 0x0012), 1);
    assert_int_equal(modbus_write_and_read_registers(client, 50, 1, words, 40, 2, registers), 2);
    assert_int_equal(modbus_read_registers(client, SERVER_REGISTERS, 1, registers), -1);
}

static const uint8_t functions[CALLS] = {1, 2, 3, 4, 5, 6, 15, 16, 17, 22, 23, 3};

/* Compares the events with the calls and with the server's memory. */
static void assert_all_reported(const modbus_mapping_t *mapping)
{
    const reported *t = line.events;
    uint32_t took = micros() - line.begun;

    for (unsigned i = 0; i < line.count; i++) {
        uint8_t kind = i % 2 == 0           ? MBM_EVENT_REQUEST
                       : i == 2 * CALLS - 1 ? MBM_EVENT_EXCEPTION
                                            : MBM_EVENT_REPLY;

        if (t[i].event.kind != kind || t[i].event.function != functions[i / 2])
            fail_msg("event %u: %s", i, t[i].text);
        assert_true(t[i].event.kind == MBM_EVENT_REQUEST || t[i].event.responseTimeUs < took);
    }
    assert_int_equal(line.count, 2 * CALLS);
    for (unsigned i = 0; i < 19; i++)
        assert_int_equal(t[1].pdu[2 + i / 8] >> i % 8 & 1, server_bit_pattern(3 + i));
    assert_int_equal(t[1].event.address, 3);
    assert_int_equal(t[1].event.quantity, 19);
    for (unsigned i = 0; i < 125; i++)
        assert_int_equal(t[5].pdu[2 + 2 * i] << 8 | t[5].pdu[3 + 2 * i], server_pattern(7 + i));
    assert_int_equal(t[5].event.address, 7);
    assert_int_equal(t[7].pdu[2] << 8 | t[7].pdu[3], mapping->tab_input_registers[9]);
    assert_string_equal(strchr(t[8].text, '0'), "05 write single coil  1: on");
    assert_string_equal(strchr(t[11].text, '0'), "06 write single register  2: 2571");
    assert_non_null(strstr(t[12].text, "0F write multiple coils  30..32: 101"));
    assert_non_null(strstr(t[14].text, "10 write multiple registers  40..41: 4660 43981"));
    assert_non_null(strstr(t[19].text, "16 mask write register  2: and FF00 or 0012"));
    assert_non_null(strstr(t[20].text, "read 40..41, write 50: 4660"));
    assert_non_null(strstr(t[21].text, "40..41: 4660 43981"));
    IS(MBM_ILLEGAL_DATA_ADDRESS, t[23].event.status);
}

TEST(frames_of_libmodbus_on_a_serial_line_are_reported)
{
    static server device;
    pty ours;

    server_start(&device, 17);
    pty_open(&ours);
    listen_between(ours.ours, device.line.ours, MBM_FRAMING_RTU, 0);
    modbus_t *client = modbus_new_rtu(ours.path, 115200, 'N', 8, 1);
    assert_non_null(client);
    modbus_set_slave(client, 17);
    assert_int_equal(modbus_connect(client), 0);
    run(client);
    stop_listening();
    assert_all_reported(device.mapping);
    modbus_close(client);
    modbus_free(client);
    server_stop(&device);
    pty_close(&ours);
}

static void over_tcp(uint8_t apart)
{
    tcp_server device;
    uint16_t port;

    tcp_server_start(&device);
    int to_server = tcp_connectTo(device.port);
    int proxy = tcp_listenOnFree(&port);
    modbus_t *client = modbus_new_tcp("127.0.0.1", port);
    modbus_set_slave(client, 17);
    assert_int_equal(modbus_connect(client), 0);
    int to_client = accept(proxy, NULL, NULL);
    assert_true(to_client >= 0);
    listen_between(to_client, to_server, MBM_FRAMING_TCP, apart);
    run(client);
    stop_listening();
    assert_all_reported(device.mapping);
    modbus_close(client);
    modbus_free(client);
    close(to_server);
    close(to_client);
    close(proxy);
    tcp_server_stop(&device);
}

TEST_ROW(frames_of_libmodbus_over_tcp_are_reported, over_tcp(0))
TEST_ROW(frames_of_libmodbus_over_tcp_are_reported_with_known_direction, over_tcp(1))
