/* The sources of the test kit for ports. */
#include "../../../../../ports/test/mbm_porttest.c"
#include "../../../../../ports/test/mbm_porttest_checks.c"
#include "../../../../../ports/test/mbm_porttest_hooks.c"
#include "../../../../../ports/test/mbm_porttest_line.c"
