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

/* A framing of the mbm_frame functions: one of MBM_FRAMING_, or PDUs alone with functions. */
#define FRAMING(code) (&(const mbm_framing){.kind = (code)})
#define PDU(own, count) (&(const mbm_framing){(own), (count), MBM_FRAMING_NONE, 0})

#endif
