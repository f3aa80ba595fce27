/* The tests of the port for RT-Thread with version 2 of the serial framework as it was when
 * it had no timeout for sending. */
#define RT_USING_SERIAL_V2
#define STAND_IN_WITHOUT_TX_TIMEOUT
#include "test_rt_thread.c" // NOLINT(bugprone-suspicious-include): built a second time
