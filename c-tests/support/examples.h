/* A request PDU and a response PDU of every function, most of them the standard's own
 * examples (V1.1b3, clause 6), and the fields of each. */
#ifndef EXAMPLES_H
#define EXAMPLES_H

#include "mbm.h"

#include <stddef.h>
#include <stdint.h>

typedef struct example {
    const char *hex;
    uint16_t at;       /* where the data begin, if there are any */
    mbm_packet packet; /* all fields except data */
} example;

extern const example examples[];
extern const size_t example_count;

/* Converts hexadecimal digits, with or without spaces, to bytes. Returns how many. */
uint16_t hex_bytes(uint8_t *bytes, const char *hex);

/* Writes the PDU of an example, at most MBM_MAX_PDU bytes, and the packet with its fields,
 * which points into the PDU. Returns the PDU's length. */
uint16_t example_load(const example *e, uint8_t *pdu, mbm_packet *packet);

/* The packet kind to give to the parser. */
uint8_t example_side(const example *e);

/* Asserts that two packets have the same fields. */
void assert_same_packet(const mbm_packet *found, const mbm_packet *wanted);

#endif
