#define _GNU_SOURCE
#include "served.h"
#include "must.h"

#include <arpa/inet.h>
#include <errno.h>
#include <fcntl.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <time.h>
#include <unistd.h>

uint16_t served_pattern(unsigned address)
{
    return (uint16_t)(address * 40503u + 0x1234u);
}

uint8_t served_bit_pattern(unsigned address)
{
    return (uint8_t)(served_pattern(address) >> 7 & 1u);
}

static uint8_t before(void *context, const mbm_access *access)
{
    const uint8_t *data = access->data;

    for (unsigned i = 0; i < access->quantity; i++)
        if (access->address + i == SERVED_REFUSED && data[2 * i] == 0xBE && data[2 * i + 1] == 0xEF)
            return MBM_ILLEGAL_DATA_VALUE;
    return 0;
}

static void after(void *context, const mbm_access *access)
{
    ((served *)context)->written++;
}

static uint16_t echo(void *context, const mbm_request *request, uint8_t *response,
                     uint16_t capacity)
{
    if (request->length == 0)
        return MBM_REPLY_EXCEPTION | MBM_ILLEGAL_DATA_VALUE;
    if (request->length > capacity)
        return MBM_REPLY_EXCEPTION | MBM_SERVER_DEVICE_FAILURE;
    memcpy(response, request->data, request->length);
    return request->length;
}

void served_prepare(served *s)
{
    static const mbm_object objects[] = {
        {(const uint8_t *)"Maker", 5, 0},  {(const uint8_t *)"Thing", 5, 1},
        {(const uint8_t *)"V1.0", 4, 2},   {(const uint8_t *)"http://example.org", 18, 3},
        {(const uint8_t *)"own", 3, 0x80},
    };
    unsigned i;

    memset(s, 0, sizeof *s);
    for (i = 0; i < SERVED_REGISTERS; i++) {
        s->words[i] = served_pattern(SERVED_BASE + i);
        s->input_words[i] = (uint16_t)~served_pattern(SERVED_BASE + i);
    }
    for (i = 0; i < SERVED_BITS; i++) {
        s->bits[i / 8] |= (uint8_t)(served_bit_pattern(SERVED_BASE + i) << i % 8);
        s->input_bits[i / 8] |= (uint8_t)(!served_bit_pattern(SERVED_BASE + i) << i % 8);
    }
    memset(s->valid, 0xFF, sizeof s->valid);
    i = SERVED_HOLE - SERVED_BASE;
    s->valid[i / 8] &= (uint8_t) ~(1u << i % 8);

    s->units[0].id = SERVED_UNIT;
    s->units[1].id = SERVED_UNIT + 1;
    s->holding.words = s->words;
    s->holding.base = SERVED_BASE;
    s->holding.size = SERVED_REGISTERS;
    s->holding.valid = s->valid;
    s->word_hooks.beforeWrite = before;
    s->word_hooks.afterWrite = s->bit_hooks.afterWrite = after;
    s->word_hooks.context = s->bit_hooks.context = s;
    mbm_registerTable_setHooks(&s->holding, &s->word_hooks);
    s->inputs.words = s->input_words;
    s->inputs.base = SERVED_BASE;
    s->inputs.size = SERVED_REGISTERS;
    s->coils.bits = s->bits;
    s->coils.base = SERVED_BASE;
    s->coils.size = SERVED_BITS;
    mbm_bitTable_setHooks(&s->coils, &s->bit_hooks);
    s->discrete.bits = s->input_bits;
    s->discrete.base = SERVED_BASE;
    s->discrete.size = SERVED_BITS;
    s->other.words = s->other_words;
    s->other.size = 10;
    s->status.outputs = 0x6D;
    s->id.id = (const uint8_t *)"mbm";
    s->id.idLength = 3;
    s->id.running = 1;
    s->id.additional = (const uint8_t *)"test";
    s->id.additionalLength = 4;
    s->file.number = 4;
    s->file.records = s->records;
    s->file.size = 20;
    s->files.files = &s->file;
    s->files.count = 1;
    s->fifo.address = 0x04DE;
    s->fifo.words = s->queue;
    s->fifo.count = 2;
    s->queue[0] = 0x01B8;
    s->queue[1] = 0x1284;
    s->fifos.fifos = &s->fifo;
    s->fifos.count = 1;
    s->identification.objects = objects;
    s->identification.count = sizeof objects / sizeof *objects;
    s->echo.code = SERVED_ECHO;
    s->echo.serve = echo;

    i = mbm_unit_serveCoils(&s->units[0], &s->coils);
    i |= mbm_unit_serveDiscreteInputs(&s->units[0], &s->discrete);
    i |= mbm_unit_serveHoldingRegisters(&s->units[0], &s->holding);
    i |= mbm_registerTable_serveMaskAndReadWrite(&s->holding);
    i |= mbm_unit_serveInputRegisters(&s->units[0], &s->inputs);
    i |= mbm_unit_serveDiagnostics(&s->units[0], &s->diagnostics);
    i |= mbm_unit_serveExceptionStatus(&s->units[0], &s->status);
    i |= mbm_unit_serveServerId(&s->units[0], &s->id);
    i |= mbm_unit_serveFiles(&s->units[0], &s->files);
    i |= mbm_unit_serveFifos(&s->units[0], &s->fifos);
    i |= mbm_unit_serveIdentification(&s->units[0], &s->identification);
    i |= mbm_unit_serveCustom(&s->units[0], &s->echo);
    i |= mbm_unit_serveHoldingRegisters(&s->units[1], &s->other);
    must(i == MBM_OK, "units");
}

static int16_t fd_read(void *context, uint8_t *bytes, uint16_t capacity)
{
    ssize_t count = read(*(int *)context, bytes, capacity);

    if (count > 0)
        return (int16_t)count;
    return (int16_t)(count < 0 && (errno == EAGAIN || errno == EINTR) ? 0 : -1);
}

static int16_t fd_write(void *context, const uint8_t *bytes, uint16_t length)
{
    ssize_t count = write(*(int *)context, bytes, length);

    if (count >= 0)
        return (int16_t)count;
    return (int16_t)(errno == EAGAIN || errno == EINTR ? 0 : -1);
}

static uint32_t fd_micros(void *context)
{
    struct timespec now;

    clock_gettime(CLOCK_MONOTONIC, &now);
    return (uint32_t)((uint64_t)now.tv_sec * 1000000u + (uint64_t)now.tv_nsec / 1000u);
}

static uint8_t begin(served *s, int index)
{
    mbm_server *server = &s->servers[index];
    uint8_t *frame = s->frames[index];
    const mbm_port port = {
        .context = &s->fds[index], .read = fd_read, .write = fd_write, .micros = fd_micros};

    switch (s->framing) {
    case MBM_FRAMING_RTU:
        return (uint8_t)(mbm_server_beginRtu(server, &port, s->units, 2, frame, MBM_MAX_FRAME) |
                         mbm_server_setBaudRate(server, 115200));
    case MBM_FRAMING_ASCII:
        return mbm_server_beginAscii(server, &port, s->units, 2, frame, MBM_MAX_ASCII_FRAME);
    case MBM_FRAMING_TCP:
        return mbm_server_beginTcp(server, &port, s->units, 2, frame, MBM_MAX_TCP_FRAME);
    default: return mbm_server_beginRtuOverTcp(server, &port, s->units, 2, frame, MBM_MAX_FRAME);
    }
}

static void accept_one(served *s)
{
    int fd = accept4(s->listener, NULL, NULL, SOCK_NONBLOCK), one = 1, i;

    if (fd < 0)
        return;
    setsockopt(fd, IPPROTO_TCP, TCP_NODELAY, &one, sizeof one);
    for (i = 0; i < SERVED_CONNECTIONS; i++) {
        if (s->fds[i] < 0) {
            s->fds[i] = fd;
            must(begin(s, i) == MBM_OK, "begin");
            return;
        }
    }
    close(fd);
}

static void *serve(void *argument)
{
    served *s = (served *)argument;

    for (;;) {
        struct pollfd waits[SERVED_CONNECTIONS + 2];
        uint32_t delay = 1000000;
        int i;

        waits[0] = (struct pollfd){s->stop[0], POLLIN, 0};
        waits[1] = (struct pollfd){s->listener, POLLIN, 0};
        for (i = 0; i < SERVED_CONNECTIONS; i++) {
            uint32_t own = s->fds[i] < 0 ? delay : mbm_server_pollDelay(&s->servers[i]);

            waits[i + 2] = (struct pollfd){s->fds[i], POLLIN, 0};
            delay = own < delay ? own : delay;
        }
        ppoll(waits, SERVED_CONNECTIONS + 2,
              &(struct timespec){delay / 1000000u, (long)(delay % 1000000u) * 1000}, NULL);
        if (waits[0].revents)
            return NULL;
        if (waits[1].revents)
            accept_one(s);
        for (i = 0; i < SERVED_CONNECTIONS; i++) {
            if (s->fds[i] >= 0 && mbm_server_poll(&s->servers[i]) != MBM_OK && s->listener >= 0) {
                close(s->fds[i]);
                s->fds[i] = -1;
            }
        }
    }
}

static void start(served *s)
{
    must(pipe(s->stop) == 0, "pipe");
    must(pthread_create(&s->thread, NULL, serve, s) == 0, "pthread_create");
}

void served_on_line(served *s, int framing)
{
    s->framing = framing;
    s->listener = -1;
    for (int i = 0; i < SERVED_CONNECTIONS; i++)
        s->fds[i] = -1;
    pty_open(&s->line);
    fcntl(s->line.ours, F_SETFL, O_NONBLOCK);
    s->fds[0] = s->line.ours;
    must(begin(s, 0) == MBM_OK, "begin");
    start(s);
}

void served_on_tcp(served *s, int framing)
{
    struct sockaddr_in address = {.sin_family = AF_INET, .sin_addr = {htonl(INADDR_LOOPBACK)}};
    socklen_t length = sizeof address;

    s->framing = framing;
    for (int i = 0; i < SERVED_CONNECTIONS; i++)
        s->fds[i] = -1;
    s->listener = socket(AF_INET, SOCK_STREAM | SOCK_NONBLOCK, 0);
    must(bind(s->listener, (struct sockaddr *)&address, sizeof address) == 0, "bind");
    must(listen(s->listener, 16) == 0, "listen");
    must(getsockname(s->listener, (struct sockaddr *)&address, &length) == 0, "getsockname");
    s->port = ntohs(address.sin_port);
    start(s);
}

void served_stop(served *s)
{
    must(write(s->stop[1], "", 1) == 1, "stop");
    pthread_join(s->thread, NULL);
    close(s->stop[0]);
    close(s->stop[1]);
    if (s->listener < 0) {
        pty_close(&s->line);
        return;
    }
    close(s->listener);
    for (int i = 0; i < SERVED_CONNECTIONS; i++)
        if (s->fds[i] >= 0)
            close(s->fds[i]);
}
