/* FreeRTOS for the examples on an MPS2 board with the AN385 image, a Cortex-M3. In your project
 * take your own FreeRTOSConfig.h: mbm needs the three options at the end. Licence: MIT OR
 * Apache-2.0. */
#ifndef FREERTOS_CONFIG_H
#define FREERTOS_CONFIG_H

#define configCPU_CLOCK_HZ 25000000u
#define configTICK_RATE_HZ 1000u
#define configMAX_PRIORITIES 5
#define configMINIMAL_STACK_SIZE 96u /* words */
#define configSTACK_DEPTH_TYPE uint32_t
#define configMAX_TASK_NAME_LEN 12
#define configUSE_16_BIT_TICKS 0
#define configUSE_PREEMPTION 1
#define configUSE_IDLE_HOOK 0
#define configUSE_TICK_HOOK 0
#define configCHECK_FOR_STACK_OVERFLOW 2
#define configSUPPORT_DYNAMIC_ALLOCATION 0

/* The three upper bits of a priority count. The interrupt of the line calls FreeRTOS, so its
 * priority is the highest at which that is allowed, or a lower one (a larger number). */
#define configKERNEL_INTERRUPT_PRIORITY 0xE0u
#define configMAX_SYSCALL_INTERRUPT_PRIORITY 0x40u

#define INCLUDE_vTaskDelay 1
#define INCLUDE_vTaskPrioritySet 1
#define INCLUDE_uxTaskPriorityGet 1
#define INCLUDE_uxTaskGetStackHighWaterMark 1

void mps2_assert(const char *file, int line);
#define configASSERT(condition) ((condition) ? (void)0 : mps2_assert(__FILE__, __LINE__))

#define vPortSVCHandler svc_handler
#define xPortPendSVHandler pendsv_handler
#define xPortSysTickHandler systick_handler

/* --- for mbm */
#define configUSE_MUTEXES 1
#define configSUPPORT_STATIC_ALLOCATION 1
#define configTASK_NOTIFICATION_ARRAY_ENTRIES 2

#endif
