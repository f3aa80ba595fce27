/* A chip of Espressif on the host: ESP-IDF's driver for UART 1 with its FIFOs, rings and queue of
 * events, GPIOs and the clock. It does what the driver of ESP-IDF 6.2 does. */
#ifndef UART_MODEL_H
#define UART_MODEL_H

#include "driver/uart.h"

enum { ESP_FIFO = 128, ESP_DRIVER_PIN = 6, ESP_BAD_PIN = 34 /* has an input alone */ };

typedef struct esp_chip {
    int64_t now;        /* microseconds */
    int baud, bits;     /* of a character */
    uint8_t line[2000]; /* what UART 1 has sent */
    unsigned sent;
    bool isDriving;         /* the level of the driver's pin, or of RTS in the mode for RS-485 */
    unsigned undriven;      /* characters that left while it was low */
    int64_t sentAt, freeAt; /* when the last bit left, when the driver went off */
    const uint8_t *reply;   /* what the device answers each frame, or NULL */
    unsigned replyLength;
    bool isStopped;       /* the transmitter does not send: CTS, XOFF, a clock */
    bool isMasked;        /* the UART's interrupt waits, as while the flash is written */
    bool isHeapFull;      /* the driver cannot be installed */
    bool isForeign;       /* another part of the program has installed it */
    unsigned delays;      /* how often the task slept */
    unsigned mostWaiting; /* the most events that waited in the queue */
    void (*pass)(void);   /* called when time passes, or NULL */
} esp_chip;
extern esp_chip chip;

void esp_chip_reset(void);
bool esp_chip_is_installed(void);
void esp_chip_pass(int64_t micros);
/* Characters arrive, one after the other. */
void esp_chip_receive(const uint8_t *bytes, unsigned length);
/* A character arrives with UART_PARITY_ERR or UART_FRAME_ERR. */
void esp_chip_receive_faulty(uint8_t byte, uart_event_type_t fault);
/* The interrupt that has waited is handled. */
void esp_chip_unmask(void);

#endif
