/* libmodbus servers for scripts: unit 17 on a pty, and any unit over TCP. Prints `ready
 * PATH PORT` and serves until its standard input ends. */
#include "pty.h"
#include "server.h"
#include "tcp_server.h"

#include <poll.h>
#include <stdio.h>
#include <unistd.h>

static void copy(int from, int to)
{
    char bytes[512];
    ssize_t count = read(from, bytes, sizeof bytes);

    if (count > 0 && write(to, bytes, (size_t)count) != count)
        perror("serve");
}

int main(void)
{
    static server rtu;
    static tcp_server tcp;
    pty line; /* the pty that a client opens; libmodbus's own end is the only one with a name */

    server_start(&rtu, 17);
    tcp_server_start(&tcp);
    pty_open(&line);
    printf("ready %s %u\n", line.path, tcp.port);
    fflush(stdout);
    for (;;) {
        struct pollfd waits[] = {
            {0, POLLIN, 0}, {line.ours, POLLIN, 0}, {rtu.line.ours, POLLIN, 0}};

        poll(waits, 3, -1);
        if (waits[0].revents)
            break;
        if (waits[1].revents & POLLIN)
            copy(line.ours, rtu.line.ours);
        if (waits[2].revents & POLLIN)
            copy(rtu.line.ours, line.ours);
    }
    pty_close(&line);
    tcp_server_stop(&tcp);
    server_stop(&rtu);
    return 0;
}
