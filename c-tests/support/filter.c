/* MBM_TEST, set by `make test-c TEST=NAME`, is the name of the tests to run; `*` and `?`
 * stand for any characters. */
#include "test.h"

#include <stdlib.h>

__attribute__((constructor)) static void filter_tests(void)
{
    const char *name = getenv("MBM_TEST");

    if (name && *name)
        cmocka_set_test_filter(name);
}
