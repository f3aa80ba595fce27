/* The examples' settings for FreeRTOS, with what lwIP's port for FreeRTOS needs. */
#ifndef LWIP_FREERTOS_CONFIG_H
#define LWIP_FREERTOS_CONFIG_H

#include "../../examples/freertos/FreeRTOSConfig.h"

#undef configSUPPORT_DYNAMIC_ALLOCATION
#define configSUPPORT_DYNAMIC_ALLOCATION 1
#define configTOTAL_HEAP_SIZE (32u * 1024u)
#define configUSE_RECURSIVE_MUTEXES 1
#define INCLUDE_vTaskSuspend 1
/* errno of each task: see board_errno.h. */
#define configUSE_POSIX_ERRNO 1

#endif
