/* errno of each task. lwIP's sockets need it, like every program with more than one task that looks
 * at errno: newlib's own is one for all tasks, unless FreeRTOS switches it. */
#ifndef BOARD_ERRNO_H
#define BOARD_ERRNO_H

#include <errno.h>
#undef errno
extern int FreeRTOS_errno;
#define errno FreeRTOS_errno

#endif
