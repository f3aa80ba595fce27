/* What a line has received since its last request, to say why none of it is the reply. */
#pragma once

#include "mbm.h"

enum { RECEIVED_SENT = 1024, RECEIVED_BYTES = 300, RECEIVED_EARLIER = 32 };

typedef struct received {
    mbm_port below;
    uint8_t framing;             /* one of MBM_FRAMING_ */
    uint8_t accept;              /* MBM_ACCEPT_: what the client takes */
    uint8_t sent[RECEIVED_SENT]; /* what the last write sent: of Modbus TCP any number of frames */
    uint16_t sent_count;
    uint8_t bytes[RECEIVED_BYTES];      /* the first that came since then */
    uint32_t count;                     /* how many came since then */
    uint16_t earlier[RECEIVED_EARLIER]; /* transaction numbers of requests before, the last ones */
    uint32_t earlier_count;
} received;

/* Begins to note what passes a port. Returns the port to use in its place; `to` must outlive it. */
mbm_port received_begin(received *to, const mbm_port *below, uint8_t framing);

/* Why a request got no reply although bytes came: "a reply came with protocol id 1, ...", without a
 * full stop, in a buffer that later calls overwrite. NULL if nothing came that says so. */
const char *received_text(const received *from);

/* Whether exactly the request came back, which a receiver does that hears its own driver. */
int received_is_echo(const received *from);
