/* lwIP under FreeRTOS on QEMU's mps2-an385. */
#ifndef NETWORK_H
#define NETWORK_H

#include "FreeRTOS.h"
#include "task.h"

/* What the host writes into the memory of the board before it starts. */
#define HOST_PORT (*(volatile uint32_t *)0x21000000u)

/* Starts lwIP with the address 10.0.2.15, and calls `ready` in lwIP's thread once it runs. */
void network_begin(void (*ready)(void *none));

/* A task with a stack of `words` words on the heap. */
TaskHandle_t network_task(TaskFunction_t run, const char *name, void *parameter, unsigned words);

/* Returns how many bytes of a task's stack were used at most. */
unsigned network_stackUsed(TaskHandle_t task);

/* The tasks of driver and lwIP. */
extern TaskHandle_t network_driver, network_lwip;

#endif
