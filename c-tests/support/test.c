/* The `main` of all test programs: runs the tests that were added. If MBM_TEST is set, as by
 * `make test-c TEST=NAME`, it is the name of the tests to run; `*` and `?` stand for any
 * characters. */
#define _GNU_SOURCE
#include "test.h"
#include "must.h"

#include <errno.h>

enum { MOST_TESTS = 100 };

typedef struct added_test {
    void (*test)(void), (*setup)(void), (*teardown)(void);
} added_test;

__attribute__((weak)) fixture each_test = {NULL, NULL};
__attribute__((weak)) fixture all_tests = {NULL, NULL};

static added_test added[MOST_TESTS];
static struct CMUnitTest tests[MOST_TESTS];
static unsigned count;

static int setup(void **state)
{
    const added_test *test = (const added_test *)*state;

    if (test->setup)
        test->setup();
    return 0;
}

static void run(void **state)
{
    ((const added_test *)*state)->test();
}

static int teardown(void **state)
{
    const added_test *test = (const added_test *)*state;

    if (test->teardown)
        test->teardown();
    return 0;
}

static int setup_all(void **state)
{
    if (all_tests.setup)
        all_tests.setup();
    return 0;
}

static int teardown_all(void **state)
{
    if (all_tests.teardown)
        all_tests.teardown();
    return 0;
}

void test_add(const char *name, void (*test)(void), void (*before)(void), void (*after)(void))
{
    must(count < MOST_TESTS, "too many tests in one program");
    added[count] = (added_test){test, before, after};
    tests[count] = (struct CMUnitTest){name, run, setup, teardown, &added[count]};
    count++;
}

int main(void)
{
    const char *name = getenv("MBM_TEST");

    must(count > 0, "no test in the program");
    if (name && *name)
        cmocka_set_test_filter(name);
    return cmocka_run_group_tests_name(program_invocation_short_name, tests, setup_all,
                                       teardown_all);
}
