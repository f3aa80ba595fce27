/* The board of the examples: an MPS2 with the AN385 image, as QEMU's mps2-an385. Its UART0 is the
 * console, UART1 the Modbus line. Licence: MIT OR Apache-2.0. */
#ifndef MPS2_H
#define MPS2_H

#include "mbm_freertos_uart.h"

/* The line: UART1 with its interrupts. Open it by mbm_freertos_open, then call mps2_startLine. */
extern mbm_freertosUart mps2_line;
void mps2_startLine(void);

/* Switches the UART of the line off, as if it had never been started. */
void mps2_stopLine(void);

/* A task of 200 words of stack, without a heap. Six at most. */
TaskHandle_t mps2_task(TaskFunction_t run, const char *name, void *parameter, UBaseType_t priority);

void mps2_print(const char *text);
void mps2_printNumber(uint32_t number);

int main(void);

#endif
