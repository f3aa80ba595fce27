/* What callgrind counts, and when it says so; nothing outside of it. */
#include <valgrind/callgrind.h>

void callgrind_toggle(void)
{
    CALLGRIND_TOGGLE_COLLECT;
}

void callgrind_dump(const char *name)
{
    CALLGRIND_DUMP_STATS_AT(name);
}
