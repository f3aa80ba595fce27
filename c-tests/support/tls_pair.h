/* A client and a server of mbm_tls.h over a wire in memory, with a clock of its own: the test
 * says how many bytes pass at a time, how many the wire holds, and when it is cut. */
#ifndef TLS_PAIR_H
#define TLS_PAIR_H

#include "mbm_tls_linux.h"

#include <stddef.h>
#include <stdint.h>

/* The folder that c-tests/certificates fills, seen from the folder that tests run in. */
#define TLS_FOLDER "build/certificates/"

enum { TLS_LANE = 65536, TLS_LOG = 65536 };

/* The time for a handshake, which a busy machine does not reach. */
enum { TLS_HANDSHAKE_US = 100000000 };

/* One direction of the wire. */
typedef struct tls_lane {
    uint8_t bytes[TLS_LANE];
    size_t from, count;
    size_t capacity; /* how many bytes it holds */
    size_t piece;    /* the most bytes that one read or write moves */
    size_t moved;    /* bytes written so far */
    int is_cut;      /* 1: the writer is gone; the reader reads what is left, then a lost link */
    uint8_t log[TLS_LOG]; /* what was written */
} tls_lane;

typedef struct tls_end {
    mbm_tls tls;
    tls_lane *in, *out;
    mbm_port port; /* of the connection */
} tls_end;

typedef struct tls_pair {
    tls_lane to_server, to_client;
    tls_end client, server;
    uint32_t now; /* microseconds */
    mbm_tls_identity client_identity, server_identity;
    void (*idle)(void); /* called while a master waits; may be NULL */
} tls_pair;

/* Begins an identity with the files NAME.pem, NAME.key.pem and AUTHORITY.pem of the folder. */
void tls_identify(mbm_tls_identity *identity, const char *name, const char *authority,
                  int is_server);

/* Begins the identities, and a connection with a wire that holds everything. */
void tls_pair_begin(tls_pair *pair, const char *client, const char *server);

/* Opens both ends over an empty wire. `name` is the server's name that the client expects. */
void tls_pair_open(tls_pair *pair, const char *name);

/* Opens one end. Returns what mbm_tls_open does. */
uint8_t tls_pair_open_end(tls_pair *pair, tls_end *end, const char *name);

/* The step of a loop whose every round is a handshake: `slow` in valgrind, where one takes half
 * a second, else `usual`. */
size_t tls_step(size_t usual, size_t slow);

/* Polls both ends until no byte moves any more. */
void tls_pair_run(tls_pair *pair);

/* Whether bytes ever crossed a lane as they are. */
int tls_lane_carried(const tls_lane *lane, const void *bytes, size_t length);

/* Closes everything. */
void tls_pair_end(tls_pair *pair);

#endif
