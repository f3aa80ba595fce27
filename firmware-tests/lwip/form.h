/* The form of the port under test: form_sockets.c or form_raw.c. */
#ifndef FORM_H
#define FORM_H

#include "mbm.h"

/* A task that serves ten holding registers from address 0 as unit 1. */
void form_serve(void *none);
extern const char form_name[];

/* Notes the host's server for a client, and returns port and hooks. */
void form_open(uint16_t port, mbm_port *to, mbm_linkHooks *hooks);

/* Sleeps until bytes come, at most for this time. */
void form_wait(uint32_t timeoutUs);

/* Begins the example as a second client, if the form has one. form_exampleReads returns how many of
 * its reads have ended, or 0 while the last one is wrong. */
void form_beginExample(uint16_t port);
uint32_t form_exampleReads(void);

#endif
