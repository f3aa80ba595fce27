/* The faults that mbm serve plays on request, --fault KIND[=VALUE][@WHEN]: those of a line, and the
 * manners of devices of the field. */
#pragma once

#include "place.h"

#include <stdint.h>

enum fault_kind {
    /* of the line */
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
    FAULT_BLOCKS,
    FAULT_BLOCKS_EVERY,
    /* of the device */
    FAULT_UNIT,
    FAULT_TRANSACTION,
    FAULT_ONLY_FUNCTION,
    FAULT_NO_FUNCTION,
    FAULT_MOST_REGISTERS,
    FAULT_MOST_BITS,
    FAULT_HOLE,
    FAULT_REFUSED_WITH,
    FAULT_NEEDS_DELAY,
    FAULT_NEEDS_MESSAGE_WAIT,
    FAULT_ONE_REQUEST,
    FAULT_BUSY,
    FAULT_CLOSE_IDLE,
    FAULT_CLOSE_AFTER,
    FAULT_DEAF_AFTER,
    FAULT_CONNECTIONS,
    FAULT_KINDS
};

/* Values of FAULT_TRANSACTION beside a number: a count of the answers, and the number of the
 * request before. */
enum { FAULT_OWN_COUNT = 0x10000, FAULT_NUMBER_BEFORE };

#define FAULT_HELP                                                                                 \
    "FAULT is KIND or KIND=VALUE. It happens to every answer, or with @3 to that of the third "    \
    "request, with @3- from the third on, with @3/10 to the third and to every tenth after it. "   \
    "Several --fault options add up.\n"                                                            \
    "  late=TIME       answers after that time\n"                                                  \
    "  deaf            does not answer\n"                                                          \
    "  slow=TIME       pauses between the bytes\n"                                                 \
    "  blocks=N        hands the answer over in blocks of N bytes\n"                               \
    "  blocks-every=TIME  the same, with the bytes of that time in each block\n"                   \
    "  damaged         a wrong CRC or LRC; on TCP a wrong protocol identifier\n"                   \
    "  cut=N           sends only the first N bytes\n"                                             \
    "  noise=N         sends N other bytes before the answer\n"                                    \
    "  twice           sends the answer twice\n"                                                   \
    "  exception=N     answers with exception N, and does nothing else\n"                          \
    "  foreign         sends an answer of the next unit first\n"                                   \
    "  wrong-length    a wrong byte count; on TCP a wrong length in the header\n"                  \
    "  close           closes the connection instead (tcp://, rtu+tcp://, tls://)\n"               \
    "Devices as they are:\n"                                                                       \
    "  unit=N            answers with unit N\n"                                                    \
    "  transaction=N     answers with transaction number N; =count: with its own\n"                \
    "                    count; =before: with that of the request before\n"                        \
    "  only-function=N   exception 01 for all other functions; several add up\n"                   \
    "  no-function=N     exception 01 for this function; several add up\n"                         \
    "  most-registers=N  exception 02 for a request of more; most-bits=N too\n"                    \
    "  hole=A-B          exception 02 for a request of an address from A to B\n"                   \
    "  refused-with=N    exception N in place of 02\n"                                             \
    "  needs-delay=TIME  drops the requests of a connection's first time\n"                        \
    "  needs-message-wait=TIME  drops a request without that pause before it\n"                    \
    "  one-request       drops what comes while it answers another request\n"                      \
    "  busy              exception 06 for what these three drop\n"                                 \
    "  close-idle=TIME   closes a connection without bytes for that time\n"                        \
    "  close-after=N     closes a connection after N answers\n"                                    \
    "  deaf-after=N      answers no more on a connection after N answers\n"                        \
    "  connections=N     closes further connections at once\n"                                     \
    "The words one-request, busy and the last four have no @. udp:// has late, deaf, twice, exception, foreign, and what is neither about connections nor one-request.\n"

enum { FAULT_MOST = 32 };

typedef struct fault {
    enum fault_kind kind;
    uint32_t value;        /* milliseconds, or a number */
    uint32_t last;         /* of a range, which begins with `value` */
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
 * in a buffer that the fourth next call of `say` overwrites. */
const char *fault_read(fault_list *list, const char *text, enum place_kind line);

/* Checks them together. Returns as fault_read. */
const char *fault_check(const fault_list *list);

/* Returns the value of a fault that is there for the whole run, or 0. */
uint32_t fault_value(const fault_list *list, enum fault_kind kind);

/* Whether a fault of the list happens to the request that was counted last. */
int fault_is_due(const fault_list *list, const fault *one);

/* Finds the faults of that request; of several of one kind the last one. */
void fault_choose(const fault_list *list, fault_choice *choice);
