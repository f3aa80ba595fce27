/* See mbm_lwip_sockets.h: the clock, the flags and the addresses of the port over lwIP's sockets.
 * Licence: MIT OR Apache-2.0. */
#define _GNU_SOURCE
#include "mbm_tcp.h"

#include "mbm_lwip_sockets.h"

#include "lwip/api.h"
#include "lwip/inet.h"
#include "lwip/ip_addr.h"

#include <string.h>

/* An address with its memory, which is lwIP's. */
typedef struct found_address {
    struct addrinfo head;
    struct sockaddr_storage address;
} found_address;

static int refuse(int error)
{
    errno = error;
    return -1;
}

/* lwIP's clock wraps after 49 days, and earlier where it is a count of ticks. The sum of its steps
 * does not. */
int64_t mbm_tcp_milliseconds(void)
{
    static uint32_t last;
    static int64_t sum;
    int64_t result;
    uint32_t now;
    SYS_ARCH_DECL_PROTECT(level);

    SYS_ARCH_PROTECT(level);
    now = sys_now();
    sum += (uint32_t)(now - last);
    last = now;
    result = sum;
    SYS_ARCH_UNPROTECT(level);
    return result;
}

int64_t mbm_tcp_microseconds(void)
{
    return mbm_tcp_milliseconds() * 1000;
}

int mbm_tcp_setFlags(int fd)
{
    return lwip_ioctl(fd, FIONBIO, &(int){1});
}

static int parse_port(const char *service, uint16_t *port)
{
    uint32_t number = 0;

    if (*service == '\0')
        return -1;
    for (; *service != '\0'; service++) {
        if (*service < '0' || *service > '9')
            return -1;
        number = number * 10u + (uint32_t)(*service - '0');
        if (number > UINT16_MAX)
            return -1;
    }
    *port = (uint16_t)number;
    return 0;
}

#if LWIP_IPV4
#define ANY_ADDRESS "0.0.0.0"
#define OWN_ADDRESS "127.0.0.1"
#else
#define ANY_ADDRESS "::"
#define OWN_ADDRESS "::1"
#endif

/* Only a name that is no numeric address needs LWIP_DNS, and may block. */
static int find_host(const char *host, int flags, ip_addr_t *address)
{
    if (host == NULL)
        host = flags & AI_PASSIVE ? ANY_ADDRESS : OWN_ADDRESS;
    if (ipaddr_aton(host, address))
        return 0;
#if LWIP_DNS
    return netconn_gethostbyname(host, address) == ERR_OK ? 0 : -1;
#else
    return -1;
#endif
}

static void fill(found_address *one, const ip_addr_t *ip, uint16_t port)
{
#if LWIP_IPV6
    if (IP_IS_V6(ip)) {
        struct sockaddr_in6 *address = (struct sockaddr_in6 *)(void *)&one->address;

        address->sin6_family = AF_INET6;
        address->sin6_port = lwip_htons(port);
        memcpy(&address->sin6_addr, ip_2_ip6(ip)->addr, sizeof address->sin6_addr);
        one->head.ai_family = AF_INET6;
        one->head.ai_addrlen = sizeof *address;
    }
#endif
#if LWIP_IPV4
    if (IP_IS_V4(ip)) {
        struct sockaddr_in *address = (struct sockaddr_in *)(void *)&one->address;

        address->sin_family = AF_INET;
        address->sin_port = lwip_htons(port);
        inet_addr_from_ip4addr(&address->sin_addr, ip_2_ip4(ip));
        one->head.ai_family = AF_INET;
        one->head.ai_addrlen = sizeof *address;
    }
#endif
    one->head.ai_addr = (struct sockaddr *)(void *)&one->address;
}

int mbm_tcp_lookUp(const char *host, const char *service, int flags, struct addrinfo **found,
                   int *error)
{
    found_address *one;
    ip_addr_t ip;
    uint16_t port;

    *error = 1;
    if (parse_port(service, &port) < 0)
        return refuse(ENXIO);
    /* A name server that does not answer now may answer later. */
    if (find_host(host, flags, &ip) < 0)
        return refuse(LWIP_DNS ? EAGAIN : ENXIO);
    one = mem_malloc(sizeof *one);
    if (one == NULL)
        return refuse(ENOMEM);
    memset(one, 0, sizeof *one);
    fill(one, &ip, port);
    *found = &one->head;
    *error = 0;
    return 0;
}

void mbm_lwip_freeAddresses(struct addrinfo *found)
{
    mem_free(found);
}
