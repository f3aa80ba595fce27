/* Calls that are refused. Include test.h and string.h before. */
#ifndef REFUSED_H
#define REFUSED_H

/* Holds that a call returns a status and leaves an object as it was. */
#define REFUSED(status, object, call)                                                             \
    do {                                                                                          \
        memcpy(before, &(object), sizeof(object));                                                \
        IS(status, call);                                                                         \
        assert_memory_equal(before, &(object), sizeof(object));                                   \
    } while (0)

static uint8_t before[8192];

#endif
