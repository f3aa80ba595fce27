/* A libmodbus server of many TCP connections at once, for scripts:
 *
 *     serve_many PORT     0 for a free port
 *
 * Prints `ready PORT`. Holding register N is server_pattern(N), and one more after every 4 seconds
 * of the system's clock. Serves until its standard input ends. */
#define _GNU_SOURCE
#include "must.h"
#include "server.h"

#include <arpa/inet.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <string.h>
#include <sys/socket.h>
#include <time.h>
#include <unistd.h>

enum { MOST = 1000, REGISTERS = 10000, EVERY_S = 4 };

static struct pollfd waits[2 + MOST];

static int begin_to_listen(uint16_t port)
{
    struct sockaddr_in at = {
        .sin_family = AF_INET, .sin_addr = {htonl(INADDR_LOOPBACK)}, .sin_port = htons(port)};
    const int fd = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0), on = 1;
    socklen_t length = sizeof at;

    must(fd >= 0 && setsockopt(fd, SOL_SOCKET, SO_REUSEADDR, &on, sizeof on) == 0 &&
             bind(fd, (struct sockaddr *)&at, sizeof at) == 0 && listen(fd, 1024) == 0 &&
             getsockname(fd, (struct sockaddr *)&at, &length) == 0,
         "listen");
    printf("ready %u\n", ntohs(at.sin_port));
    fflush(stdout);
    return fd;
}

static void take_connection(int listener)
{
    const int fd = accept4(listener, NULL, NULL, SOCK_CLOEXEC), on = 1;
    unsigned i;

    for (i = 2; i < 2 + MOST; i++)
        if (fd >= 0 && waits[i].fd < 0) {
            setsockopt(fd, IPPROTO_TCP, TCP_NODELAY, &on, sizeof on);
            waits[i] = (struct pollfd){fd, POLLIN, 0};
            return;
        }
    if (fd >= 0)
        close(fd);
}

int main(int argc, char **argv)
{
    modbus_t *host = modbus_new_tcp("127.0.0.1", 1502);
    modbus_mapping_t *mapping = modbus_mapping_new(0, 0, REGISTERS, 0);
    uint8_t request[MODBUS_TCP_MAX_ADU_LENGTH];
    int listener, length;
    unsigned i, more, shown = 0;

    must(argc == 2 && host && mapping, "usage: serve_many PORT");
    listener = begin_to_listen((uint16_t)atoi(argv[1]));
    waits[0] = (struct pollfd){0, POLLIN, 0};
    waits[1] = (struct pollfd){listener, POLLIN, 0};
    for (i = 2; i < 2 + MOST; i++)
        waits[i].fd = -1;
    while (poll(waits, 2 + MOST, -1) >= 0 && !waits[0].revents) {
        more = (unsigned)(time(NULL) / EVERY_S);
        for (i = 0; i < REGISTERS && more != shown; i++)
            mapping->tab_registers[i] = (uint16_t)(server_pattern(i) + more);
        shown = more;
        if (waits[1].revents)
            take_connection(listener);
        for (i = 2; i < 2 + MOST; i++) {
            if (!waits[i].revents)
                continue;
            modbus_set_socket(host, waits[i].fd);
            length = modbus_receive(host, request);
            if (length > 0)
                modbus_reply(host, request, length, mapping);
            if (length < 0) {
                close(waits[i].fd);
                waits[i].fd = -1;
            }
        }
    }
    modbus_mapping_free(mapping);
    modbus_free(host);
    return 0;
}
