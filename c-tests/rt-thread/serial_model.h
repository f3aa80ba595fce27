/* RT-Thread on the host: the device "uart2" with its serial framework, version 1 or, with
 * RT_USING_SERIAL_V2, 2, over a UART; pins; and the clock. It does what the framework of RT-Thread
 * 5.3 does, and with STAND_IN_WITHOUT_TX_TIMEOUT what version 2 did before it had a
 * timeout for sending. */
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
    unsigned mostWaitedMicros;  /* the longest rt_device_write */
} rtt_chip;
extern rtt_chip chip;
extern struct rt_device rtt_uart;

void rtt_chip_reset(void);
void rtt_chip_pass(uint64_t micros);
/* Characters arrive, one after the other. */
void rtt_chip_receive(const uint8_t *bytes, unsigned length);
/* Another part of the program closes the device. */
void rtt_chip_close(void);

#endif
