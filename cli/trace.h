/* The options --trace and --pcap FILE: every frame that the program sends, receives or overhears,
 * in words on stderr, and in a file for Wireshark.
 *
 * Without the options the ports are as they were, and nothing is traced. */
#pragma once

#include "mbm.h"

/* Prints each frame, and writes each to a file. Call them before any port is traced. trace_write
 * returns 0, or -1 with errno set if it cannot write the file. */
void trace_print(void);
int trace_write(const char *path);

/* Whether frames are printed. */
int trace_is_printed(void);

/* Returns the port to use instead of the port of a master or client, or of a server. `framing`
 * is one of MBM_FRAMING_. `name` tells the link from others; a link with the same name as one
 * before takes its place. */
mbm_port trace_client(mbm_port port, uint8_t framing, const char *name);
mbm_port trace_server(mbm_port port, uint8_t framing, const char *name);

/* Traces an event of a sniffer. `time` is in microseconds since 1970. */
void trace_event(const mbm_event *event, uint8_t framing, const char *name, uint64_t time);
