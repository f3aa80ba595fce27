/* The client against libmodbus, RTU over a pty and TCP over loopback, and how the client
 * refuses bad calls. */
#define _GNU_SOURCE
#include "await.h"
#include "client.h"
#include "server.h"
#include "tcp_server.h"
#include "test.h"

#include <sys/socket.h>

enum { UNIT = 17 };

static asker a;

static void ends(uint8_t status, mbm_clientRequest *request, uint8_t queued)
{
    IS(MBM_PENDING, queued);
    IS(MBM_PENDING, request->status);
    assert_int_equal(asker_wait(&a, request), status);
}

/* Calls every function that libmodbus's server has, and compares with the server's memory. */
static void every_function_of_libmodbus(modbus_mapping_t *memory)
{
    uint16_t words[125], values[] = {0x1234, 0xFEDC, 7};
    uint8_t bits[250], coils[] = {0xCD, 0x01};
    mbm_client *c = &a.client;
    mbm_clientRequest r = asker_request(UNIT, bits, sizeof bits, NULL);

    ends(MBM_OK, &r, mbm_client_readCoils(c, &r, 3, 1999));
    assert_int_equal(r.length, 250);
    for (unsigned i = 0; i < 1999; i++)
        assert_int_equal(bits[i / 8] >> i % 8 & 1, memory->tab_bits[3 + i]);
    ends(MBM_OK, &r, mbm_client_readDiscreteInputs(c, &r, 5, 13));
    assert_int_equal(r.length, 2);
    assert_int_equal(bits[1] >> 5, 0);
    for (unsigned i = 0; i < 13; i++)
        assert_int_equal(bits[i / 8] >> i % 8 & 1, memory->tab_input_bits[5 + i]);
    ends(MBM_OK, &r, mbm_client_readCoils(c, &r, 9, 1));
    assert_int_equal(bits[0], memory->tab_bits[9]);
    ends(MBM_OK, &r, mbm_client_readDiscreteInputs(c, &r, 9, 1));
    assert_int_equal(bits[0], memory->tab_input_bits[9]);

    r = asker_request(UNIT, words, sizeof words, NULL);
    ends(MBM_OK, &r, mbm_client_readHoldingRegisters(c, &r, 2, 125));
    assert_int_equal(r.length, 250);
    assert_memory_equal(words, memory->tab_registers + 2, 250);
    ends(MBM_OK, &r, mbm_client_readInputRegisters(c, &r, 4, 3));
    assert_memory_equal(words, memory->tab_input_registers + 4, 6);
    ends(MBM_OK, &r, mbm_client_readHoldingRegisters(c, &r, 6, 1));
    assert_int_equal(words[0], memory->tab_registers[6]);
    ends(MBM_OK, &r, mbm_client_readInputRegisters(c, &r, 6, 1));
    assert_int_equal(words[0], memory->tab_input_registers[6]);

    r = asker_request(UNIT, NULL, 0, NULL);
    ends(MBM_OK, &r, mbm_client_writeSingleCoil(c, &r, 11, 1));
    assert_int_equal(memory->tab_bits[11], 1);
    ends(MBM_OK, &r, mbm_client_writeSingleCoil(c, &r, 11, 0));
    assert_int_equal(memory->tab_bits[11], 0);
    ends(MBM_OK, &r, mbm_client_writeSingleRegister(c, &r, 12, 0xBEEF));
    assert_int_equal(memory->tab_registers[12], 0xBEEF);
    r.data = coils;
    ends(MBM_OK, &r, mbm_client_writeMultipleCoils(c, &r, 20, 9));
    for (unsigned i = 0; i < 9; i++)
        assert_int_equal(memory->tab_bits[20 + i], coils[i / 8] >> i % 8 & 1);
    r.data = values;
    ends(MBM_OK, &r, mbm_client_writeMultipleRegisters(c, &r, 30, 3));
    assert_memory_equal(values, memory->tab_registers + 30, 6);
    memory->tab_registers[40] = 0x12;
    ends(MBM_OK, &r, mbm_client_maskWriteRegister(c, &r, 40, 0xF2, 0x25));
    assert_int_equal(memory->tab_registers[40], 0x17);

    r = asker_request(UNIT, words, sizeof words, values);
    ends(MBM_OK, &r, mbm_client_readWriteMultipleRegisters(c, &r, 50, 4, 51, 2));
    assert_int_equal(r.length, 8);
    assert_memory_equal(words + 1, values, 4);
    assert_memory_equal(words, memory->tab_registers + 50, 8);
    r = asker_request(UNIT, bits, sizeof bits, NULL);
    ends(MBM_OK, &r, mbm_client_reportServerId(c, &r));
    assert_true(r.length > 2 && memcmp(bits + 2, "LMB", 3) == 0);

    ends(MBM_ILLEGAL_DATA_ADDRESS, &r, mbm_client_readHoldingRegisters(c, &r, 65000, 1));
    assert_int_equal(r.exception, 2);
    assert_int_equal(r.length, 0);
}

TEST(every_function_over_a_pty)
{
    server s;

    server_start(&s, UNIT);
    asker_begin_rtu(&a, s.line.ours);
    every_function_of_libmodbus(s.mapping);
    assert_int_equal(a.counters.foreignFrames, 0);
    server_stop(&s);
}

TEST(every_function_over_tcp)
{
    tcp_server s;

    tcp_server_start(&s);
    asker_begin_tcp(&a, s.port);
    every_function_of_libmodbus(s.mapping);
    mbm_tcp_close(&a.tcp);
    tcp_server_stop(&s);
}

TEST(sixteen_requests_are_pipelined)
{
    mbm_clientRequest requests[MBM_CLIENT_DEPTH + 1];
    uint16_t words[MBM_CLIENT_DEPTH][10];
    tcp_server s;
    unsigned i;

    tcp_server_start(&s);
    asker_begin_tcp(&a, s.port);
    OK(mbm_client_setInFlight(&a.client, MBM_CLIENT_DEPTH));
    for (unsigned round = 0; round < 20; round++) {
        for (i = 0; i < MBM_CLIENT_DEPTH; i++) {
            requests[i] = asker_request(UNIT, words[i], sizeof words[i], NULL);
            requests[i].transaction = (uint16_t)(i + 1);
            IS(MBM_PENDING,
               mbm_client_readHoldingRegisters(&a.client, &requests[i], (uint16_t)(10 * i), 10));
        }
        requests[i] = asker_request(UNIT, NULL, 0, NULL);
        IS(MBM_QUEUE_FULL, mbm_client_readHoldingRegisters(&a.client, &requests[i], 0, 1));
        asker_wait_all(&a);
        for (i = 0; i < MBM_CLIENT_DEPTH; i++) {
            OK(requests[i].status);
            assert_memory_equal(words[i], s.mapping->tab_registers + 10 * i, 20);
        }
    }
    assert_int_equal(a.counters.replies, 20 * MBM_CLIENT_DEPTH);
    mbm_tcp_close(&a.tcp);
    tcp_server_stop(&s);
}

TEST(a_lost_connection_is_reported_and_made_anew)
{
    mbm_clientRequest r = asker_request(UNIT, NULL, 0, NULL);
    mbm_clientRequest waiting = asker_request(UNIT, NULL, 0, NULL);
    tcp_server s;

    tcp_server_start(&s);
    asker_begin_tcp(&a, s.port);
    ends(MBM_OK, &r, mbm_client_readHoldingRegisters(&a.client, &r, 0, 1));
    assert_true(mbm_client_isConnected(&a.client));
    shutdown(a.tcp.fd, SHUT_RDWR);
    IS(MBM_PENDING, mbm_client_readHoldingRegisters(&a.client, &r, 0, 1));
    IS(MBM_PENDING, mbm_client_readHoldingRegisters(&a.client, &waiting, 0, 1));
    asker_wait_all(&a);
    IS(MBM_LINK_LOST, r.status);
    IS(MBM_LINK_LOST, waiting.status);
    assert_false(mbm_client_isConnected(&a.client));
    IS(MBM_PENDING, mbm_client_reconnect(&a.client, &a.link));
    assert_false(mbm_client_isConnected(&a.client));
    ends(MBM_OK, &r, mbm_client_readHoldingRegisters(&a.client, &r, 0, 1));
    assert_true(mbm_client_isConnected(&a.client));
    mbm_tcp_close(&a.tcp);
    tcp_server_stop(&s);
}

static unsigned called;
static uint8_t polled_inside;

/* Queues the request again, three times, and tries a poll, which is refused. */
static void queue_again(void *context, mbm_clientRequest *request)
{
    assert_ptr_equal(context, &a);
    OK(request->status);
    polled_inside = mbm_client_poll(&a.client);
    if (++called < 4)
        IS(MBM_PENDING, mbm_client_readHoldingRegisters(&a.client, request, 0, 1));
}

TEST(a_callback_may_queue_and_may_not_poll)
{
    mbm_clientRequest r = asker_request(UNIT, NULL, 0, NULL);
    tcp_server s;

    tcp_server_start(&s);
    asker_begin_tcp(&a, s.port);
    called = 0;
    r.done = queue_again;
    r.context = &a;
    IS(MBM_PENDING, mbm_client_readHoldingRegisters(&a.client, &r, 0, 1));
    IS(MBM_BUSY, mbm_client_readHoldingRegisters(&a.client, &r, 0, 1));
    asker_wait_all(&a);
    assert_int_equal(called, 4);
    IS(MBM_BUSY, polled_inside);
    mbm_tcp_close(&a.tcp);
    tcp_server_stop(&s);
}

TEST(the_master_uses_the_line_between_the_clients_requests)
{
    uint16_t words[4], more[4], none[1];
    uint8_t frame[64];
    mbm_line line = MBM_INIT;
    mbm_node master = MBM_INIT;
    mbm_clientRequest r = asker_request(UNIT, words, sizeof words, NULL);
    server s;

    server_start(&s, UNIT);
    asker_begin_rtu(&a, s.line.ours);
    OK(mbm_line_setFrame(&line, frame, sizeof frame));
    OK(mbm_node_begin(&master, &line, UNIT, more, 4, none, 1));
    IS(MBM_NOT_INITIALISED, mbm_node_readHoldingRegisters(&master, 0, 4));
    IS(MBM_PENDING, mbm_client_readHoldingRegisters(&a.client, &r, 0, 4));
    (void)mbm_client_poll(&a.client);
    IS(MBM_BUSY, mbm_client_suspend(&a.client, &line));
    asker_wait_all(&a);
    OK(mbm_client_suspend(&a.client, &line));
    IS(MBM_BUSY, mbm_client_suspend(&a.client, &line));
    IS(MBM_PENDING, mbm_client_readHoldingRegisters(&a.client, &r, 0, 4));
    IS(MBM_BUSY, mbm_client_poll(&a.client));
    a.port.idle = NULL;
    OK(mbm_node_setBlocking(&master, 0));
    OK(mbm_node_setResponseTimeout(&master, PATIENCE_MS));
    IS(MBM_PENDING, mbm_node_readHoldingRegisters(&master, 0, 4));
    IS(MBM_BUSY, mbm_client_resume(&a.client, &line));
    while (mbm_node_poll(&master) == MBM_PENDING)
        ;
    OK(mbm_node_status(&master));
    OK(mbm_client_resume(&a.client, &line));
    IS(MBM_INVALID_ARGUMENT, mbm_client_resume(&a.client, &line));
    OK(asker_wait(&a, &r));
    assert_memory_equal(words, more, sizeof words);
    IS(MBM_NOT_INITIALISED, mbm_node_readHoldingRegisters(&master, 0, 4));
    server_stop(&s);
}

TEST(a_master_gets_no_line_that_carries_other_frames)
{
    static mbm_client tcp, ascii;
    static mbm_line line;
    pty wire;

    pty_open(&wire);
    memset(&a, 0, sizeof a);
    assert_int_equal(mbm_tty_attach(&a.tty, wire.ours), 0);
    a.port = mbm_tty_port(&a.tty);
    OK(mbm_client_beginTcp(&tcp, &a.port, a.incoming, 260, a.outgoing, 260));
    IS(MBM_INVALID_ARGUMENT, mbm_client_suspend(&tcp, &line));
    OK(mbm_client_beginAscii(&ascii, &a.port, a.incoming, 513));
    IS(MBM_INVALID_ARGUMENT, mbm_client_suspend(&ascii, &line));
    OK(mbm_client_poll(&ascii));
    /* A program may suspend a TCP client for a purpose of its own. */
    OK(mbm_client_suspend(&tcp, NULL));
    OK(mbm_client_resume(&tcp, NULL));
    pty_close(&wire);
}

TEST(bad_calls_are_refused_with_a_status)
{
    static mbm_client fresh;
    uint16_t words[2];
    mbm_clientRequest r = asker_request(UNIT, words, sizeof words, NULL), other;
    mbm_port nothing = {0};
    mbm_client *c = &a.client;
    server s;

    server_start(&s, UNIT);
    asker_begin_rtu(&a, s.line.ours);
    IS(MBM_INVALID_ARGUMENT, mbm_client_beginRtu(&fresh, &nothing, a.outgoing, 256));

    IS(MBM_BUFFER_TOO_SMALL, mbm_client_readHoldingRegisters(c, &r, 0, 3));
    IS(MBM_INVALID_ARGUMENT, mbm_client_writeMultipleRegisters(c, &r, 0, 1));
    IS(MBM_ILLEGAL_DATA_VALUE, mbm_client_readDeviceIdentification(c, &r, 5, 0));
    IS(MBM_ILLEGAL_DATA_ADDRESS, mbm_client_readFileRecord(c, &r, 0, 0, 1));
    IS(MBM_ILLEGAL_DATA_ADDRESS, mbm_client_readFileRecord(c, &r, 1, 9999, 2));
    IS(MBM_INVALID_ARGUMENT, mbm_client_custom(c, &r, 0x41, 0, NULL));
    IS(MBM_INVALID_ARGUMENT, r.status);
    assert_int_equal(mbm_client_pending(c), 0);

    r.unit = UNIT;
    other = r;
    IS(MBM_NOT_PENDING, mbm_client_cancel(c, &r));
    IS(MBM_PENDING, mbm_client_readHoldingRegisters(c, &r, 0, 2));
    IS(MBM_PENDING, mbm_client_readHoldingRegisters(c, &other, 0, 2));
    assert_int_equal(mbm_client_pending(c), 2);
    (void)mbm_client_poll(c);
    OK(mbm_client_cancel(c, &r));
    OK(mbm_client_cancel(c, &other));
    IS(MBM_NOT_PENDING, mbm_client_cancel(c, &r));
    IS(MBM_CANCELLED, r.status);
    IS(MBM_INVALID_ARGUMENT, mbm_client_cancel(c, NULL));
    assert_int_equal(mbm_client_pending(c), 0);
    OK(mbm_client_poll(c));
    server_stop(&s);
}

TEST(a_broadcast_arrives_and_the_delay_after_it_is_kept)
{
    mbm_clientUnit units[1] = {{0}};
    mbm_clientRequest r = asker_request(0, NULL, 0, NULL);
    server s;

    server_start(&s, UNIT);
    asker_begin_rtu(&a, s.line.ours);
    ends(MBM_OK, &r, mbm_client_writeSingleRegister(&a.client, &r, 5, 0x5A5A));
    AWAIT(s.mapping->tab_registers[5] == 0x5A5A);
    units[0].unit = UNIT;
    units[0].delayUs = 50000;
    OK(mbm_client_setUnits(&a.client, units, 1));
    r.unit = UNIT;
    ends(MBM_OK, &r, mbm_client_readHoldingRegisters(&a.client, &r, 0, 1));
    uint32_t begun = a.port.micros(a.port.context);
    ends(MBM_OK, &r, mbm_client_readHoldingRegisters(&a.client, &r, 0, 1));
    assert_true(a.port.micros(a.port.context) - begun >= 49000);
    assert_int_equal(units[0].requests, 2);
    assert_int_equal(units[0].replies, 2);
    server_stop(&s);
}
