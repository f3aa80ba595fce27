/* cmocka, with what it wants included before it. */
#ifndef TEST_H
#define TEST_H

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#define COUNT(array) (sizeof(array) / sizeof((array)[0]))

/* What a call of mbm.h returns. */
#define IS(status, call) assert_int_equal(call, status)
#define OK(call) IS(MBM_OK, call)

#endif
