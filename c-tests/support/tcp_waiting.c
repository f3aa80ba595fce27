#define _GNU_SOURCE
#include "tcp_waiting.h"
#include "await.h"
#include "skip.h"
#include "must.h"
#include "tcp_server.h"

#include <netinet/in.h>
#include <netinet/tcp.h>
#include <sys/socket.h>

unsigned tcp_waiting(int listener)
{
    struct tcp_info info = {0};
    socklen_t size = sizeof info;

    SKIP_IF_EMULATED();
    must(getsockopt(listener, IPPROTO_TCP, TCP_INFO, &info, &size) == 0, "TCP_INFO");
    return info.tcpi_unacked;
}

void tcp_connect_some(int *fds, unsigned count, int listener, uint16_t port)
{
    const unsigned before = tcp_waiting(listener);

    for (unsigned i = 0; i < count; i++)
        fds[i] = tcp_connectTo(port);
    AWAIT(tcp_waiting(listener) == before + count);
}
