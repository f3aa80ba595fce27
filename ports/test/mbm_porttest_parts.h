/* What the parts of the test of ports share. Licence: MIT OR Apache-2.0. */
#ifndef MBM_PORTTEST_PARTS_H
#define MBM_PORTTEST_PARTS_H

#include "mbm_porttest.h"

/* The sentences are in flash on an AVR, where constants take RAM. */
#if defined(__AVR__)
#include <avr/pgmspace.h>
#define TEXT(words) PSTR(words)
#define CHARACTER(at) ((char)pgm_read_byte(at))
#else
#define TEXT(words) (words)
#define CHARACTER(at) (*(at))
#endif

/* Microseconds: the longest time that a hook may take in which it does not wait. */
enum { NO_WAIT = 500 };

/* How often a time that is too long is measured: other work of the processor makes many too long.
 */
enum { TRIES = 64 };

/* A short frame, as most requests are. */
enum { FEW = 8 };

/* Bytes on their way from one port to another, and what was seen of them. */
typedef struct passage {
    const mbm_port *from;
    const mbm_port *to;  /* NULL without a wire */
    uint16_t length;     /* bytes to send */
    uint8_t isAway;      /* 1: nothing is read until all were sent, as by a busy main loop */
    uint8_t isFlushed;   /* flush has returned 1 */
    uint8_t isDifferent; /* a byte was not the next one that was sent */
    uint8_t wanted;      /* that one */
    uint8_t came;        /* the byte that came instead */
    uint8_t after;       /* and the one after that */
    uint8_t hasAfter;
    uint16_t taken;   /* bytes that write took */
    uint16_t atOnce;  /* the most of them in one call */
    uint16_t arrived; /* bytes that read returned */
    uint16_t right;   /* of these, before the first that was different */
    uint16_t block;   /* bytes that arrived at once, at the end */
    uint16_t longestBlock;
    uint32_t longestPauseUs; /* between two blocks */
    uint32_t longestWriteUs; /* of one call */
    /* From the first call of write on. */
    uint32_t flushedUs; /* until flush returned 1 */
    uint32_t waitedUs;  /* the same, if that call waited; else 0 */
    uint32_t lastUs;    /* until the last byte arrived */
    uint32_t askedUs;   /* from the last write until the last call of flush that returned 0 */
    /* The driver. */
    uint32_t switchedUs; /* the longest call of one of its hooks */
    uint8_t wasOn;       /* before */
    uint8_t wentOn;      /* in preTransmission, or by itself while the bytes left */
    uint8_t staysOn;     /* afterwards */
    uint8_t wentOff;     /* before the last bit */
    uint32_t offUs;      /* when */
    uint32_t unseenUs;   /* the longest time between two looks at its pin, and until flush is 1 */
    uint32_t yieldUs;    /* the longest call of yield */
} passage;

/* --- mbm_porttest.c */

/* Says a sentence; in it each % becomes a number. */
void mbm_portTest_say(mbm_portTest *test, mbm_portFinding kind, const char *words,
                      const uint32_t *numbers);

/* The same without a number, and with some. */
#define SAY(test, kind, words) mbm_portTest_say(test, kind, TEXT(words), NULL)
#define SAY_NUMBERS(test, kind, words, ...)                                                        \
    mbm_portTest_say(test, kind, TEXT(words), (const uint32_t[]){__VA_ARGS__})

/* The time of the reference, or of the port. */
uint32_t mbm_portTest_now(const mbm_portTest *test);

uint32_t mbm_portTest_since(const mbm_portTest *test, uint32_t then);

/* The shortest step of that time. */
uint32_t mbm_portTest_step(const mbm_portTest *test);

/* Whether a time that was too long is measured again, after some tries since `began`. */
uint8_t mbm_portTest_tries_again(const mbm_portTest *test, uint32_t began, uint8_t tries);

/* Returns for how long other tasks take the processor at a time, as the clock shows in a fifth of a
 * second. A task that sleeps may wake later by that time. */
uint32_t mbm_portTest_away(const mbm_portTest *test);

/* How many microseconds `count` characters last; 0 without a baud rate. */
uint32_t mbm_portTest_characters(const mbm_portTest *test, uint16_t count);

/* Whether what a port sends can be received. */
uint8_t mbm_portTest_has_wire(const mbm_portTest *test);

void mbm_portTest_yield(mbm_portTest *test);

/* --- mbm_porttest_line.c */

/* A passage in which the tested port sends, and one in which it receives. */
passage mbm_portTest_sending(const mbm_portTest *test, uint16_t length);
passage mbm_portTest_receiving(const mbm_portTest *test, uint16_t length);

/* Reads until nothing has come for a while. Returns 0 and says why if that does not end, or the
 * link is lost. */
uint8_t mbm_portTest_drain(mbm_portTest *test, const mbm_port *port);

/* Sends bytes and receives them. Returns 0, and says why, if the test cannot go on. */
uint8_t mbm_portTest_pass(mbm_portTest *test, passage *bytes);

/* Returns whether the bytes arrived as they were sent, or there is no wire; says why if not. */
uint8_t mbm_portTest_have_arrived(mbm_portTest *test, passage *bytes);

/* Returns whether a few bytes arrive as they are sent, in one of some tries: bytes that were sent
 * before may come late. */
uint8_t mbm_portTest_is_alive(mbm_portTest *test);

/* --- mbm_porttest_checks.c */

void mbm_portTest_checkWrite(mbm_portTest *test);
void mbm_portTest_checkFlush(mbm_portTest *test);
void mbm_portTest_checkWire(mbm_portTest *test);

/* --- mbm_porttest_hooks.c */

void mbm_portTest_checkClock(mbm_portTest *test, uint32_t millis);
void mbm_portTest_checkRead(mbm_portTest *test);
void mbm_portTest_checkIdle(mbm_portTest *test);
void mbm_portTest_checkBegin(mbm_portTest *test);
void mbm_portTest_checkDisturbed(mbm_portTest *test);
void mbm_portTest_checkHangUp(mbm_portTest *test);

#endif
