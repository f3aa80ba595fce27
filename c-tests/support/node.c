#include "node.h"
#include "await.h"
#include "test.h"

void node_begin(node *n, int fd, uint8_t slave)
{
    memset(n, 0, sizeof *n);
    assert_int_equal(mbm_tty_attach(&n->tty, fd), 0);
    n->port = mbm_tty_port(&n->tty);
    assert_int_equal(mbm_line_beginRtu(&n->line, &n->port, n->frame, MBM_MAX_FRAME), MBM_OK);
    assert_int_equal(mbm_node_begin(&n->node, &n->line, slave, n->response, MBM_MAX_READ_REGISTERS,
                                    n->transmit, MBM_MAX_WRITE_REGISTERS),
                     MBM_OK);
    assert_int_equal(mbm_line_setCounters(&n->line, &n->counters), MBM_OK);
    assert_int_equal(mbm_line_setBaudRate(&n->line, 115200), MBM_OK);
    assert_int_equal(mbm_node_setResponseTimeout(&n->node, PATIENCE_MS), MBM_OK);
}

int node_bit(const node *n, unsigned index)
{
    return n->response[index / 16] >> index % 16 & 1;
}

void node_set_bit(node *n, unsigned index, int on)
{
    uint16_t mask = (uint16_t)(1u << index % 16);

    if (on)
        n->transmit[index / 16] |= mask;
    else
        n->transmit[index / 16] &= (uint16_t)~mask;
}
