/* The model and the port with version 2 of the serial framework. */
#define RT_USING_SERIAL_V2
#include "mbm_rt_thread.c" // NOLINT(bugprone-suspicious-include): built a second time
#include "serial_model.c"  // NOLINT(bugprone-suspicious-include): built a second time
