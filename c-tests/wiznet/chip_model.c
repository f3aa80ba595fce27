/* See chip_model.h. Behaves as ioLibrary of 2025 on a W5500, so far as the port calls it: each
 * command fails in the state in which ioLibrary's fails, and a call that would wait there for ever
 * ends the program. */
#define _GNU_SOURCE
#include "chip_model.h"
#include "must.h"
#include "tcp_server.h"

#include <arpa/inet.h>
#include <errno.h>
#include <poll.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <unistd.h>

/* The system's functions, before the model's header gives their names to ioLibrary's. */
static int host_close(int fd)
{
    return close(fd);
}
static ssize_t host_send(int fd, const void *bytes, size_t length)
{
    return send(fd, bytes, length, MSG_NOSIGNAL);
}
static ssize_t host_recv(int fd, void *bytes, size_t length, int flags)
{
    return recv(fd, bytes, length, flags);
}
/* Returns -1 if nothing listens there. */
static int host_connect(uint16_t port)
{
    const struct sockaddr_in to = {
        .sin_family = AF_INET, .sin_port = htons(port), .sin_addr.s_addr = htonl(INADDR_LOOPBACK)};
    const int fd = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);

    if (fd < 0 || connect(fd, (const struct sockaddr *)&to, sizeof to) == 0)
        return fd;
    host_close(fd);
    return -1;
}

#include "socket.h"

chip_model the_chip;

static struct {
    uint8_t state, interrupts, mode;
    int fd; /* -1 for none */
    uint16_t port;
} sockets[CHIP_SOCKETS];
static int listener = -1;
static uint16_t listener_port;

void chip_begin(void)
{
    int i;

    memset(&the_chip, 0, sizeof the_chip);
    memset(sockets, 0, sizeof sockets);
    for (i = 0; i < CHIP_SOCKETS; i++)
        sockets[i].fd = -1;
    listener = tcp_listenOnFree(&listener_port);
}

void chip_end(void)
{
    int i;

    for (i = 0; i < CHIP_SOCKETS; i++)
        if (sockets[i].fd >= 0)
            host_close(sockets[i].fd);
    host_close(listener);
}

uint16_t chip_port(void)
{
    return listener_port;
}

static void end_connection(uint8_t number, int is_hard)
{
    if (sockets[number].fd < 0)
        return;
    if (is_hard)
        (void)tcp_resetAtClose(sockets[number].fd);
    host_close(sockets[number].fd);
    sockets[number].fd = -1;
}

void chip_timeOut(uint8_t number)
{
    end_connection(number, 1);
    sockets[number].state = SOCK_CLOSED;
    sockets[number].interrupts |= Sn_IR_TIMEOUT;
}

void chip_reset(uint8_t number)
{
    end_connection(number, 1);
    sockets[number].state = SOCK_CLOSED;
}

/* A command to the chip: the fault of the test may come here. */
static void command(uint8_t number)
{
    must(!the_chip.is_absent, "a command to a chip that is not there waits for ever");
    must(number < CHIP_SOCKETS, "number of a socket");
    if (++the_chip.calls == the_chip.fail_at && sockets[number].fd >= 0)
        chip_reset(number);
}

/* Looks what the network has brought. */
static void look(uint8_t number)
{
    struct pollfd wait = {.events = POLLIN};
    uint8_t byte;
    ssize_t got;

    if (the_chip.is_unplugged)
        return;
    if (sockets[number].state == SOCK_LISTEN) {
        wait.fd = listener;
        if (poll(&wait, 1, 0) > 0) {
            sockets[number].fd = accept4(listener, NULL, NULL, SOCK_CLOEXEC);
            sockets[number].state = SOCK_ESTABLISHED;
        }
    }
    if (sockets[number].state == SOCK_SYNSENT) {
        sockets[number].fd = host_connect(sockets[number].port);
        sockets[number].state = sockets[number].fd >= 0 ? SOCK_ESTABLISHED : SOCK_CLOSED;
    }
    if (sockets[number].state != SOCK_ESTABLISHED)
        return;
    got = host_recv(sockets[number].fd, &byte, 1, MSG_PEEK | MSG_DONTWAIT);
    if (got == 0)
        sockets[number].state = SOCK_CLOSE_WAIT;
    else if (got < 0 && errno != EAGAIN)
        chip_reset(number);
}

uint8_t wiz_state(uint32_t number)
{
    if (the_chip.is_absent)
        return 0xFF;
    if (number >= CHIP_SOCKETS)
        return SOCK_CLOSED;
    look((uint8_t)number);
    return sockets[number].state;
}

uint8_t wiz_interrupts(uint32_t number)
{
    return sockets[number].interrupts;
}

uint16_t wiz_received(uint8_t number)
{
    int count = 0;

    if (sockets[number].fd < 0 || ioctl(sockets[number].fd, FIONREAD, &count) < 0 ||
        the_chip.is_unplugged)
        return 0;
    if (the_chip.most_received != 0 && count > the_chip.most_received)
        count = the_chip.most_received;
    return (uint16_t)(count < CHIP_BUFFER ? count : CHIP_BUFFER);
}

uint16_t wiz_free(uint8_t number)
{
    (void)number;
    return the_chip.most_sent != 0 ? the_chip.most_sent : CHIP_BUFFER;
}

void wiz_keepAlive(uint32_t number, uint8_t value)
{
    the_chip.keep_alive[number] = value;
}

int8_t wiz_close(uint8_t number)
{
    command(number);
    the_chip.hard_closes += sockets[number].fd >= 0;
    end_connection(number, 1);
    sockets[number].state = SOCK_CLOSED;
    sockets[number].interrupts = 0;
    sockets[number].mode = SOCK_IO_BLOCK;
    return SOCK_OK;
}

int8_t wiz_socket(uint8_t number, uint8_t protocol, uint16_t port, uint8_t flags)
{
    if (number >= CHIP_SOCKETS)
        return SOCKERR_SOCKNUM;
    command(number);
    must(protocol == Sn_MR_TCP, "protocol");
    if (the_chip.has_no_address)
        return SOCKERR_SOCKINIT;
    (void)wiz_close(number);
    sockets[number].state = SOCK_INIT;
    sockets[number].mode = flags & SF_IO_NONBLOCK;
    the_chip.local_port[number] = port;
    return (int8_t)number;
}

int8_t wiz_listen(uint8_t number)
{
    command(number);
    if (sockets[number].state != SOCK_INIT)
        return SOCKERR_SOCKINIT;
    sockets[number].state = SOCK_LISTEN;
    return SOCK_OK;
}

int8_t wiz_connect(uint8_t number, uint8_t *address, uint16_t port)
{
    command(number);
    if (sockets[number].state != SOCK_INIT)
        return SOCKERR_SOCKINIT;
    must(address[0] == 127, "the address of this machine");
    must(sockets[number].mode == SOCK_IO_NONBLOCK, "connect would wait");
    sockets[number].state = SOCK_SYNSENT;
    sockets[number].port = port;
    return SOCK_BUSY;
}

int8_t wiz_disconnect(uint8_t number)
{
    command(number);
    must(sockets[number].mode == SOCK_IO_NONBLOCK, "disconnect would wait");
    the_chip.soft_closes++;
    end_connection(number, 0);
    sockets[number].state = the_chip.is_deaf ? SOCK_LAST_ACK : SOCK_CLOSED;
    return SOCK_BUSY;
}

int32_t wiz_send(uint8_t number, uint8_t *bytes, uint16_t length)
{
    ssize_t sent;

    command(number);
    if (length == 0)
        return SOCKERR_DATALEN;
    if (sockets[number].state != SOCK_ESTABLISHED && sockets[number].state != SOCK_CLOSE_WAIT)
        return SOCKERR_SOCKSTATUS;
    if (the_chip.busy_sends > 0) {
        if (the_chip.busy_sends != CHIP_ALWAYS)
            the_chip.busy_sends--;
        return SOCK_BUSY;
    }
    must(length <= wiz_free(number), "send would wait");
    if (the_chip.is_unplugged)
        return length;
    sent = host_send(sockets[number].fd, bytes, length);
    if (sent < 0) {
        chip_reset(number);
        return SOCKERR_SOCKSTATUS;
    }
    return (int32_t)sent;
}

int32_t wiz_recv(uint8_t number, uint8_t *bytes, uint16_t length)
{
    command(number);
    if (length == 0)
        return SOCKERR_DATALEN;
    if (sockets[number].state != SOCK_ESTABLISHED && sockets[number].state != SOCK_CLOSE_WAIT)
        return SOCKERR_SOCKSTATUS;
    /* As in ioLibrary for a W5500. */
    if (sockets[number].mode == SOCK_IO_NONBLOCK && sockets[number].state == SOCK_ESTABLISHED)
        return SOCK_BUSY;
    must(wiz_received(number) > 0, "recv would wait");
    return (int32_t)host_recv(sockets[number].fd, bytes, length, 0);
}

int8_t wiz_ctlsocket(uint8_t number, int type, void *value)
{
    must(type == CS_SET_IOMODE, "ctlsocket");
    sockets[number].mode = *(uint8_t *)value;
    return SOCK_OK;
}
