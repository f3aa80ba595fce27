#include "lwip_pair.h"
#include "test.h"

/* --- the server */

uint16_t words[REGISTERS];
mbm_unit unit;
mbm_lwip_listener listener;
mbm_lwip places[PLACES];
mbm_server servers[PLACES];
uint32_t ends;
static mbm_registerTable holding;
static uint8_t frames[PLACES][MBM_MAX_TCP_FRAME];

void serve(void)
{
    int i;

    while ((i = mbm_lwip_accept(&listener)) >= 0) {
        const mbm_port port = mbm_lwip_port(&places[i]);

        OK(mbm_server_beginTcp(&servers[i], &port, &unit, 1, frames[i], sizeof frames[i]));
    }
    for (i = 0; i < PLACES; i++) {
        if (mbm_lwip_isInUse(&places[i]) && mbm_server_poll(&servers[i]) != MBM_OK) {
            mbm_lwip_close(&places[i]);
            ends++;
        }
    }
}

void serve_reset(void)
{
    int i, count = 0;

    for (i = 0; i < PLACES; i++) {
        if (places[i].pcb) {
            tcp_abort(places[i].pcb);
            count++;
        }
    }
    assert_true(count > 0);
}

int places_inUse(void)
{
    int i, count = 0;

    for (i = 0; i < PLACES; i++)
        count += mbm_lwip_isInUse(&places[i]);
    return count;
}

/* --- the client */

mbm_lwip device;
mbm_client client;
uint16_t reply[REGISTERS];
mbm_clientRequest request;
static uint8_t incoming[MBM_MAX_TCP_FRAME], outgoing[MBM_MAX_TCP_FRAME];

void client_start(void)
{
    const mbm_port port = mbm_lwip_port(&device);

    OK(mbm_client_beginTcp(&client, &port, incoming, sizeof incoming, outgoing, sizeof outgoing));
}

void client_connect(void)
{
    IS(MBM_PENDING, mbm_lwip_open(&device, &the_wire.far, PORT));
    client_start();
    wire_deliver();
    OK(mbm_lwip_status(&device));
}

void client_queue(uint16_t quantity)
{
    memset(reply, 0, sizeof reply);
    request.unit = 1;
    request.reply = reply;
    request.replyBytes = sizeof reply;
    IS(MBM_PENDING, mbm_client_readHoldingRegisters(&client, &request, 0, quantity));
}

void only_poll(void)
{
    (void)mbm_client_poll(&client);
}

void serve_and_poll(void)
{
    serve();
    only_poll();
}

void client_reads(void)
{
    int i;

    client_queue(REGISTERS);
    for (i = 0; i < 1000 && request.status == MBM_PENDING; i++)
        wire_pass(10, serve_and_poll);
    IS(MBM_OK, request.status);
    assert_memory_equal(reply, words, sizeof words);
}

/* --- the peer */

peer peers[PLACES + 2];

static err_t connected(void *context, struct tcp_pcb *pcb, err_t error)
{
    peer *one = context;

    one->isConnected = 1;
    return ERR_OK;
}

static err_t received(void *context, struct tcp_pcb *pcb, struct pbuf *p, err_t error)
{
    peer *one = context;

    if (p == NULL) {
        one->isEnded = 1;
        return ERR_OK;
    }
    assert_true(one->count + p->tot_len <= sizeof one->bytes);
    one->count += pbuf_copy_partial(p, one->bytes + one->count, p->tot_len, 0);
    if (!one->isDeaf)
        tcp_recved(pcb, p->tot_len);
    pbuf_free(p);
    return ERR_OK;
}

static void failed(void *context, err_t error)
{
    peer *one = context;

    one->pcb = NULL;
    one->error = error;
}

void peer_connect(peer *one)
{
    memset(one, 0, sizeof *one);
    one->pcb = tcp_new();
    assert_non_null(one->pcb);
    tcp_arg(one->pcb, one);
    tcp_recv(one->pcb, received);
    tcp_err(one->pcb, failed);
    tcp_nagle_disable(one->pcb);
    assert_int_equal(tcp_connect(one->pcb, &the_wire.far, PORT, connected), ERR_OK);
    wire_deliver();
}

void peer_send(peer *one, const void *bytes, uint16_t length)
{
    assert_non_null(one->pcb);
    assert_int_equal(tcp_write(one->pcb, bytes, length, TCP_WRITE_FLAG_COPY), ERR_OK);
    assert_int_equal(tcp_output(one->pcb), ERR_OK);
}

int peer_canAsk(const peer *one)
{
    return tcp_sndbuf(one->pcb) >= FRAME && tcp_sndqueuelen(one->pcb) < TCP_SND_QUEUELEN / 2;
}

void peer_ask(peer *one, uint16_t number, uint8_t quantity)
{
    const uint8_t bytes[FRAME] = {
        (uint8_t)(number >> 8), (uint8_t)number, 0, 0, 0, 6, 1, 3, 0, 0, 0, quantity};

    peer_send(one, bytes, sizeof bytes);
}

uint16_t peer_askDeaf(peer *one, void (*each)(void))
{
    uint16_t i, count = 0;

    one->isDeaf = 1;
    for (i = 0; i < 3000 && !(places[0].flags & MBM_LWIP_WAITS); i++) {
        if (peer_canAsk(one))
            peer_ask(one, count++, REGISTERS);
        wire_pass(10, each);
    }
    return count;
}

void peer_expects(const peer *one, uint16_t first, uint16_t count, uint8_t quantity)
{
    const uint8_t *at = one->bytes;
    uint16_t i, j;

    assert_int_equal(one->count, count * (9 + 2 * quantity));
    for (i = 0; i < count; i++) {
        assert_int_equal(at[0] << 8 | at[1], (uint16_t)(first + i));
        assert_int_equal(at[5], 3 + 2 * quantity);
        assert_int_equal(at[7], 3);
        for (j = 0; j < quantity; j++)
            assert_int_equal(at[9 + 2 * j] << 8 | at[10 + 2 * j], words[j]);
        at += 9 + 2 * quantity;
    }
}

static void forget(peer *one)
{
    tcp_arg(one->pcb, NULL);
    tcp_err(one->pcb, NULL);
    tcp_recv(one->pcb, NULL);
}

void peer_close(peer *one)
{
    forget(one);
    assert_int_equal(tcp_close(one->pcb), ERR_OK);
    one->pcb = NULL;
}

void peer_reset(peer *one)
{
    forget(one);
    tcp_abort(one->pcb);
    one->pcb = NULL;
}

/* --- lwIP's memory. The linker leads the port's calls here (--wrap). */

uint32_t failing_writes, failing_connections, writes;

err_t __wrap_tcp_write(struct tcp_pcb *pcb, const void *bytes, u16_t length, u8_t flags);
err_t __real_tcp_write(struct tcp_pcb *pcb, const void *bytes, u16_t length, u8_t flags);
struct tcp_pcb *__wrap_tcp_new_ip_type(u8_t type);
struct tcp_pcb *__real_tcp_new_ip_type(u8_t type);

err_t __wrap_tcp_write(struct tcp_pcb *pcb, const void *bytes, u16_t length, u8_t flags)
{
    writes++;
    if (failing_writes == 0)
        return __real_tcp_write(pcb, bytes, length, flags);
    failing_writes--;
    return ERR_MEM;
}

struct tcp_pcb *__wrap_tcp_new_ip_type(u8_t type)
{
    if (failing_connections == 0)
        return __real_tcp_new_ip_type(type);
    failing_connections--;
    return NULL;
}

/* --- a test */

void pair_begin(void)
{
    int i;

    wire_begin();
    memset(&holding, 0, sizeof holding);
    memset(&unit, 0, sizeof unit);
    memset(&listener, 0, sizeof listener);
    memset(places, 0, sizeof places);
    memset(servers, 0, sizeof servers);
    memset(&device, 0, sizeof device);
    memset(&client, 0, sizeof client);
    memset(&request, 0, sizeof request);
    memset(peers, 0, sizeof peers);
    ends = failing_writes = failing_connections = writes = 0;
    for (i = 0; i < REGISTERS; i++)
        words[i] = (uint16_t)(0x101 * i + 7);
    holding.words = words;
    holding.size = REGISTERS;
    unit.id = 1;
    OK(mbm_unit_serveHoldingRegisters(&unit, &holding));
    OK(mbm_lwip_listen(&listener, NULL, PORT, places, PLACES));
}

void pair_end(void)
{
    int i;

    mbm_lwip_closeListener(&listener);
    for (i = 0; i < PLACES; i++)
        mbm_lwip_close(&places[i]);
    mbm_lwip_close(&device);
    wire_end();
}
