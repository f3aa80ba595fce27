/* The name of a line on the command line:
 *
 *     rtu:/dev/ttyUSB0?baud=19200&parity=even&stop=1
 *     ascii:/dev/ttyUSB0?baud=9600&parity=even&data=7
 *     tcp://192.168.0.7        tcp://meter.example:1502        tcp://[::1]:1502
 *     rtu+tcp://192.168.0.7:4001
 *     udp://192.168.0.7
 *     tcp://192.168.0.7?accept=unit&message_wait=30ms
 *     tls://192.168.0.7?ca=ca.pem&cert=me.pem&key=me.key.pem&name=meter.example
 *
 * A server listens at the place: tcp://:1502 at all addresses of the machine, with port 0 at a free
 * one. pty: is a pseudo terminal for `mbm serve`, pty:/tmp/meter one with a link to it. */
#pragma once

#include "mbm_tcp.h"
#include "mbm_tty.h"
#include "reach.h"

#include <stdint.h>

#define PLACE_HELP                                                                                 \
    "LINE is one of\n"                                                                             \
    "  rtu:PATH[?KEY=VALUE&...]    a serial line; keys: baud=19200, stop=1|2,\n"                   \
    "                              parity=even|none|odd, gap=5ms, echo=yes,\n"                     \
    "                              rs485=yes, shared=yes; of a server latency=50ms\n"              \
    "  ascii:PATH[?KEY=VALUE&...]  the same with ASCII frames; also data=7|8\n"                    \
    "  tcp://HOST[:PORT]           Modbus TCP, port 502 if left out\n"                             \
    "  rtu+tcp://HOST:PORT         RTU frames in a TCP stream\n"                                   \
    "  udp://HOST[:PORT]           Modbus TCP frames in datagrams, port 502\n"                     \
    "  tls://HOST[:PORT]?ca=FILE&cert=FILE&key=FILE[&name=NAME]\n"                                 \
    "                              Modbus/TCP Security, port 802\n"                                \
    "Each line of a client may have keys for its device, as the options of these names:\n"         \
    "  accept=unit,transaction, lenient=yes, delay=2s, message_wait=30ms,\n"                       \
    "  close=never|round|error, retries=3, busy_retries=3, busy_wait=100ms,\n"                     \
    "  timeout=3s\n"

enum place_kind {
    PLACE_RTU,
    PLACE_ASCII,
    PLACE_PTY,
    PLACE_TCP,
    PLACE_RTU_OVER_TCP,
    PLACE_UDP,
    PLACE_TLS
};

enum { PLACE_PATH_BYTES = 256 };

typedef struct place {
    const char *text; /* as it was written; not copied */
    enum place_kind kind;
    uint8_t framing; /* one of MBM_FRAMING_ */

    /* of serial lines */
    char path[MBM_TTY_PATH_BYTES];
    mbm_tty_options tty;
    uint8_t has_echo, discards_echo, has_gap, has_latency;
    uint32_t gapMs, latencyMs;

    reach reach; /* of clients */

    /* of networks; an empty host is all addresses of this machine, for servers only */
    char host[MBM_TCP_HOST_BYTES];
    char service[8];
    char ca[PLACE_PATH_BYTES], cert[PLACE_PATH_BYTES], key[PLACE_PATH_BYTES];
    char name[PLACE_PATH_BYTES];
} place;

/* Reads a name. `is_server` admits what only servers have: pty:, no host, port 0. Returns NULL, or
 * what is wrong as a sentence without its full stop, in a buffer that the next call overwrites. */
const char *place_read(place *p, const char *text, int is_server);

/* What the line can have of a reach, with so many requests in flight. */
reach_line place_reach(const place *p, uint32_t in_flight);

/* Whether it is a terminal, whether it is a TCP connection with or without TLS. */
int place_is_serial(const place *p);
int place_is_tcp(const place *p);

/* The host for mbm_tcp_listen and mbm_udp_listen: NULL if it is empty. */
const char *place_host(const place *p);

/* What to look at if a terminal could not be opened, or a server could not listen at an address.
 * Empty if nothing helps. */
const char *place_advice(const place *p, int error);
