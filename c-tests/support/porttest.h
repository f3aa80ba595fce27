/* The test kit for ports in cmocka. */
#ifndef PORTTEST_H
#define PORTTEST_H

#include "mbm_porttest.h"
#include "test.h"

/* Prints a finding. */
static inline void porttest_say(void *context, mbm_portFinding kind, const char *sentence)
{
    (void)context;
    print_message("%s: %s\n", mbm_portFinding_name(kind), sentence);
}

#endif
