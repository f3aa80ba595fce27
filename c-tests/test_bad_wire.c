/* How five transactions of the master end when the first meets a fault. The device is a
 * script on a pty. Prints the table of docs/reports/fault-table.md, and fails if a row gets
 * worse. */
#include "faults.h"
#include "node.h"
#include "test.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* Returns '.' for right data, 'F' for a failed call, 'W' for success with wrong data. */
static char transact(node *n, const fault *f, unsigned number, uint8_t *status)
{
    if (f->function == 6) {
        *status = mbm_node_writeSingleRegister(&n->node, (uint16_t)number, (uint16_t)~number);
        return *status == MBM_OK ? '.' : 'F';
    }
    *status = mbm_node_readHoldingRegisters(&n->node, (uint16_t)(100 * number), FAULT_REGISTERS);
    if (*status != MBM_OK)
        return 'F';
    for (unsigned i = 0; i < FAULT_REGISTERS; i++)
        if (n->response[i] != fault_value(100 * number + i))
            return 'W';
    return '.';
}

/* Plays a fault. Returns the status of the first transaction. */
static uint8_t outcome(const fault *f, uint8_t retries, char outcomes[FAULT_TRANSACTIONS + 1])
{
    responder device;
    node n;
    mbm_port port;
    uint8_t first = MBM_OK, status;

    fault_start(&device, f);
    node_begin(&n, device.line.ours, FAULT_UNIT);
    port = mbm_tty_port(&n.tty);
    port = fault_port(&device, &port);
    mbm_line_beginRtu(&n.line, &port, n.frame, MBM_MAX_FRAME);
    mbm_node_setResponseTimeout(&n.node, 400);
    mbm_line_setEchoDiscard(&n.line, f->echo);
    mbm_line_setRetries(&n.line, retries);
    for (unsigned i = 0; i < FAULT_TRANSACTIONS; i++) {
        outcomes[i] = transact(&n, f, i + 1, &status);
        if (i == 0)
            first = status;
    }
    outcomes[FAULT_TRANSACTIONS] = '\0';
    responder_stop(&device);
    return first;
}

TEST(no_row_of_the_fault_table_gets_worse)
{
    const char *path = getenv("MBM_FAULT_TABLE");
    FILE *table = path ? fopen(path, "w") : NULL;
    char plain[FAULT_TRANSACTIONS + 1], retried[FAULT_TRANSACTIONS + 1];
    int worse = 0;

    if (table)
        fprintf(
            table,
            "| fault | no retry | one retry | status of the first call without a retry |\n|---|---|---|---|\n");
    for (unsigned i = 0; i < fault_count; i++) {
        const fault *f = &faults[i];
        uint8_t status = outcome(f, 0, plain);

        outcome(f, 1, retried);
        if (table)
            fprintf(table, "| %s | `%s` | `%s` | %s |\n", f->name, plain, retried,
                    status == MBM_OK ? "" : mbm_status_text(status));
        worse += fault_report(f, plain, retried, status);
    }
    if (table)
        (void)fclose(table);
    assert_int_equal(worse, 0);
}
