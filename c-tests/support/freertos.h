/* What tests see of the FreeRTOS that c-tests/shim plays. An interrupt is code between
 * freertos_enter and freertos_exit. */
#ifndef FREERTOS_SUPPORT_H
#define FREERTOS_SUPPORT_H

#include "semphr.h"

/* A sleep of more ticks ends with a notification only, however busy the machine is. So a test in
 * which one is lost is stopped. */
enum { FREERTOS_LONGEST = 5000 };

/* How often a task slept, how often it let others run, and how often it was notified, since they
 * were zeroed. */
extern unsigned freertos_sleeps, freertos_yields, freertos_given;

/* If not NULL: called once, when a task asks who it is, or when it is about to sleep. */
extern void (*freertos_before_check)(void), (*freertos_before_sleep)(void);

#endif
