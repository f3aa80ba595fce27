/* A Pico on the host: UART 1 with its FIFOs and interrupt, GPIOs, the clock, and TinyUSB with a
 * host on the USB. */
#ifndef PICO_MODEL_H
#define PICO_MODEL_H

#include "hardware/uart.h"

enum { PICO_FIFO = 32, PICO_USB_BUFFER = 64, PICO_PACKET = 64, PICO_CLOCK = 125000000 };

typedef struct pico {
    uint32_t now; /* microseconds */
    bool pins[30];
    bool hasNoClock; /* the UARTs' clock is stopped */
    uint baud, stop;
    uint8_t line[600]; /* what UART 1 has sent */
    unsigned sent;
    bool isUp, isOpen, reads; /* the cable, the port on the host, whether a program reads it */
    uint8_t toHost[600];
    unsigned toHostLength;
    unsigned tasks; /* how often tud_task_ext was called */
    unsigned interrupts;
    void (*putting)(void); /* called while the program puts a character into the FIFO; or NULL */
    void (*pass)(void);    /* what happens in a moment of sleep, which an interrupt ends; or NULL */
} pico;
extern pico chip;

void pico_reset(void);
/* A character arrives at UART 1, with bits of the data register. The FIFO's level calls the
 * interrupt. */
void pico_receive(uint32_t character);
/* The line is idle for 32 bits. */
void pico_idle(void);
/* UART 1 sends the oldest character of its FIFO. */
bool pico_send(void);
/* The host sends bytes. Returns how many the device took. */
unsigned pico_from_host(const uint8_t *bytes, unsigned length);

#endif
