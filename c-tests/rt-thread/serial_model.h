/* RT-Thread on the host: a UART with a device at its other end, pins and the clock, in chip.c, and
 * the devices "uart2" over it and "uart3" over nothing. serial_model.c plays the serial framework
 * of RT-Thread 5.3, version 1 or, with RT_USING_SERIAL_V2, 2, and with STAND_IN_WITHOUT_TX_TIMEOUT
 * version 2 as it was when it had no timeout for sending. `scripts/check/real rt-thread` has the
 * framework's source in its place. */
#ifndef SERIAL_MODEL_H
#define SERIAL_MODEL_H

#include <rtdevice.h>
#include <rtthread.h>

#include <stdbool.h>

enum { RTT_DRIVER_PIN = 6, RTT_PINS = 32 };

typedef struct rtt_chip {
    uint64_t now; /* microseconds */
    uint32_t baud;
    uint8_t line[2000]; /* what the UART has sent */
    unsigned sent;
    bool isDriving;
    unsigned undriven;    /* characters that left while the pin was low */
    const uint8_t *reply; /* what the device answers each frame, or NULL */
    unsigned replyLength;
    unsigned stopsAfter;        /* the transmitter does not send a character more; 0: it sends */
    bool isMasked;              /* the UART's interrupt waits */
    bool isAbsent, failsToOpen; /* the device */
    bool knowsPins;             /* the driver of pins returns an error for others */
    unsigned characterTimeout;  /* 0, or the driver gives up a character that takes longer */
} rtt_chip;
extern rtt_chip chip;
extern struct rt_device rtt_uart;

void rtt_chip_reset(void);
void rtt_chip_pass(uint64_t micros);
/* Characters arrive, one after the other. */
void rtt_chip_receive(const uint8_t *bytes, unsigned length);
/* Another part of the program closes the device. */
void rtt_chip_close(void);

/* --- for what plays the framework */

/* The time of a character, in microseconds. */
uint64_t rtt_character(void);
/* The transmitter does not send. */
bool rtt_is_stopped(void);
/* A character has left. */
void rtt_send(uint8_t byte);
/* The driver of a UART that waits for each character. Returns false if it gives up. */
bool rtt_send_waiting(uint8_t byte);
/* The driver of pins. */
void rtt_pin_mode(rt_base_t pin);
void rtt_pin_write(rt_base_t pin, bool isHigh);
rt_ssize_t rtt_pin_read(rt_base_t pin);

/* What it defines: a new board; some time has passed; a character has arrived. */
void rtt_framework_reset(void);
void rtt_framework_work(void);
void rtt_framework_receive(uint8_t byte);

#endif
