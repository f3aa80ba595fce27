/* An STM32 with one UART on a wire, for tests of ports/stm32. The wire, the clock and the pin are
 * played here, character by character. The chip is played by chip_model.c, which has a HAL of its
 * own, or by firmware-tests/kits/stm32/host, which has ST's HAL over registers that are played. */
#ifndef MACHINE_H
#define MACHINE_H

#include <stdint.h>

enum { MACHINE_SENT = 65536, NONE = 0, FRAMING = 1, NOISE = 2, PARITY = 4, OVERRUN = 8 };

typedef struct machine {
    uint64_t now;       /* nanoseconds */
    uint64_t character; /* nanoseconds of a character */
    uint8_t isMasked;   /* interrupts wait */

    /* faults of the chip */
    uint8_t hasNoPin, txDmaStops, rxDmaStops;
    uint8_t rxDmaFails; /* with a transfer error, at the next character */
    uint8_t isLooped;   /* a wire leads from TX to RX */

    /* the wire: what was sent, and when its last bit had left */
    uint8_t sent[MACHINE_SENT];
    uint64_t sentAt[MACHINE_SENT];
    unsigned sentCount;
    uint64_t driverOn, driverOff; /* when the pin, or the wire, changed last */
    unsigned driverChanges;
    uint8_t isDriving;
    unsigned collisions; /* characters that arrived while the driver was on */
    unsigned undriven;   /* characters that left while it was off */

    /* called when the last bit of a character has left */
    void (*device)(void);
} machine;

extern machine m;

/* A new chip: its UART is initialised as CubeMX does, at 115200 baud with even parity. */
void machine_start(uint8_t receivesByDma, uint8_t sendsByDma);

/* Lets time pass. Interrupts come in at their times. */
void machine_run(uint32_t micros);

/* Characters arrive one after the other, after those that are on their way, and after a silence. */
void machine_receive(const uint8_t *bytes, unsigned count, uint32_t silenceUs);
/* One character with an error, or several. */
void machine_receive_faulty(uint8_t byte, unsigned errors);
/* How many characters are on their way. */
unsigned machine_coming(void);

/* --- what a chip has */

void chip_start(uint8_t receivesByDma, uint8_t sendsByDma);
void chip_clock(void);                            /* the time has changed */
void chip_receive(uint8_t byte, unsigned errors); /* a character has arrived */
void chip_idle(void);                             /* the line is silent for a character */
int chip_next(void);                              /* the next character to send, or -1 */
void chip_sent(void);                             /* there is none: the last bit has left */
void chip_interrupts(void);                       /* calls the interrupts that wait */
unsigned chip_kept(void);                         /* characters that each direction keeps */
int chip_is_driving(void);                        /* the pin, or the transmitter of a wire */
/* What a program does with the HAL. */
void chip_stop_uart(void);
void chip_start_uart(void);
void chip_abort_reception(void);
void chip_single_wire(void);

#endif
