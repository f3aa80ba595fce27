/* Checks of calls that fail with an errno: those of libmodbus and of the ports. */
#ifndef FAILS_H
#define FAILS_H

#include "test.h"

#include <errno.h>

/* Asserts that a call returns -1 and sets errno. */
#define FAILS(error, call)                                                                         \
    do {                                                                                           \
        errno = 0;                                                                                 \
        assert_int_equal(call, -1);                                                                \
        assert_int_equal(errno, error);                                                            \
    } while (0)

/* Asserts that a call of libmodbus gets an exception. Include modbus.h first. */
#define EXCEPTION(code, call) FAILS(MODBUS_ENOBASE + (code), call)

#endif
