/* A client of a place, which opens its line again when it was lost. */
#pragma once

#include "port_over.h"
#include "mbm_call.h"
#include "mbm_tls_linux.h"
#include "mbm_udp.h"
#include "place.h"
#include "received.h"

#include <poll.h>

typedef struct line {
    mbm_client client;
    mbm_counters counters;
    place place;
    mbm_link kept; /* opens the terminal or connection again when it was lost; not of UDP */
    mbm_tty tty;
    mbm_tcp tcp;
    mbm_tcp_addresses addresses;
    mbm_udp udp;
    mbm_tls tls;
    mbm_tls_identity identity;
    mbm_tls_files files;
    mbm_linkCounters losses;
    unsigned failed;     /* how often the link was lost or not opened */
    uint8_t is_logged;   /* set by the program after line_open: report losses as log lines */
    uint8_t is_told;     /* a loss was, and is not over */
    uint8_t is_replaced; /* that a silent device is connected to anew was reported */
    uint32_t replace_after;
    uint32_t tried;      /* when the last attempt to open it began, in microseconds */
    uint32_t looked_up;  /* when the host was last looked up and not found */
    int reserve;         /* a descriptor that is kept for the line while it is not open; 0: none */
    mbm_counters opened; /* `counters` when the line was opened the last time */
    char reason[160];    /* why it was the last time */
    found_port found;
    received received; /* since the last request */
    char came[160];    /* in place of a reply, to the last request that failed */
    uint8_t incoming[1024], outgoing[1024];
} line;

/* Opens a place and begins its client, with the settings of options.h. A connection is made later,
 * by line_poll. Returns CODE_DONE, or another exit code after reporting the reason. */
int line_open(line *l, const place *where);

/* The same for a service: a terminal that is not there yet is opened by line_poll later. */
int line_open_later(line *l, const place *where);

/* The same for a gateway: line_poll opens any line later. */
int line_begin(line *l, const place *where);
void line_close(line *l);

/* Sets how many requests may be in flight on Modbus TCP, and after how many without any byte a
 * connection is made anew. */
void line_set(line *l, uint8_t in_flight, uint8_t replace_after);

/* Sets what the device needs. A line that is opened has what its name says, and what the options
 * say. */
void line_reach(line *l, const reach *what);

/* Adds to what the name of a line says what the options say, and then what its device file says, as
 * far as the line can have it: `lost` is NULL, or says what it cannot have. Returns NULL, or what
 * does not go together. */
const char *line_add_reach(place *where, const reach *of_device, uint32_t in_flight,
                           const char **lost);

/* Whether a request may be queued: the line is open, or it is being opened. A line that is not open
 * is opened for a request, but at most once a second. */
int line_prepare(line *l);

/* Reports why a place cannot be opened or listened at: an error of getaddrinfo or, if that is 0,
 * errno. Returns CODE_LINE. */
int line_cannot_open(const place *where, int lookup_error);

/* Waits until there is a connection. Returns as line_open. */
int line_connect(line *l);

/* Moves requests on. A terminal or connection that was lost is opened again for the next request,
 * or a second later. */
void line_poll(line *l);

/* Sleeps until the client has something to do, at most `milliseconds` or a second. */
void line_rest(line *l, uint32_t milliseconds);

/* Sleeps until bytes arrive on the line or at the descriptor `fd` (-1 for none), at most for a time
 * in microseconds or a second. */
void line_wait(line *l, int fd, uint32_t micros);

/* Returns for how many microseconds the line has nothing to do unless bytes arrive. */
uint32_t line_delay(line *l);

/* Sets what to poll for the line, with other descriptors. Returns 0 if it has no descriptor. */
int line_polls(const line *l, struct pollfd *wait);

/* Notes what the wait of this round has found for the line. */
void line_polled(line *l, const found_round *round, const struct pollfd *wait);

/* Waits for a request that was queued. Returns its status, MBM_CANCELLED after Ctrl-C. */
uint8_t line_call(line *l, mbm_clientRequest *request, uint8_t queued);

/* Why the link was lost, or NULL if that is not known. */
const char *line_reason(const line *l);

/* Why a request that ended with a status got no reply: why the link was lost, or what came in place
 * of the reply. NULL if that is not known. */
const char *line_why(const line *l, uint8_t status);

/* Notes what came for line_why. Call it when a request has ended, before the next one is sent;
 * after line_read and line_call it has been called. */
void line_note(line *l, uint8_t status);

/* Reports how a request failed. It was made from `about`, one of ADVICE_. Returns the exit code. */
int line_failure(line *l, const mbm_clientRequest *request, int about);

/* The same of `who` in place of the unit. */
int line_failure_of(line *l, const char *who, const mbm_clientRequest *request, int about);

/* The status of a request in words. For a lost link it includes the reason. `text` has 256 bytes.
 */
const char *line_status(const line *l, const mbm_clientRequest *request, char text[256]);

/* Queues a read of a table, one of MBM_TABLE_. */
uint8_t line_read(line *l, mbm_clientRequest *request, uint8_t table, uint16_t address,
                  uint16_t quantity);

/* The time in milliseconds since some moment. It wraps. */
uint32_t line_milliseconds(void);

/* Reads the files of tls://. Returns NULL, or the path of the one that cannot be read, with errno
 * set. */
const char *line_load_tls(const place *p, mbm_tls_files *files, mbm_tls_options *into);
