/* The test kit for ports. */
#include "../../../../../ports/test/mbm_porttest.h"
