/* The tests of the port for RT-Thread with version 2 of the serial framework. */
#define RT_USING_SERIAL_V2
#include "test_rt_thread.c" // NOLINT(bugprone-suspicious-include): built a second time
