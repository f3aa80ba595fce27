/* A UART whose transmitter is wired to its receiver, with a clock of its own, and a port over it
 * that may have one fault. Nothing waits; the time is that of the characters and of the calls. */
#ifndef MODEL_UART_H
#define MODEL_UART_H

#include "mbm.h"

/* What is wrong with the port; one at a time. */
typedef enum model_fault {
    RIGHT,
    CLOCK_STANDS,      /* the timer was not started */
    CLOCK_IN_MILLIS,   /* milliseconds instead of microseconds */
    CLOCK_WRAPS,       /* a counter of 32 bits divided by the cycles in a microsecond */
    CLOCK_TEARS,       /* a tick read beside its interrupt: sometimes a millisecond back */
    READ_WAITS,        /* a timeout of a millisecond */
    READ_MINUS_ONE,    /* -1 while nothing has come */
    READ_ENDLESS,      /* the last byte again and again */
    READ_OVERFLOWS,    /* all that has come, whatever the capacity */
    WRITE_WAITS,       /* until the last character is in the transmitter */
    WRITE_KEEPS,       /* the pointer, and not the bytes */
    WRITE_ONCE,        /* "busy" is never cleared */
    WRITE_ALL_OR_NONE, /* nothing of a frame that is longer than its buffer */
    WRITE_CLAIMS,      /* all of a frame, and drops what its buffer does not hold */
    WRITE_LOST,        /* the link is lost */
    FLUSH_NEVER,
    FLUSH_AT_ONCE,
    FLUSH_EARLY, /* the last byte is in the shift register */
    FLUSH_LATE,  /* a task asks every 10 ms */
    NO_FLUSH,
    DRIVER_INVERTED,
    DRIVER_DEAD,  /* the pin is no output */
    DRIVER_STAYS, /* postTransmission does nothing */
    DRIVER_WAITS, /* for 2 ms, to let the last bit leave */
    DRIVER_EARLY, /* off with the last DMA byte */
    DEAF,         /* the receiver is off */
    FULL_BLOCKS,  /* a DMA without the event of the idle line */
    LOSES,        /* one byte of 100 */
    SWALLOWS_XON,
    SEVEN_BITS,
    TRANSLATES,   /* CR becomes LF */
    TWICE,        /* a byte of 100 arrives twice */
    OVERRUN_DEAF, /* the flag of an overrun is not cleared */
    OVERRUN_UNCOUNTED,
    HOLDS_LESS,    /* its ring has 100 bytes */
    IDLE_TOO_LONG, /* a tick of 10 ms, always */
    IDLE_DEAF,     /* sleeps for pollDelay, whatever comes */
    BEGIN_FAILS,
    BEGIN_DEAF,      /* a second begin leaves reception off */
    ERROR_DEAF,      /* as OVERRUN_DEAF, of a framing error */
    ERROR_NEGATIVE,  /* a framing error is a lost link */
    CLOSED_SILENT,   /* 0 after the far end has closed the connection */
    CLOSED_FOR_EVER, /* a second begin does not close the socket, and fails */
    FAULTS
} model_fault;

enum { MODEL_TX = 2048, MODEL_RING = 2048 };

/* Set the first part, then call model_begin. */
typedef struct model_uart {
    uint32_t baud;      /* 0: bytes pass in packets of 64, each takes 1 ms */
    uint32_t callNs;    /* a hook takes so long */
    uint32_t stepUs;    /* of its clock */
    uint16_t txBuffer;  /* bytes that write can hand over */
    uint16_t ring;      /* bytes that the receiver holds */
    uint16_t block;     /* the receiver hands over so many bytes at once; 1: each */
    uint32_t idleChars; /* after this silence, in characters, it hands over fewer */
    uint8_t ownDriver;  /* the UART switches the driver itself */
    uint8_t isSocket;   /* a connection, which its far end may close; it has no flush */
    uint8_t holdsBack;  /* the sender waits while the receiver is full, as over USB and TCP */
    uint32_t awayCalls; /* at each such number of calls the task is away */
    uint64_t awayNs;    /* for so long; the UART works on */
    uint64_t wakesNs;   /* so late the task wakes from a sleep */
    uint8_t flushWaits; /* flush sleeps until the last bit has left */
    model_fault fault;

    uint64_t now, next; /* nanoseconds; the end of the character that leaves */
    const uint8_t *kept[MODEL_TX];
    uint8_t leaving[MODEL_TX], pending[MODEL_RING], held[MODEL_RING];
    uint16_t first, leavingCount, pendingCount, heldCount;
    uint64_t arrivedAt;
    uint32_t lost, characters, calls;
    uint8_t isOn, isDeaf, isUsed, isBroken, isClosed, last;
    struct model_uart *wire; /* who receives; itself for a loop */
} model_uart;

void model_begin(model_uart *m);

/* The port, with a driver's hooks if `driver`. */
mbm_port model_port(model_uart *m, int driver);

/* Functions for the test of a port. */
uint32_t model_lost(void *context);
uint8_t model_driver(void *context);
uint8_t model_again(void *context);
void model_disturb(void *context);
void model_hangUp(void *context);
uint32_t model_reference(void *context);

#endif
