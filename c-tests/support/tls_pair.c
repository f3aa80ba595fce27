#define _GNU_SOURCE
#include "tls_pair.h"

#include "test.h"

static mbm_tls_files files;

void tls_identify(mbm_tls_identity *identity, const char *name, const char *authority,
                  int is_server)
{
    mbm_tls_options options = {.isServer = (uint8_t)is_server,
                               .handshakeMs = TLS_HANDSHAKE_US / 1000};
    char certificate[128], key[128], authorities[128];

    snprintf(certificate, sizeof certificate, TLS_FOLDER "%s.pem", name);
    snprintf(key, sizeof key, TLS_FOLDER "%s.key.pem", name);
    snprintf(authorities, sizeof authorities, TLS_FOLDER "%s.pem", authority);
    if (mbm_tls_load(&files, &options, certificate, key, authorities) != 0)
        fail_msg("%s: run c-tests/certificates " TLS_FOLDER, certificate);
    assert_int_equal(mbm_tls_begin(identity, &options), 0);
    mbm_tls_forgetKey(&files);
}

static size_t least(size_t a, size_t b)
{
    return a < b ? a : b;
}

static int16_t read_lane(tls_lane *lane, uint8_t *bytes, uint16_t capacity)
{
    const size_t count = least(least(lane->count, capacity), lane->piece);

    if (count == 0)
        return lane->count == 0 && lane->is_cut ? -1 : 0;
    memcpy(bytes, lane->bytes + lane->from, count);
    lane->from += count;
    lane->count -= count;
    if (lane->count == 0)
        lane->from = 0;
    return (int16_t)count;
}

static int16_t write_lane(tls_lane *lane, const uint8_t *bytes, uint16_t length)
{
    const size_t end = lane->from + lane->count,
                 count = least(least(length, lane->piece),
                               lane->capacity > lane->count ? lane->capacity - lane->count : 0);

    if (lane->is_cut)
        return -1;
    assert_true(end + count <= TLS_LANE);
    memcpy(lane->bytes + end, bytes, count);
    if (lane->moved + count <= TLS_LOG)
        memcpy(lane->log + lane->moved, bytes, count);
    lane->count += count;
    lane->moved += count;
    return (int16_t)count;
}

static tls_pair *current;

static int16_t read_end(void *context, uint8_t *bytes, uint16_t capacity)
{
    return read_lane(((tls_end *)context)->in, bytes, capacity);
}

static int16_t write_end(void *context, const uint8_t *bytes, uint16_t length)
{
    return write_lane(((tls_end *)context)->out, bytes, length);
}

static uint32_t micros_end(void *context)
{
    return current->now;
}

static void idle_end(void *context, struct mbm_node *node)
{
    if (current->idle)
        current->idle();
}

static void empty(tls_lane *lane)
{
    lane->from = lane->count = lane->moved = 0;
    lane->is_cut = 0;
}

uint8_t tls_pair_open_end(tls_pair *pair, tls_end *end, const char *name)
{
    const mbm_port below = {.context = end,
                            .read = read_end,
                            .write = write_end,
                            .micros = micros_end,
                            .idle = idle_end};

    end->port = mbm_tls_port(&end->tls);
    return mbm_tls_open(&end->tls,
                        end == &pair->client ? &pair->client_identity : &pair->server_identity,
                        &below, name, NULL);
}

void tls_pair_open(tls_pair *pair, const char *name)
{
    mbm_tls_close(&pair->client.tls);
    mbm_tls_close(&pair->server.tls);
    empty(&pair->to_server);
    empty(&pair->to_client);
    assert_int_equal(tls_pair_open_end(pair, &pair->client, name), MBM_TLS_HANDSHAKE);
    assert_int_equal(tls_pair_open_end(pair, &pair->server, NULL), MBM_TLS_HANDSHAKE);
}

void tls_pair_begin(tls_pair *pair, const char *client, const char *server)
{
    memset(pair, 0, sizeof *pair);
    current = pair;
    pair->client.in = pair->server.out = &pair->to_client;
    pair->client.out = pair->server.in = &pair->to_server;
    pair->to_client.capacity = pair->to_server.capacity = TLS_LANE;
    pair->to_client.piece = pair->to_server.piece = TLS_LANE;
    tls_identify(&pair->client_identity, client, "authority", 0);
    tls_identify(&pair->server_identity, server, "authority", 1);
    tls_pair_open(pair, NULL);
}

size_t tls_step(size_t usual, size_t slow)
{
    return getenv("MBM_TRANSACTIONS") ? slow : usual;
}

/* Whether the handshake goes on without further bytes. */
static int is_due(mbm_tls *tls)
{
    return tls->status == MBM_TLS_HANDSHAKE && mbm_tls_pollDelay(tls) == 0;
}

void tls_pair_run(tls_pair *pair)
{
    size_t before;

    do {
        before = pair->to_server.moved + pair->to_client.moved + pair->to_server.count +
                 pair->to_client.count;
        (void)mbm_tls_poll(&pair->client.tls);
        (void)mbm_tls_poll(&pair->server.tls);
    } while (before != pair->to_server.moved + pair->to_client.moved + pair->to_server.count +
                           pair->to_client.count ||
             is_due(&pair->client.tls) || is_due(&pair->server.tls));
}

int tls_lane_carried(const tls_lane *lane, const void *bytes, size_t length)
{
    return memmem(lane->log, least(lane->moved, TLS_LOG), bytes, length) != NULL;
}

void tls_pair_end(tls_pair *pair)
{
    mbm_tls_close(&pair->client.tls);
    mbm_tls_close(&pair->server.tls);
    mbm_tls_end(&pair->client_identity);
    mbm_tls_end(&pair->server_identity);
}
