/* As plan.c, with fields that were grouped before, as mbm header does it. */
#define GROUPED
#include "plan.c"
