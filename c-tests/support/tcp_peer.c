#define _GNU_SOURCE
#include "tcp_peer.h"
#include "tcp_server.h"
#include "tcp_stream.h"
#include "must.h"

#include <arpa/inet.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

/* The longest time for which a reply waits for other replies. */
enum { PATIENCE_MS = 250, HEADER = 6 };

typedef struct scripted {
    unsigned number, argument;
    tcp_fault fault;
} scripted;

struct tcp_peer {
    int listener, reserved, wake[2], capture[2], running;
    held_clock *clock, own_clock;
    modbus_t *replier;
    modbus_mapping_t *memory;
    pthread_t thread;
    pthread_mutex_t lock; /* protects all fields below */
    scripted script[TCP_PEER_SCRIPT];
    size_t scripts;
    tcp_fault kinds[FAULTS];
    size_t kind_count;
    unsigned percent, longest;
    uint32_t random;
    int hang_up;
    tcp_peer_counts counts;
    stream streams[TCP_PEER_CONNECTIONS];
};

uint16_t tcp_peer_word(unsigned address)
{
    return (uint16_t)(address * 40503u + 0x1234u);
}

uint8_t tcp_peer_bit(unsigned address)
{
    return (uint8_t)(tcp_peer_word(address) >> 7 & 1u);
}

/* Milliseconds of the clock that delays are counted by. */
static int64_t now_ms(tcp_peer *p)
{
    return held_clock_now(p->clock) / 1000;
}

/* --- the faults */

static uint32_t draw(tcp_peer *p, uint32_t below)
{
    p->random = p->random * 1664525u + 1013904223u;
    return (p->random >> 8) % below;
}

static unsigned fitting(tcp_peer *p, tcp_fault fault)
{
    switch (fault) {
    case FAULT_DELAY: return 1 + draw(p, p->longest > 0 ? p->longest : 1);
    case FAULT_HOLD:
    case FAULT_JOIN: return 1 + draw(p, 4);
    case FAULT_SPLIT: return 0;
    case FAULT_OTHER_ID:
    case FAULT_ALSO_OTHER_ID: return 0x8000;
    case FAULT_WRONG_UNIT: return 1 + draw(p, 200);
    case FAULT_WRONG_FUNCTION: return 0x41;
    case FAULT_EXCEPTION: return 1 + draw(p, 6);
    case FAULT_HALF: return draw(p, 9);
    default: return 1 + draw(p, 30);
    }
}

/* The fault of request `number`. Removes it from the script. */
static tcp_fault fault_of(tcp_peer *p, unsigned number, unsigned *argument)
{
    tcp_fault fault = FAULT_NONE;

    *argument = 0;
    for (size_t i = 0; i < p->scripts; i++) {
        if (p->script[i].number == number) {
            fault = p->script[i].fault;
            *argument = p->script[i].argument;
            p->script[i] = p->script[--p->scripts];
            return fault;
        }
    }
    if (p->kind_count > 0 && draw(p, 100) < p->percent) {
        fault = p->kinds[draw(p, (uint32_t)p->kind_count)];
        *argument = fitting(p, fault);
    }
    return fault;
}

static void exception(const uint8_t *request, unsigned code, reply *r)
{
    memcpy(r->bytes, request, 8);
    r->bytes[4] = 0;
    r->bytes[5] = 3;
    r->bytes[7] |= 0x80;
    r->bytes[8] = (uint8_t)code;
    r->length = 9;
}

/* Gets libmodbus's reply: what it would write to a socket. libmodbus would end the
 * connection, or worse, at functions that it does not have, so those get an exception here. */
static void answer(tcp_peer *p, const uint8_t *request, size_t length, reply *r)
{
    static const uint8_t has[] = {1, 2, 3, 4, 5, 6, 0x0F, 0x10, 0x11, 0x16, 0x17};
    uint8_t whole[TCP_PEER_FRAME] = {0};

    if (!memchr(has, request[7], sizeof has) || (request[7] != 0x11 && length < 12)) {
        exception(request, memchr(has, request[7], sizeof has) ? 3 : 1, r);
        return;
    }
    memcpy(whole, request, length);
    must(modbus_reply(p->replier, whole, (int)length, p->memory) > 0, "modbus_reply");
    ssize_t count = recv(p->capture[1], r->bytes, sizeof r->bytes, 0);
    must(count > HEADER, "the reply");
    r->length = (size_t)count;
}

static void add16(uint8_t *bytes, unsigned more)
{
    unsigned value = ((unsigned)bytes[0] << 8 | bytes[1]) + more;

    bytes[0] = (uint8_t)(value >> 8);
    bytes[1] = (uint8_t)value;
}

/* Plays a fault other than a right reply in one piece. Returns whether the right reply was
 * sent as well. */
static int play(tcp_peer *p, stream *c, tcp_fault fault, unsigned argument, reply *r)
{
    uint8_t garbage[TCP_PEER_FRAME];
    reply wrong = *r;

    switch (fault) {
    case FAULT_DELAY: stream_hold(c, r, now_ms(p) + argument, 0); return 1;
    case FAULT_HOLD: stream_hold(c, r, now_ms(p) + PATIENCE_MS, argument); return 1;
    case FAULT_JOIN: stream_join(c, r, now_ms(p) + PATIENCE_MS, argument); return 1;
    case FAULT_TWICE:
        stream_send_whole(c, r);
        stream_send_whole(c, r);
        return 1;
    case FAULT_SPLIT: stream_split(c, r, argument); return 1;
    case FAULT_OTHER_ID:
    case FAULT_ALSO_OTHER_ID: add16(wrong.bytes, argument); break;
    case FAULT_WRONG_PROTOCOL: add16(wrong.bytes + 2, argument); break;
    case FAULT_WRONG_UNIT: wrong.bytes[6] = (uint8_t)(wrong.bytes[6] + argument); break;
    case FAULT_WRONG_FUNCTION: wrong.bytes[7] = (uint8_t)argument; break;
    case FAULT_GARBAGE:
        memset(garbage, 0xA5, sizeof garbage);
        stream_send_raw(c, garbage, argument < sizeof garbage ? argument : sizeof garbage);
        stream_send_whole(c, r);
        return 1;
    case FAULT_SHORT_LENGTH: add16(wrong.bytes + 4, 0u - argument); break;
    case FAULT_HALF:
        stream_send_raw(c, r->bytes, argument < r->length ? argument : r->length - 1);
        stream_end(c);
        return 0;
    case FAULT_CLOSE: stream_end(c); return 0;
    case FAULT_RESET: stream_reset(c); return 0;
    default: return 0;
    }
    stream_send_raw(c, wrong.bytes, wrong.length);
    if (fault == FAULT_ALSO_OTHER_ID)
        stream_send_whole(c, r);
    return fault == FAULT_ALSO_OTHER_ID;
}

static void serve(tcp_peer *p, stream *c, const uint8_t *request, size_t length)
{
    unsigned argument;
    tcp_fault fault = fault_of(p, ++p->counts.requests, &argument);
    reply r;

    p->counts.faults[fault]++;
    if (fault == FAULT_EXCEPTION)
        exception(request, argument, &r);
    else
        answer(p, request, length, &r);
    if (fault != FAULT_NONE && fault != FAULT_EXCEPTION) {
        int right = play(p, c, fault, argument, &r);

        p->counts.replies += right ? 1 : 0;
        if (!right || fault == FAULT_DELAY || fault == FAULT_HOLD)
            return;
    } else {
        p->counts.replies++;
        stream_send_whole(c, &r);
    }
    stream_release(c, now_ms(p), 1);
}

/* --- the thread */

static int64_t due_ms(const tcp_peer *p, int64_t latest)
{
    for (size_t i = 0; i < TCP_PEER_CONNECTIONS; i++)
        latest = stream_due(&p->streams[i], latest);
    return latest;
}

static void set_clock_due(tcp_peer *p)
{
    int64_t due = due_ms(p, HELD_CLOCK_NEVER / 1000);

    held_clock_due(p->clock, due < HELD_CLOCK_NEVER / 1000 ? 1000 * due : HELD_CLOCK_NEVER);
}

static void receive(tcp_peer *p, stream *c)
{
    const unsigned link = c->link;
    ssize_t count = recv(c->fd, c->input + c->have, sizeof c->input - c->have, 0);
    size_t at = 0;

    if (count <= 0) {
        stream_let_go(c);
        return;
    }
    if (c->ended)
        return;
    c->have += (size_t)count;
    while (c->have - at >= HEADER) {
        const uint8_t *frame = c->input + at;
        size_t length = (size_t)frame[4] << 8 | frame[5];

        if (frame[2] != 0 || frame[3] != 0 || length < 2 || length > 254) {
            p->counts.malformed++;
            stream_let_go(c);
            return;
        }
        if (c->have - at < HEADER + length)
            break;
        serve(p, c, frame, HEADER + length);
        set_clock_due(p);
        held_clock_done(p->clock, link, (uint32_t)(HEADER + length));
        if (c->fd < 0 || c->ended) {
            c->have = 0;
            return;
        }
        at += HEADER + length;
    }
    c->have -= at;
    memmove(c->input, c->input + at, c->have);
}

static void accept_connection(tcp_peer *p)
{
    const struct timeval patience = {2, 0};
    const int on = 1;
    int fd = accept(p->listener, NULL, NULL);
    size_t i;

    if (fd < 0)
        return;
    for (i = 0; i < TCP_PEER_CONNECTIONS && p->streams[i].fd >= 0; i++)
        ;
    if (i == TCP_PEER_CONNECTIONS) {
        p->counts.refused++;
        close(fd);
        return;
    }
    setsockopt(fd, IPPROTO_TCP, TCP_NODELAY, &on, sizeof on);
    setsockopt(fd, SOL_SOCKET, SO_SNDTIMEO, &patience, sizeof patience);
    p->streams[i].fd = fd;
    p->streams[i].link = held_clock_link(p->clock);
    p->counts.connections++;
}

static int sleep_ms(tcp_peer *p)
{
    int64_t now = now_ms(p), first = due_ms(p, now + 1000);

    return first > now ? (int)(first - now) : 0;
}

static void *run(void *argument)
{
    tcp_peer *p = (tcp_peer *)argument;
    struct pollfd waits[TCP_PEER_CONNECTIONS + 2];
    char byte;
    size_t i;

    for (;;) {
        for (i = 0; i < TCP_PEER_CONNECTIONS; i++)
            waits[i] = (struct pollfd){p->streams[i].fd, POLLIN, 0};
        waits[i] = (struct pollfd){p->listener, POLLIN, 0};
        waits[i + 1] = (struct pollfd){p->wake[0], POLLIN, 0};
        poll(waits, i + 2, sleep_ms(p));

        if (waits[i + 1].revents) {
            must(read(p->wake[0], &byte, 1) == 1, "wake");
            if (byte == 'q')
                return NULL;
        }
        pthread_mutex_lock(&p->lock);
        for (i = 0; i < TCP_PEER_CONNECTIONS; i++) {
            stream *c = &p->streams[i];

            if (c->fd >= 0 && waits[i].revents)
                receive(p, c);
            if (c->fd >= 0)
                stream_release(c, now_ms(p), 0);
            if (c->fd >= 0 && p->hang_up)
                stream_end(c);
        }
        set_clock_due(p);
        p->hang_up = 0;
        if (waits[i].revents)
            accept_connection(p);
        pthread_mutex_unlock(&p->lock);
    }
}

static void wake(tcp_peer *p, char what)
{
    must(write(p->wake[1], &what, 1) == 1, "wake");
}

/* --- functions for tests */

tcp_peer *tcp_peer_new(void)
{
    tcp_peer *p = (tcp_peer *)calloc(1, sizeof *p);

    must(p != NULL, "calloc");
    p->replier = modbus_new_tcp("127.0.0.1", 502);
    p->memory = modbus_mapping_new(TCP_PEER_CELLS, TCP_PEER_CELLS, TCP_PEER_CELLS, TCP_PEER_CELLS);
    must(p->replier && p->memory && pthread_mutex_init(&p->lock, NULL) == 0, "libmodbus");
    must(pipe(p->wake) == 0, "pipe");
    must(socketpair(AF_UNIX, SOCK_SEQPACKET, 0, p->capture) == 0, "socketpair");
    must(modbus_set_socket(p->replier, p->capture[0]) == 0, "modbus_set_socket");
    /* libmodbus sleeps for this time after a request that it does not accept. */
    must(modbus_set_response_timeout(p->replier, 0, 1) == 0, "modbus_set_response_timeout");
    for (unsigned i = 0; i < TCP_PEER_CELLS; i++) {
        p->memory->tab_registers[i] = tcp_peer_word(i);
        p->memory->tab_input_registers[i] = (uint16_t)~tcp_peer_word(i);
        p->memory->tab_bits[i] = tcp_peer_bit(i);
        p->memory->tab_input_bits[i] = !tcp_peer_bit(i);
    }
    for (unsigned i = 0; i < TCP_PEER_CONNECTIONS; i++)
        p->streams[i].fd = -1;
    p->listener = p->reserved = -1;
    held_clock_start(&p->own_clock);
    p->clock = &p->own_clock;
    return p;
}

void tcp_peer_clock(tcp_peer *p, held_clock *clock)
{
    p->clock = clock;
}

uint16_t tcp_peer_start(tcp_peer *p, uint16_t port)
{
    struct sockaddr_in address = {0};
    const int on = 1;

    if (port == 0) {
        if (p->reserved >= 0)
            close(p->reserved);
        p->reserved = tcp_reserve(&port);
    }
    address.sin_family = AF_INET;
    address.sin_port = htons(port);
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    p->listener = socket(AF_INET, SOCK_STREAM | SOCK_NONBLOCK, 0);
    must(p->listener >= 0, "socket");
    setsockopt(p->listener, SOL_SOCKET, SO_REUSEADDR, &on, sizeof on);
    must(bind(p->listener, (struct sockaddr *)&address, sizeof address) == 0, "bind");
    must(listen(p->listener, 64) == 0, "listen");
    must(pthread_create(&p->thread, NULL, run, p) == 0, "pthread_create");
    p->running = 1;
    return ntohs(address.sin_port);
}

void tcp_peer_fault(tcp_peer *p, unsigned n, tcp_fault fault, unsigned argument)
{
    pthread_mutex_lock(&p->lock);
    must(p->scripts < TCP_PEER_SCRIPT, "the script is too long");
    p->script[p->scripts++] = (scripted){n, argument, fault};
    pthread_mutex_unlock(&p->lock);
}

void tcp_peer_chaos(tcp_peer *p, uint32_t seed, unsigned percent, const tcp_fault *kinds,
                    size_t count, unsigned longest)
{
    pthread_mutex_lock(&p->lock);
    must(count <= FAULTS, "too many kinds");
    memcpy(p->kinds, kinds, count * sizeof *kinds);
    p->kind_count = count;
    p->random = seed;
    p->percent = percent;
    p->longest = longest;
    pthread_mutex_unlock(&p->lock);
}

void tcp_peer_hang_up(tcp_peer *p)
{
    pthread_mutex_lock(&p->lock);
    p->hang_up = 1;
    pthread_mutex_unlock(&p->lock);
    wake(p, 'h');
}

tcp_peer_counts tcp_peer_count(tcp_peer *p)
{
    tcp_peer_counts counts;

    pthread_mutex_lock(&p->lock);
    counts = p->counts;
    pthread_mutex_unlock(&p->lock);
    return counts;
}

modbus_mapping_t *tcp_peer_memory(tcp_peer *p)
{
    return p->memory;
}

void tcp_peer_halt(tcp_peer *p)
{
    if (!p->running)
        return;
    wake(p, 'q');
    pthread_join(p->thread, NULL);
    for (size_t i = 0; i < TCP_PEER_CONNECTIONS; i++)
        stream_let_go(&p->streams[i]);
    close(p->listener);
    p->listener = -1;
    p->running = 0;
}

void tcp_peer_stop(tcp_peer *p)
{
    tcp_peer_halt(p);
    modbus_free(p->replier);
    modbus_mapping_free(p->memory);
    close(p->capture[0]);
    close(p->capture[1]);
    close(p->wake[0]);
    close(p->wake[1]);
    if (p->reserved >= 0)
        close(p->reserved);
    pthread_mutex_destroy(&p->lock);
    free(p);
}
