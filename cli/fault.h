/* The faults that mbm serve plays on request, --fault KIND[=VALUE][@WHEN], and the port that plays
 * them.
 *
 * Licence: MIT OR Apache-2.0. */
#ifndef FAULT_H
#define FAULT_H

#include "mbm.h"
#include "place.h"

#include <stdint.h>

enum fault_kind {
    FAULT_LATE,
    FAULT_DEAF,
    FAULT_SLOW,
    FAULT_DAMAGED,
    FAULT_CUT,
    FAULT_NOISE,
    FAULT_TWICE,
    FAULT_EXCEPTION,
    FAULT_FOREIGN,
    FAULT_WRONG_LENGTH,
    FAULT_CLOSE,
    FAULT_KINDS
};

#define FAULT_HELP                                                                                 \
    "FAULT is KIND or KIND=VALUE. It happens to every answer, or with @3 to that of the third "    \
    "request, with @3- from the third on, with @3/10 to the third and to every tenth after it. "   \
    "Several --fault options add up.\n"                                                            \
    "  late=TIME       answers after that time\n"                                                  \
    "  deaf            does not answer\n"                                                          \
    "  slow=TIME       pauses between the bytes\n"                                                 \
    "  damaged         a wrong CRC or LRC; on TCP a wrong protocol identifier\n"                   \
    "  cut=N           sends only the first N bytes\n"                                             \
    "  noise=N         sends N other bytes before the answer\n"                                    \
    "  twice           sends the answer twice\n"                                                   \
    "  exception=N     answers with exception N, and does nothing else\n"                          \
    "  foreign         sends an answer of the next unit first\n"                                   \
    "  wrong-length    a wrong byte count; on TCP a wrong length in the header\n"                  \
    "  close           closes the connection instead (tcp://, rtu+tcp://, tls://)\n"               \
    "udp:// has late, deaf, twice, exception and foreign.\n"

enum { FAULT_MOST = 32 };

typedef struct fault {
    enum fault_kind kind;
    uint32_t value;        /* milliseconds, or a number */
    uint32_t first, every; /* the first request, and every nth after it; 0: only it */
} fault;

/* The faults of the command line, and how many requests have been counted. */
typedef struct fault_list {
    fault faults[FAULT_MOST];
    uint32_t count, requests, hit;
} fault_list;

/* The faults of one request. */
typedef struct fault_choice {
    uint8_t has[FAULT_KINDS];
    uint32_t value[FAULT_KINDS];
} fault_choice;

/* Reads one fault and adds it. Returns NULL, or what is wrong as a sentence without its full stop,
 * in a buffer that the next call overwrites. */
const char *fault_read(fault_list *list, const char *text, enum place_kind line);

/* Counts a request, and finds its faults. */
void fault_choose(fault_list *list, fault_choice *choice);

/* --- the port of a server, which changes, delays or drops answers --- */

/* Noise, an answer of another unit, and the answer twice. */
enum { FAULT_PORT_BYTES = 2048, FAULT_PORT_PIECES = 4 };

typedef struct fault_port {
    mbm_port below;
    uint8_t framing, is_datagrams, is_lost, is_closing;
    fault_choice chosen; /* the faults of the request that is answered; all 0: none */
    /* The answer that is still to be sent: pieces, each after a pause. */
    uint8_t bytes[FAULT_PORT_BYTES];
    uint16_t ends[FAULT_PORT_PIECES];
    uint32_t pausesUs[FAULT_PORT_PIECES];
    uint16_t count, piece, sent, end;
    uint32_t sinceUs, pauseUs; /* the next byte is due `pauseUs` after `sinceUs` */
    uint32_t random;
} fault_port;

/* Begins it on a port, which may send each frame as a datagram. Returns the port for the server,
 * whose context is the fault_port. */
mbm_port fault_port_begin(fault_port *port, const mbm_port *below, uint8_t framing,
                          int is_datagrams);

/* Returns the microseconds until something is due: 0 if the link is lost, UINT32_MAX if nothing is
 * to be sent. */
uint32_t fault_port_delay(fault_port *port);

#endif
