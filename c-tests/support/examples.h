/* A PDU of every function and side, most of them the standard's own examples
 * (V1.1b3, clause 6), beside what each says. */
#ifndef EXAMPLES_H
#define EXAMPLES_H

#include "mbm.h"

#include <stddef.h>
#include <stdint.h>

typedef struct example {
    const char *hex;
    uint16_t at;       /* where the data begin, if there are any */
    mbm_packet packet; /* all but data */
} example;

extern const example examples[];
extern const size_t example_count;

/* Bytes of hexadecimal digits, spaces left out; returns how many. */
uint16_t hex_bytes(uint8_t *bytes, const char *hex);

/* The PDU of an example, of MBM_MAX_PDU bytes at most, and the packet that it
 * is, which points into it. Returns the PDU's length. */
uint16_t example_load(const example *e, uint8_t *pdu, mbm_packet *packet);

/* The kind that parsing is asked for. */
uint8_t example_side(const example *e);

/* Asserts that two packets say the same. */
void assert_same_packet(const mbm_packet *found, const mbm_packet *wanted);

#endif
