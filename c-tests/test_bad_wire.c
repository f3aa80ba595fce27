/* How five transactions of the master end when the first meets a fault. The device is a
 * script on a pty. Prints the table of docs/reports/fault-table.md, and fails if a row gets
 * worse. */
#include "client.h"
#include "faults.h"
#include "test.h"

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
    uint8_t first = MBM_OK, status;

    fault_start(&device, f);
    node_begin(&n, device.line.ours, FAULT_UNIT);
    mbm_port port = mbm_tty_port(&n.tty);
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

/* How five requests of a client end when the first meets a fault. The faults and the
 * expected outcomes are the same as the master's. */

/* Returns '.' for right data, 'F' for a failed request, 'W' for success with wrong data. */
static char client_transacts(asker *a, const fault *f, unsigned number, uint8_t *status)
{
    uint16_t words[FAULT_REGISTERS];
    mbm_clientRequest request = {.unit = FAULT_UNIT, .reply = words, .replyBytes = sizeof words};

    if (f->function == 6)
        IS(MBM_PENDING, mbm_client_writeSingleRegister(&a->client, &request, (uint16_t)number,
                                                       (uint16_t)~number));
    else
        IS(MBM_PENDING, mbm_client_readHoldingRegisters(&a->client, &request,
                                                        (uint16_t)(100 * number), FAULT_REGISTERS));
    *status = asker_wait(a, &request);
    if (*status != MBM_OK)
        return 'F';
    for (unsigned i = 0; i < FAULT_REGISTERS && f->function == 3; i++)
        if (words[i] != fault_value(100 * number + i))
            return 'W';
    return '.';
}

/* Plays a fault. Returns the status of the first request. */
static uint8_t client_outcome(const fault *f, uint8_t retries,
                              char outcomes[FAULT_TRANSACTIONS + 1])
{
    responder device;
    asker a;
    uint8_t first = MBM_OK, status;

    fault_start(&device, f);
    memset(&a, 0, sizeof a);
    assert_int_equal(mbm_tty_attach(&a.tty, device.line.ours), 0);
    a.port = mbm_tty_port(&a.tty);
    a.port = fault_port(&device, &a.port);
    OK(mbm_client_beginRtu(&a.client, &a.port, a.incoming, 256));
    OK(mbm_client_setBaudRate(&a.client, 115200));
    OK(mbm_client_setResponseTimeout(&a.client, 400));
    OK(mbm_client_setEchoDiscard(&a.client, f->echo));
    OK(mbm_client_setRetries(&a.client, retries));
    for (unsigned i = 0; i < FAULT_TRANSACTIONS; i++) {
        outcomes[i] = client_transacts(&a, f, i + 1, &status);
        if (i == 0)
            first = status;
    }
    outcomes[FAULT_TRANSACTIONS] = '\0';
    responder_stop(&device);
    return first;
}

TEST(no_row_of_the_fault_table_is_worse_for_the_client)
{
    char plain[FAULT_TRANSACTIONS + 1], retried[FAULT_TRANSACTIONS + 1];
    int worse = 0;

    for (unsigned i = 0; i < fault_count; i++) {
        const fault *f = &faults[i];
        uint8_t status = client_outcome(f, 0, plain);

        client_outcome(f, 1, retried);
        worse += fault_report(f, plain, retried, status);
    }
    assert_int_equal(worse, 0);
}
