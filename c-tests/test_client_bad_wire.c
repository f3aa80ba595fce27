/* How five requests of a client end when the first meets a fault. The faults and the
 * expected outcomes are the same as the master's. */
#include "client.h"
#include "faults.h"
#include "test.h"

#include <stdio.h>
#include <string.h>

/* Returns '.' for right data, 'F' for a failed request, 'W' for success with wrong data. */
static char transact(asker *a, const fault *f, unsigned number, uint8_t *status)
{
    uint16_t words[FAULT_REGISTERS];
    mbm_clientRequest request = {0};

    request.unit = FAULT_UNIT;
    request.reply = words;
    request.replyBytes = sizeof words;
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
static uint8_t outcome(const fault *f, uint8_t retries, char outcomes[FAULT_TRANSACTIONS + 1])
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
        outcomes[i] = transact(&a, f, i + 1, &status);
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
        uint8_t status = outcome(f, 0, plain);

        outcome(f, 1, retried);
        worse += fault_report(f, plain, retried, status);
    }
    assert_int_equal(worse, 0);
}
