/* The faults of tcp_faults.h on Linux, in a network of the program's own. */
#define _GNU_SOURCE
#include "own_network.h"
#include "test.h"

/* The system keeps the request, and sends it once the network is back. */
#define STATUS_WHILE_DOWN MBM_RESPONSE_TIMED_OUT

static void fault_setup(void);
static void fault_end(void);

fixture each_test = {fault_setup, fault_end};

#include "tcp_faults.h"

static void set_network(int is_up)
{
    own_network_set(is_up);
}

static void fault_setup(void)
{
    own_network();
    fault_begin("0");
}
