/* cmocka, with the headers that it needs included first. */
#ifndef TEST_H
#define TEST_H

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#define COUNT(array) (sizeof(array) / sizeof((array)[0]))

/* Compares the status that a function of mbm.h returns. */
#define IS(status, call) assert_int_equal(call, status)
#define OK(call) IS(MBM_OK, call)

#endif
