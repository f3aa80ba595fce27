#define _GNU_SOURCE
#include "own_network.h"
#include "must.h"
#include "skip.h"

#include <net/if.h>
#include <sched.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <unistd.h>

void own_network(void)
{
    static int is_entered;

    SKIP_IF_EMULATED();
    if (!is_entered && unshare(CLONE_NEWNET) != 0 && unshare(CLONE_NEWUSER | CLONE_NEWNET) != 0)
        skip();
    is_entered = 1;
    own_network_set(1);
}

void own_network_set(int is_up)
{
    struct ifreq lo = {.ifr_name = "lo", .ifr_flags = (short)(is_up ? IFF_UP : 0)};
    const int fd = socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);

    must(fd >= 0 && ioctl(fd, SIOCSIFFLAGS, &lo) == 0, "the loopback interface");
    close(fd);
}

unsigned own_network_sockets(uint16_t port)
{
    FILE *const table = fopen("/proc/thread-self/net/tcp", "r");
    char line[256];
    unsigned found = 0, own;

    must(table != NULL, "the table of sockets");
    while (fgets(line, sizeof line, table))
        found += sscanf(line, "%*u: %*x:%x", &own) == 1 && own == port;
    (void)fclose(table);
    return found;
}
