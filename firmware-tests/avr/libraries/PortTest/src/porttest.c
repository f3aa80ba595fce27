/* A source of the test kit for ports. */
#include "../../../../../ports/test/mbm_porttest.c"
