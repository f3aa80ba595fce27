/* A line with one node on a simulated wire with a clock of its own. Nothing waits, all times are
 * exact, and everything that happens is recorded. */
#ifndef SIM_H
#define SIM_H

#include "mbm.h"

#include <stddef.h>
#include <stdint.h>

enum { SIM_BYTES = 8192, SIM_FRAMES = 256, SIM_ANSWERS = 32, SIM_ORDER = 512 };

typedef struct sim sim;

/* One request on the wire. Times are microseconds since the test began. */
typedef struct sim_frame {
    uint64_t begin, end; /* first byte handed over; last bit sent */
    uint64_t silence;    /* from the last byte received or sent to `begin` */
    uint16_t length;
    uint8_t whole; /* 1: a request that the standard allows, with a right CRC or LRC */
    uint8_t ascii; /* 1: it was sent in ASCII. `bytes` has it in RTU, once it is whole */
    uint8_t bytes[256];
} sim_frame;

struct sim {
    mbm_line line;
    mbm_node node;
    mbm_port port;
    mbm_counters counters;
    uint16_t response[MBM_MAX_READ_REGISTERS], transmit[MBM_MAX_WRITE_REGISTERS];
    uint8_t buffer[MBM_MAX_FRAME];

    /* the clock */
    uint64_t now;
    uint64_t limit;       /* the test fails when `now` passes it: the call hangs */
    uint32_t clock_start; /* the time that the clock showed when `now` was 0 */
    uint32_t step;        /* microseconds that each read of the clock takes */
    mbm_node *waits;      /* the node that the idle hook was called for last */
    uint32_t idle_step;   /* microseconds that an idle hook takes, less if a byte arrives */

    /* the wire and its faults; 0 means none */
    uint32_t character;     /* microseconds that a byte takes, in both directions */
    uint16_t write_piece;   /* the most bytes that write accepts at once */
    uint16_t write_busy;    /* how often write accepts nothing before it accepts bytes */
    uint16_t write_dies_at; /* the link is lost after this many bytes of a request */
    uint16_t read_piece;    /* the most bytes that read returns at once */
    int16_t overclaim;      /* how many bytes too many read and write claim */
    uint8_t write_never, flush_never, flush_lies, read_dead, echo;

    /* functions of the test */
    void (*device)(sim *s, const sim_frame *frame); /* called after a complete request */
    void (*on_idle)(sim *s);
    void *context;

    /* what happened */
    sim_frame frames[SIM_FRAMES];
    unsigned sent;         /* number of frames begun; the last is at sent - 1 */
    char order[SIM_ORDER]; /* P W F O I R, repetitions once */
    uint64_t order_at[SIM_ORDER];
    size_t order_length;
    unsigned idles, driver_on;
    unsigned idle_while_driving, write_without_driver, post_before_last_bit;
    unsigned cut_allowed; /* number of frames that the test itself cuts short */
    uint64_t last_byte, transmitted;

    /* bytes that are still to arrive */
    struct {
        uint64_t at;
        uint8_t byte;
    } incoming[SIM_BYTES];
    unsigned first, last;
    struct {
        unsigned request;
        uint32_t delay;
        uint16_t length;
        uint8_t bytes[512];
    } answers[SIM_ANSWERS];
    unsigned answered;
    uint16_t busy;
};

/* The fixture of a test. The setup makes a line with a node that is begun for unit 17, with full
 * buffers. The teardown fails if a malformed frame was sent. */
void sim_setup(void);
void sim_teardown(void);
sim *sim_of_test(void);

/* Begins the line on the simulated wire, with its hooks, and the node for `unit`. */
void sim_begin(sim *s, uint8_t unit);

/* A text ten times, for sim_bytes and those that call it. */
#define TEN(text) text text text text text text text text text text

/* Converts a text such as "11 03 02 00 0A +" to bytes: + is the CRC of the frame so far, /
 * begins another frame. Returns how many bytes. */
size_t sim_bytes(uint8_t *bytes, const char *text);

/* Lets bytes arrive `delay` microseconds after the end of the nth request from now (1 is
 * the next). Each byte takes its character time. */
void sim_answer(sim *s, unsigned nth, uint32_t delay, const char *text);

/* Lets bytes arrive from time `at` on. */
void sim_deliver(sim *s, uint64_t at, const uint8_t *bytes, size_t length);
void sim_deliver_text(sim *s, uint64_t at, const char *text);

/* Lets a frame of RTU arrive from time `at` on, in ASCII. */
void sim_deliver_ascii(sim *s, uint64_t at, const uint8_t *frame, size_t length);

/* Asserts that the frame at `index` is that of the text. */
void sim_assert_sent(const sim *s, unsigned index, const char *text);

/* Asserts the order of the events whose letters are in `which`. */
void sim_assert_order(const sim *s, const char *which, const char *order);

/* Polls a non-blocking request until it has ended, with idle time between. */
uint8_t sim_poll(sim *s);

/* The time at which the first event of a kind happened. */
uint64_t sim_time_of(const sim *s, char event);

/* The most that the simulation's own steps may add to a time, in microseconds. */
enum { SIM_SLACK = 60 };
void sim_assert_time(uint64_t time, uint64_t wanted);

/* sim_read_one reads register 0 of unit 17. sim_reads also answers it after `delay` and
 * asserts that it is read right. */
uint8_t sim_read_one(sim *s);
void sim_reads(sim *s, uint32_t delay);

/* Begins only the node again, for `unit`. */
void sim_node(sim *s, uint8_t unit);

/* A test of a simulation and its node, with a function that goes on with its setup. */
#define SIM_TEST_WITH(name, prepare)                                                               \
    static void with_##name(sim *s, mbm_node *n);                                                  \
    TEST_WITH(name, sim_setup, sim_teardown)                                                       \
    {                                                                                              \
        sim *s = sim_of_test();                                                                    \
                                                                                                   \
        prepare(s);                                                                                \
        with_##name(s, &s->node);                                                                  \
    }                                                                                              \
    static void with_##name(__attribute__((unused)) sim *s, __attribute__((unused)) mbm_node *n)
#define SIM_TEST(name) SIM_TEST_WITH(name, (void))

/* A test that is one call with `s` and `n`, as a row of a table of tests. */
#define SIM_ROW(name, call)                                                                        \
    SIM_TEST(name)                                                                                 \
    {                                                                                              \
        call;                                                                                      \
    }

#endif
