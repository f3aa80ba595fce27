/* A client with a link, over a port in memory with a clock of its own, for the tests of links.
 * The hooks of the link do what the test says and count. Include it in one file of a program. */
#ifndef LINKED_H
#define LINKED_H

#include "every_call.h"
#include "memory_port.h"
#include "test.h"

#include <stdio.h>
#include <string.h>

enum { UNIT = 7, MS = 1000 };

static memory_port m;
static mbm_client client;
static mbm_link kept;
static mbm_linkCounters counters;
static mbm_clientRequest request, other;
static uint8_t frame[MBM_MAX_ASCII_FRAME], outgoing[MBM_MAX_TCP_FRAME];
static uint16_t words[4];

static const uint8_t framings[] = {MBM_FRAMING_RTU, MBM_FRAMING_ASCII, MBM_FRAMING_TCP,
                                   MBM_FRAMING_RTU_OVER_TCP};
__attribute__((unused)) static const uint8_t streams[] = {MBM_FRAMING_TCP,
                                                          MBM_FRAMING_RTU_OVER_TCP};

/* What the hooks do, what they found, and what the callback received. */
static uint8_t connects_with, status_is;
static unsigned connects, disconnects;
static uint32_t connected_at;
static char events[400];
static void (*within)(void);

static inline void disconnect(void *context)
{
    assert_ptr_equal(context, &m);
    disconnects++;
    if (within)
        within();
}

static inline uint8_t connect_hook(void *context)
{
    assert_ptr_equal(context, &m);
    connects++;
    connected_at = m.now;
    if (within)
        within();
    m.is_lost = connects_with != MBM_OK;
    return connects_with;
}

static inline uint8_t status_hook(void *context)
{
    assert_ptr_equal(context, &m);
    if (within)
        within();
    return status_is;
}

static const mbm_linkHooks hooks = {
    .context = &m, .disconnect = disconnect, .connect = connect_hook, .status = status_hook};

static inline void changed(void *context, uint8_t event, uint8_t status)
{
    const size_t length = strlen(events);

    assert_ptr_equal(context, &kept);
    (void)snprintf(events + length, sizeof events - length, "%c%02X ", "CLF"[event], status);
}

static inline void begin_client(int framing)
{
    const mbm_port port = memory_port_of(&m);

    OK(CLIENT_BEGIN(&client, framing, &port, frame, outgoing));
    if (framing == MBM_FRAMING_TCP)
        OK(mbm_client_setInFlight(&client, MBM_CLIENT_DEPTH));
    OK(mbm_client_setResponseTimeout(&client, 300));
    OK(mbm_client_setQuietTime(&client, 0));
}

/* A client with a link that is not open yet. */
static inline void begin(int framing)
{
    memset(&m, 0, sizeof m);
    memset(&client, 0, sizeof client);
    memset(&kept, 0, sizeof kept);
    memset(&counters, 0, sizeof counters);
    request = other = (mbm_clientRequest){.unit = UNIT, .reply = words, .replyBytes = sizeof words};
    connects = disconnects = 0;
    connects_with = MBM_OK;
    status_is = MBM_LINK_LOST;
    events[0] = '\0';
    within = NULL;
    begin_client(framing);
    OK(mbm_link_begin(&kept, &client, &hooks));
    OK(mbm_link_setCallback(&kept, changed, &kept));
    OK(mbm_link_setCounters(&kept, &counters));
}

static inline void begin_up(int framing)
{
    begin(framing);
    OK(mbm_client_poll(&client));
    assert_int_equal(mbm_link_state(&kept), MBM_LINK_IS_UP);
    events[0] = '\0';
}

static inline void queue_read(mbm_clientRequest *which)
{
    IS(MBM_PENDING, mbm_client_readHoldingRegisters(&client, which, 0, 1));
}

/* Delivers the right reply to the request that was sent last. */
static inline void answer(int framing)
{
    static const uint8_t rtu[] = {UNIT, 3, 2, 0x12, 0x34};
    uint8_t tcp[] = {0, 0, 0, 0, 0, 5, UNIT, 3, 2, 0x12, 0x34};

    if (framing == MBM_FRAMING_ASCII) {
        memory_port_bytes(&m, (const uint8_t *)":0703021234AE\r\n", 15);
    } else if (framing == MBM_FRAMING_TCP) {
        memcpy(tcp, m.sent, 2);
        memory_port_bytes(&m, tcp, sizeof tcp);
    } else {
        memory_port_rtu(&m, rtu, sizeof rtu);
    }
}

/* Sends a read and delivers its right reply. */
static inline void reads_right(int framing)
{
    queue_read(&request);
    memory_port_send(&m, &client);
    answer(framing);
    IS(MBM_OK, memory_port_run(&m, &client, &request, 1000));
    assert_int_equal(words[0], 0x1234);
}

/* Polls for a time, each time after the time of pollDelay. */
static inline void run(uint32_t ms)
{
    const uint32_t end = m.now + ms * MS;

    while ((int32_t)(end - m.now) > 0) {
        uint32_t delay = mbm_client_pollDelay(&client);

        if (delay > end - m.now)
            delay = end - m.now;
        m.now += delay > 0 ? delay : 1;
        (void)mbm_client_poll(&client);
    }
}

/* Polls until one more attempt was made. Returns after how many ms that was. */
static inline uint32_t next_attempt(void)
{
    const uint32_t before = m.now;
    const unsigned count = connects;
    unsigned polls;

    for (polls = 0; polls < 10000 && connects == count; polls++) {
        const uint32_t delay = mbm_client_pollDelay(&client);

        m.now += delay;
        (void)mbm_client_poll(&client);
        if (delay == 0)
            m.now++;
    }
    assert_int_equal(connects, count + 1);
    return (connected_at - before + MS / 2) / MS;
}

static inline uint32_t half(void *context)
{
    assert_ptr_equal(context, &m);
    return 1u << 31;
}

#endif
