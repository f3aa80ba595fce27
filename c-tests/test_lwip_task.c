/* The port for lwIP's raw API in tasks, beside lwIP's own thread: each call takes the lock of the
 * core, as Debian's lwIP checks. The peers are libmodbus's client and server, through a relay. */
#include "await.h"
#include "lwip_relay.h"
#include "mbm_lwip.h"
#include "server.h"
#include "tcp_server.h"
#include "test.h"

#include "lwip/sys.h"

#include <modbus.h>
#include <pthread.h>
#include <stdatomic.h>

enum { PLACES = 4, REGISTERS = 100, PORT = 502, TO_LIBMODBUS = 1502, RESETS = 10 };

/* --- a task that sleeps until lwIP has news for it */

static void wake(void *context)
{
    sys_sem_signal(context);
}

/* Of lwIP's sleeps, one of 0 ms lasts for ever. */
static void sleep_until(sys_sem_t *news, uint32_t us)
{
    if (us != 0)
        (void)sys_arch_sem_wait(news, us == UINT32_MAX ? 0 : us / 1000 + 1);
}

/* --- the server's task */

static uint16_t words[REGISTERS];
static mbm_registerTable holding;
static mbm_unit unit;
static mbm_lwip_listener listener;
static mbm_lwip places[PLACES];
static mbm_server servers[PLACES];
static uint8_t frames[PLACES][MBM_MAX_TCP_FRAME];
static sys_sem_t server_news;
static atomic_int stop;
static atomic_uint served; /* connections */
static pthread_t server_task;

static void *run_server(void *none)
{
    while (!stop) {
        uint32_t delay = UINT32_MAX;
        int i;

        while ((i = mbm_lwip_accept(&listener)) >= 0) {
            const mbm_port port = mbm_lwip_port(&places[i]);

            OK(mbm_server_beginTcp(&servers[i], &port, &unit, 1, frames[i], sizeof frames[i]));
            served++;
        }
        for (i = 0; i < PLACES; i++) {
            if (!mbm_lwip_isInUse(&places[i]))
                continue;
            if (mbm_server_poll(&servers[i]) != MBM_OK)
                mbm_lwip_close(&places[i]);
            else if (mbm_server_pollDelay(&servers[i]) < delay)
                delay = mbm_server_pollDelay(&servers[i]);
        }
        sleep_until(&server_news, delay);
    }
    return NULL;
}

static void begin(void)
{
    int i;

    relay_begin();
    memset(&listener, 0, sizeof listener);
    memset(places, 0, sizeof places);
    memset(servers, 0, sizeof servers);
    for (i = 0; i < REGISTERS; i++)
        words[i] = (uint16_t)(i * 0x101 + 1);
    memset(&holding, 0, sizeof holding);
    memset(&unit, 0, sizeof unit);
    holding.words = words;
    holding.size = REGISTERS;
    unit.id = 1;
    OK(mbm_unit_serveHoldingRegisters(&unit, &holding));
    assert_int_equal(sys_sem_new(&server_news, 0), ERR_OK);
    listener.isTask = 1;
    listener.ready = wake;
    listener.context = &server_news;
    for (i = 0; i < PLACES; i++) {
        places[i].ready = wake;
        places[i].context = &server_news;
    }
    OK(mbm_lwip_listen(&listener, NULL, PORT, places, PLACES));
    stop = 0;
    served = 0;
    assert_int_equal(pthread_create(&server_task, NULL, run_server, NULL), 0);
}

static void end(void)
{
    int i;

    stop = 1;
    sys_sem_signal(&server_news);
    pthread_join(server_task, NULL);
    mbm_lwip_closeListener(&listener);
    for (i = 0; i < PLACES; i++)
        mbm_lwip_close(&places[i]);
    AWAIT(relay_count() == 0);
    sys_sem_free(&server_news);
}

fixture each_test = {begin, end};

/* --- a client's task */

typedef struct device {
    mbm_lwip link;
    mbm_client client;
    mbm_link kept;
    uint8_t incoming[MBM_MAX_TCP_FRAME], outgoing[MBM_MAX_TCP_FRAME];
    mbm_clientRequest request;
    uint16_t reply[REGISTERS];
    sys_sem_t news;
    unsigned good;
    unsigned lost;
} device;

static void device_begin(device *one, uint16_t port)
{
    const mbm_port hooks = mbm_lwip_port(&one->link);
    const mbm_linkHooks link = mbm_lwip_link(&one->link);

    memset(one, 0, sizeof *one);
    assert_int_equal(sys_sem_new(&one->news, 0), ERR_OK);
    one->link.isTask = 1;
    one->link.ready = wake;
    one->link.context = &one->news;
    IS(MBM_PENDING, mbm_lwip_open(&one->link, &relay_loop, port));
    OK(mbm_client_beginTcp(&one->client, &hooks, one->incoming, sizeof one->incoming, one->outgoing,
                           sizeof one->outgoing));
    OK(mbm_client_setResponseTimeout(&one->client, PATIENCE_MS));
    OK(mbm_link_begin(&one->kept, &one->client, &link));
    OK(mbm_link_setBackoff(&one->kept, MBM_BACKOFF_EXPONENTIAL, 1, 10));
    OK(mbm_link_setRequestsWait(&one->kept, 1));
    one->request.unit = 1;
    one->request.reply = one->reply;
    one->request.replyBytes = sizeof one->reply;
}

static void device_end(device *one)
{
    mbm_lwip_close(&one->link);
    sys_sem_free(&one->news);
}

static uint8_t device_read(device *one, uint16_t address, uint16_t quantity)
{
    memset(one->reply, 0, sizeof one->reply);
    IS(MBM_PENDING,
       mbm_client_readHoldingRegisters(&one->client, &one->request, address, quantity));
    for (;;) {
        (void)mbm_client_poll(&one->client);
        if (one->request.status != MBM_PENDING)
            return one->request.status;
        sleep_until(&one->news, mbm_client_pollDelay(&one->client));
    }
}

/* 20 000 requests; fewer in valgrind and in emulators. */
static unsigned requests(void)
{
    const char *fewer = getenv("MBM_TRANSACTIONS");

    return fewer ? (unsigned)strtoul(fewer, NULL, 10) : 20000;
}

/* --- tests */

static void *read_for_long(void *context)
{
    device *one = context;
    unsigned i;

    for (i = 0; i < requests() / 20; i++) {
        if (device_read(one, 0, REGISTERS) == MBM_OK &&
            memcmp(one->reply, words, sizeof words) == 0)
            one->good++;
    }
    return NULL;
}

TEST(several_tasks_read_what_a_servers_task_has)
{
    static device devices[PLACES];
    pthread_t tasks[PLACES];
    int i;

    for (i = 0; i < PLACES; i++)
        device_begin(&devices[i], PORT);
    for (i = 0; i < PLACES; i++)
        assert_int_equal(pthread_create(&tasks[i], NULL, read_for_long, &devices[i]), 0);
    for (i = 0; i < PLACES; i++)
        pthread_join(tasks[i], NULL);
    for (i = 0; i < PLACES; i++) {
        assert_int_equal(devices[i].good, requests() / 20);
        device_end(&devices[i]);
    }
}

TEST(twenty_thousand_requests_to_libmodbus_and_ten_resets)
{
    static device one;
    static int has_relay;
    static tcp_server peer;
    const unsigned count = requests();
    unsigned i, j;

    tcp_server_start(&peer);
    assert_false(has_relay);
    has_relay = 1;
    relay_toMachine(TO_LIBMODBUS, peer.port);
    device_begin(&one, TO_LIBMODBUS);
    for (i = 0; i < count; i++) {
        const uint16_t address = (uint16_t)(i % 300);
        const uint8_t status = device_read(&one, address, 100);

        if (i % (count / RESETS) == count / RESETS / 2)
            relay_reset();
        if (status == MBM_LINK_LOST) {
            one.lost++;
            continue;
        }
        IS(MBM_OK, status);
        for (j = 0; j < 100; j++)
            assert_int_equal(one.reply[j], server_pattern(address + j));
        one.good++;
    }
    /* A reset costs at most the request that it meets. */
    assert_true(one.good + RESETS >= count);
    assert_int_equal(one.good + one.lost, count);
    device_end(&one);
    AWAIT(relay_count() == 0);
    tcp_server_stop(&peer);
}

static uint16_t to_server(void)
{
    static uint16_t port;

    if (port == 0)
        port = relay_toLwip(PORT);
    return port;
}

static modbus_t *libmodbus_connect(void)
{
    modbus_t *peer = tcp_clientOf(to_server(), 1);

    assert_int_equal(modbus_connect(peer), 0);
    return peer;
}

TEST(twenty_thousand_requests_of_libmodbus_and_ten_resets)
{
    const unsigned count = requests();
    modbus_t *peer = libmodbus_connect();
    uint16_t got[REGISTERS];
    unsigned i;

    for (i = 0; i < count; i++) {
        if (i % (count / RESETS) == count / RESETS / 2) {
            assert_int_equal(tcp_resetAtClose(modbus_get_socket(peer)), 0);
            modbus_close(peer);
            assert_int_equal(modbus_connect(peer), 0);
        }
        memset(got, 0, sizeof got);
        assert_int_equal(modbus_read_registers(peer, 0, REGISTERS, got), REGISTERS);
        assert_memory_equal(got, words, sizeof words);
    }
    assert_int_equal(modbus_write_register(peer, 7, 4711), 1);
    assert_int_equal(modbus_read_registers(peer, 7, 1, got), 1);
    assert_int_equal(got[0], 4711);
    FAILS(MODBUS_ENOBASE + MBM_ILLEGAL_DATA_ADDRESS,
          modbus_read_registers(peer, REGISTERS, 1, got));
    assert_int_equal(served, RESETS + 1);
    modbus_close(peer);
    modbus_free(peer);
}

TEST(a_client_of_libmodbus_more_than_places_is_refused_and_the_others_go_on)
{
    modbus_t *peers[PLACES], *more;
    uint16_t got[1];
    int i;

    for (i = 0; i < PLACES; i++) {
        peers[i] = libmodbus_connect();
        assert_int_equal(modbus_read_registers(peers[i], 3, 1, got), 1);
    }
    more = tcp_clientOf(to_server(), 1);
    /* The reset may come before libmodbus has seen that it is connected. */
    assert_true(modbus_connect(more) != 0 || modbus_read_registers(more, 3, 1, got) == -1);
    for (i = 0; i < PLACES; i++) {
        assert_int_equal(modbus_read_registers(peers[i], 3, 1, got), 1);
        modbus_close(peers[i]);
        modbus_free(peers[i]);
    }
    AWAIT(relay_count() == 0);
    modbus_close(more);
    assert_int_equal(modbus_connect(more), 0);
    assert_int_equal(modbus_read_registers(more, 3, 1, got), 1);
    modbus_close(more);
    modbus_free(more);
}

/* --- all in lwIP's thread, without a task */

static mbm_lwip_listener inner;
static mbm_lwip inner_place;
static mbm_server inner_server;
static uint8_t inner_frame[MBM_MAX_TCP_FRAME];

static void serve_in_thread(void *context)
{
    do {
        if (mbm_lwip_accept(&inner) == 0) {
            const mbm_port port = mbm_lwip_port(&inner_place);

            OK(mbm_server_beginTcp(&inner_server, &port, &unit, 1, inner_frame,
                                   sizeof inner_frame));
        }
        if (mbm_lwip_isInUse(&inner_place) && mbm_server_poll(&inner_server) != MBM_OK)
            mbm_lwip_close(&inner_place);
    } while (mbm_lwip_isInUse(&inner_place) && mbm_server_pollDelay(&inner_server) == 0);
}

static void listen_in_thread(void *context)
{
    inner.ready = inner_place.ready = serve_in_thread;
    OK(mbm_lwip_listen(&inner, NULL, 503, &inner_place, 1));
    sys_sem_signal(context);
}

static void close_in_thread(void *context)
{
    mbm_lwip_closeListener(&inner);
    mbm_lwip_close(&inner_place);
    sys_sem_signal(context);
}

TEST(a_server_may_live_in_lwips_thread_alone)
{
    modbus_t *peer = tcp_clientOf(relay_toLwip(503), 1);
    uint16_t got[REGISTERS];
    sys_sem_t done;
    int i;

    assert_int_equal(sys_sem_new(&done, 0), ERR_OK);
    assert_int_equal(tcpip_callback(listen_in_thread, &done), ERR_OK);
    sys_arch_sem_wait(&done, 0);
    assert_int_equal(modbus_connect(peer), 0);
    for (i = 0; i < 500; i++) {
        assert_int_equal(modbus_read_registers(peer, 0, REGISTERS, got), REGISTERS);
        assert_memory_equal(got, words, sizeof words);
    }
    modbus_close(peer);
    modbus_free(peer);
    AWAIT(relay_count() == 0);
    assert_int_equal(tcpip_callback(close_in_thread, &done), ERR_OK);
    sys_arch_sem_wait(&done, 0);
    sys_sem_free(&done);
}
