/**
 * @file mbm_porttest.h
 * @brief Tests a port of yours on your board, and says in a sentence what is wrong and what to do.
 *
 * Compile the four mbm_porttest*.c that lie beside this file with your port, and call
 * mbm_portTest_run once from a program that has started the UART and the clock:
 *
 *     static void print(void *context, mbm_portFinding kind, const char *sentence)
 *     {
 *         my_console(mbm_portFinding_name(kind));
 *         my_console(sentence);
 *     }
 *
 *     static mbm_portTest test;    // all that is not set is 0: a check that needs it is left out
 *     test.port = &my_port;
 *     test.isLooped = 1;           // a wire leads from TX to RX
 *     test.baud = 9600;            // 8N1
 *     test.say = print;
 *     if (mbm_portTest_run(&test) == 0) ... the port passes
 *
 * It needs a wire from the pin TX to the pin RX, with no transceiver between, or a second port at
 * the other end of the line. With neither it makes the checks that need no wire. It uses no heap,
 * no printf and no interrupt, runs in one task, and ends by itself, whatever the port does, unless
 * a hook never returns. Other tasks may run beside it: what they delay is no fault of the port.
 *
 * Licence: MIT OR Apache-2.0.
 */
#ifndef MBM_PORTTEST_H
#define MBM_PORTTEST_H

#include "mbm.h"

#ifdef __cplusplus
extern "C" {
#endif

/** What a sentence is about. */
typedef enum mbm_portFinding {
    MBM_PORT_WRONG,   /**< a fault: the port breaks a rule of docs/port.md */
    MBM_PORT_ADVICE,  /**< the port works; the sentence says what would be better, or a setting of
                         mbm */
    MBM_PORT_FACT,    /**< what was measured */
    MBM_PORT_LEFT_OUT /**< a check that was not made, and what it needs */
} mbm_portFinding;

/** A test of a port. Zero it, set the fields that apply, and keep it valid while the test runs. */
typedef struct mbm_portTest {
    /* --- the line */

    /** The port to test. Its UART is started, and no object of mbm uses it. */
    const mbm_port *port;
    /** A second port at the other end of the line, or NULL. It is taken to be right. */
    const mbm_port *other;
    /** 1: what the port sends comes back to it. */
    uint8_t isLooped;
    /** Bits of a character: 0 means 10, those of 8N1; 11 with a parity or two stop bits. */
    uint8_t bits;
    /** How many bytes the receiver holds while your main loop is away: the size of its ring, less
     *  one. 0: not known, then the test says how many it held of 256. */
    uint16_t holds;
    /** Bits per second. 0 if there is no such rate: a socket, USB, an emulator. Then nothing is
     *  said about times on the wire. */
    uint32_t baud;
    /** 1: `write` waits until it has handed over all bytes, and you know it, as the Stream of an
     *  Arduino core does. 0: that is a fault. */
    uint8_t mayWait;

    /* --- functions of yours. Each gets `context`, and each may be NULL */

    /** Receives each sentence. It is valid during the call. */
    void (*say)(void *context, mbm_portFinding kind, const char *sentence);
    /** Returns how many received bytes your port has lost: mbm_ring_lost, a counter of overruns. */
    uint32_t (*lost)(void *context);
    /** Reads the pin of the RS-485 driver back: 1 while it sends, 0 while it receives. */
    uint8_t (*driver)(void *context);
    /** Begins the port again, as your program would: 0 if that worked. */
    uint8_t (*begin)(void *context);
    /** Makes the receiver see an error: a break, a byte at another rate or with another parity. */
    void (*disturb)(void *context);
    /** Closes the connection at its far end. For a port over a socket. */
    void (*hangUp)(void *context);
    /** A second clock, in microseconds, that is known to be right. */
    uint32_t (*reference)(void *context);
    /** Called again and again while the test waits. Runs what the port needs, as the loop of lwIP
     * or TinyUSB does, or lets other tasks run for at most a tick. */
    void (*yield)(void *context);
    /** Passed to these functions. */
    void *context;

    /* --- the result */

    /** Faults. 0 after mbm_portTest_run: the port passes. */
    uint16_t wrong;
    /** Sentences of MBM_PORT_ADVICE. */
    uint16_t advice;
    /** Checks that were made. */
    uint16_t checks;
    /** Checks that were left out. */
    uint16_t leftOut;
    /** The most bytes that arrived at once; 0 before that was measured. */
    uint16_t longestBlock;
    /** The longest pause between two bytes that had none on the wire, in microseconds. */
    uint32_t longestPauseUs;

    uint32_t stepUs;    /**< private */
    uint32_t exactUs;   /**< private */
    uint32_t yieldUs;   /**< private */
    uint8_t isOver;     /**< private */
    uint8_t startsOn;   /**< private */
    uint8_t seed;       /**< private */
    mbm_port silent;    /**< private */
    mbm_line line;      /**< private */
    mbm_node node;      /**< private */
    uint16_t words[2];  /**< private */
    uint8_t frame[256]; /**< private */
    char sentence[256]; /**< private */
} mbm_portTest;

/**
 * Makes every check for which it has what it needs, and says what it finds. Takes some seconds at
 * 9600 baud. It may be called again.
 *
 * @param test  see mbm_portTest
 * @return the number of faults, 0 if the port passes; 1 also for a `port` that is NULL
 */
uint16_t mbm_portTest_run(mbm_portTest *test);

/**
 * Watches the clock for longer than mbm_portTest_run does, which watches it for a tenth of a
 * second. A clock that is made by dividing a counter jumps back when the counter wraps, 60 s after
 * its start at 72 MHz: watch it for 61000 ms.
 *
 * @param test      as for mbm_portTest_run; only `port`, `reference`, `say` and `yield` are used
 * @param millis    how long, up to 4000000 ms
 * @return the number of faults
 */
uint16_t mbm_portTest_watchClock(mbm_portTest *test, uint32_t millis);

/**
 * Returns a word for a kind of finding: "wrong", "advice", "fact", "left out".
 *
 * @param kind  a kind
 * @return a constant string
 */
const char *mbm_portFinding_name(mbm_portFinding kind);

#ifdef __cplusplus
}
#endif

#endif
