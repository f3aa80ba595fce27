/* cmocka, with the headers that it needs included first, those of the C library that most tests
 * use, and tests that add themselves to their program. */
#ifndef TEST_H
#define TEST_H

#include <errno.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#define COUNT(array) (sizeof(array) / sizeof((array)[0]))

/* The functions before and after a test; NULL for none. A program may define `each_test`, which
 * each TEST has, and `all_tests`, which runs before the first and after the last test. */
typedef struct fixture {
    void (*setup)(void), (*teardown)(void);
} fixture;
extern fixture each_test, all_tests;

void test_add(const char *name, void (*test)(void), void (*setup)(void), void (*teardown)(void));

/* Begins a test. The tests of a program run in the order of their definitions. */
#define TEST(name) TEST_WITH(name, each_test.setup, each_test.teardown)
#define TEST_WITH(name, setup, teardown)                                                           \
    static void name(void);                                                                        \
    __attribute__((constructor)) static void add_##name(void)                                      \
    {                                                                                              \
        test_add(#name, name, setup, teardown);                                                    \
    }                                                                                              \
    static void name(void)

/* A test that is one call, as a row of a table of tests. */
#define TEST_ROW(name, call) TEST_ROW_WITH(name, each_test.setup, each_test.teardown, call)
#define TEST_ROW_WITH(name, setup, teardown, call)                                                 \
    TEST_WITH(name, setup, teardown)                                                               \
    {                                                                                              \
        call;                                                                                      \
    }

/* A test that runs with each framing of the program's `framings`, or of its `streams`. */
#define FRAMING_TEST(name) TEST_OF_EACH(framings, name)
#define STREAM_TEST(name) TEST_OF_EACH(streams, name)
#define TEST_OF_EACH(list, name)                                                                   \
    static void with_##name(uint8_t framing);                                                      \
    TEST(name)                                                                                     \
    {                                                                                              \
        for (size_t i = 0; i < COUNT(list); i++)                                                   \
            with_##name((uint8_t)(list)[i]);                                                       \
    }                                                                                              \
    static void with_##name(uint8_t framing)

/* Compares the status that a function of mbm.h returns. */
#define IS(status, call) assert_int_equal(call, status)
#define OK(call) IS(MBM_OK, call)

/* Asserts that a call returns -1 and sets errno. */
#define FAILS(error, call)                                                                         \
    do {                                                                                           \
        errno = 0;                                                                                 \
        assert_int_equal(call, -1);                                                                \
        assert_int_equal(errno, error);                                                            \
    } while (0)

/* Asserts that a call of libmodbus gets an exception. Include modbus.h first. */
#define EXCEPTION(code, call) FAILS(MODBUS_ENOBASE + (code), call)

/* A framing of the mbm_frame functions: one of MBM_FRAMING_, or PDUs alone with functions. */
#define FRAMING(code) (&(const mbm_framing){.kind = (code)})
#define PDU(own, count) (&(const mbm_framing){(own), (count), MBM_FRAMING_NONE, 0})

#endif
