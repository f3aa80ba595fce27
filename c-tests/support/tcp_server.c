#define _GNU_SOURCE
#include "tcp_server.h"
#include "await.h"
#include "server.h"

#include <arpa/inet.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

int tcp_listenOnFree(uint16_t *port)
{
    struct sockaddr_in at;
    socklen_t length = sizeof at;
    int listener = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);

    memset(&at, 0, sizeof at);
    at.sin_family = AF_INET;
    at.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    if (listener < 0 || bind(listener, (struct sockaddr *)&at, sizeof at) < 0 ||
        listen(listener, 4) < 0 || getsockname(listener, (struct sockaddr *)&at, &length) < 0) {
        perror("listen");
        abort();
    }
    *port = ntohs(at.sin_port);
    return listener;
}

int tcp_reserve(uint16_t *port)
{
    struct sockaddr_in at = {0};
    socklen_t length = sizeof at;
    const int on = 1;
    int fd = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);

    at.sin_family = AF_INET;
    at.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    if (fd < 0 || setsockopt(fd, SOL_SOCKET, SO_REUSEADDR, &on, sizeof on) < 0 ||
        bind(fd, (struct sockaddr *)&at, sizeof at) < 0 ||
        getsockname(fd, (struct sockaddr *)&at, &length) < 0) {
        perror("reserve");
        abort();
    }
    *port = ntohs(at.sin_port);
    return fd;
}

int tcp_connectTo(uint16_t port)
{
    struct sockaddr_in to;
    int fd = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);

    memset(&to, 0, sizeof to);
    to.sin_family = AF_INET;
    to.sin_port = htons(port);
    to.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    if (fd < 0 || connect(fd, (struct sockaddr *)&to, sizeof to) < 0) {
        perror("connect");
        abort();
    }
    return fd;
}

int tcp_resetAtClose(int fd)
{
    const struct linger at_once = {1, 0};

    return setsockopt(fd, SOL_SOCKET, SO_LINGER, &at_once, sizeof at_once);
}

static void *serve(void *argument)
{
    tcp_server *s = (tcp_server *)argument;
    uint8_t request[MODBUS_TCP_MAX_ADU_LENGTH];
    int peer = -1;

    for (;;) {
        struct pollfd waits[2] = {{peer < 0 ? s->listener : peer, POLLIN, 0},
                                  {s->stop[0], POLLIN, 0}};
        int length;

        poll(waits, 2, -1);
        if (waits[1].revents)
            break;
        if (peer < 0) {
            peer = accept(s->listener, NULL, NULL);
            modbus_set_socket(s->peer, peer);
            continue;
        }
        length = modbus_receive(s->peer, request);
        if (length > 0)
            modbus_reply(s->peer, request, length, s->mapping);
        if (length < 0) {
            close(peer);
            peer = -1;
        }
    }
    if (peer >= 0)
        close(peer);
    return NULL;
}

void tcp_server_start(tcp_server *s)
{
    s->listener = tcp_listenOnFree(&s->port);
    s->peer = modbus_new_tcp("127.0.0.1", s->port);
    s->mapping = server_memory();
    if (!s->peer || pipe(s->stop)) {
        perror("libmodbus server");
        abort();
    }
    if (pthread_create(&s->thread, NULL, serve, s))
        abort();
}

void tcp_server_stop(tcp_server *s)
{
    if (write(s->stop[1], "", 1) != 1)
        abort();
    pthread_join(s->thread, NULL);
    modbus_free(s->peer);
    modbus_mapping_free(s->mapping);
    close(s->listener);
    close(s->stop[0]);
    close(s->stop[1]);
}

modbus_t *tcp_clientOf(uint16_t port, int unit)
{
    modbus_t *client = modbus_new_tcp("127.0.0.1", port);

    if (!client || modbus_set_slave(client, unit) ||
        modbus_set_response_timeout(client, PATIENCE_MS / 1000, 0)) {
        perror("libmodbus client");
        abort();
    }
    return client;
}
