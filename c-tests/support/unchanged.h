/* Calls from within hooks, which change nothing. Include test.h and string.h before. */
#ifndef UNCHANGED_H
#define UNCHANGED_H

/* How often each kind of hook was entered with calls of its own. */
static unsigned entered;

/* Looks at the object before and after what is called. */
#define UNCHANGED_BY(object, calls)                                                                \
    do {                                                                                           \
        static uint8_t before[sizeof(object)];                                                     \
        memcpy(before, &(object), sizeof(object));                                                 \
        calls;                                                                                     \
        assert_memory_equal(before, &(object), sizeof(object));                                    \
        entered++;                                                                                 \
    } while (0)

#endif
