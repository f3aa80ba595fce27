/* A line on a terminal with one node, with buffers of full size. */
#ifndef NODE_H
#define NODE_H

#include "mbm_tty.h"

typedef struct node {
    mbm_line line;
    mbm_node node;
    mbm_tty tty;
    mbm_port port;
    mbm_counters counters;
    uint16_t response[MBM_MAX_READ_REGISTERS];
    uint16_t transmit[MBM_MAX_WRITE_REGISTERS];
    uint8_t frame[MBM_MAX_FRAME];
} node;

/* Zeroes the node, gives it its buffers and begins it for unit `slave` over `fd`. */
void node_begin(node *n, int fd, uint8_t slave);

/* Returns bit `index` of the response words. */
int node_bit(const node *n, unsigned index);

/* Sets bit `index` of the transmit words. */
void node_set_bit(node *n, unsigned index, int on);

#endif
