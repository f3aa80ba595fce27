/* One master on a simulated wire with a clock of its own: nothing waits, all
 * times are exact, and everything that happens is recorded. */
#ifndef SIM_H
#define SIM_H

#include "mbm.h"

#include <stddef.h>
#include <stdint.h>

enum { SIM_BYTES = 8192, SIM_FRAMES = 256, SIM_ANSWERS = 32, SIM_ORDER = 512 };

typedef struct sim sim;

/* One request on the wire. Times are in microseconds since the test began. */
typedef struct sim_frame {
    uint64_t begin, end; /* first byte handed over; last bit gone */
    uint64_t silence;    /* from the last byte seen or sent to `begin` */
    uint16_t length;
    uint8_t whole; /* a request that the standard allows, right CRC */
    uint8_t bytes[256];
} sim_frame;

struct sim {
    mbm_master master;
    mbm_port port;
    mbm_counters counters;
    uint16_t response[MBM_MAX_READ_REGISTERS], transmit[MBM_MAX_WRITE_REGISTERS];
    uint8_t buffer[MBM_MAX_FRAME];

    /* the clock */
    uint64_t now;
    uint64_t limit;       /* the test fails beyond: a hang */
    uint32_t clock_start; /* what the clock showed when `now` was 0 */
    uint32_t step;        /* each look at the clock takes so long */
    mbm_master *waits;    /* the master that the idle hook was called for last */
    uint32_t idle_step;   /* an idle hook takes so long, less if a byte comes */

    /* the wire and its faults; 0 is none */
    uint32_t character;     /* a byte takes so long, in both directions */
    uint16_t write_piece;   /* write accepts at most so many */
    uint16_t write_busy;    /* write accepts nothing so often before it does */
    uint16_t write_dies_at; /* link lost after so many bytes of a request */
    uint16_t read_piece;    /* read gives at most so many */
    int16_t overclaim;      /* read and write claim so many more than asked */
    uint8_t write_never, flush_never, flush_lies, read_dead, echo;

    /* what the test may hook in */
    void (*device)(sim *s, const sim_frame *frame); /* heard a whole request */
    void (*on_idle)(sim *s);
    void (*tap)(sim *s, uint8_t byte); /* the master read a byte */
    void *context;

    /* what happened */
    sim_frame frames[SIM_FRAMES];
    unsigned sent;         /* frames begun, the last at sent - 1 */
    char order[SIM_ORDER]; /* P W F O I R, runs collapsed */
    uint64_t order_at[SIM_ORDER];
    size_t order_length;
    unsigned idles, driver_on;
    unsigned idle_while_driving, write_without_driver, post_before_last_bit;
    unsigned cut_allowed; /* frames that the test itself cut short */
    uint64_t last_byte, transmitted;

    /* what is still to arrive */
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

/* cmocka's setup and teardown: a begun master for unit 17 with full buffers in
 * *state; at the end nothing malformed may have been sent. */
int sim_setup(void **state);
int sim_teardown(void **state);

/* Begins to talk to `unit` over the simulated wire, with its hooks. */
void sim_begin(sim *s, uint8_t unit);

/* Bytes of a text such as "11 03 02 00 0A +": + is the CRC of the frame so
 * far, / starts another frame. Returns how many. */
size_t sim_bytes(uint8_t *bytes, const char *text);

/* Lets bytes arrive `delay` after the end of the nth request from now (1 is
 * the next); each byte takes its character time. */
void sim_answer(sim *s, unsigned nth, uint32_t delay, const char *text);

/* Lets bytes arrive from `at` on. */
void sim_deliver(sim *s, uint64_t at, const uint8_t *bytes, size_t length);
void sim_deliver_text(sim *s, uint64_t at, const char *text);

/* Asserts that frame `index` is what the text says. */
void sim_assert_sent(const sim *s, unsigned index, const char *text);

/* Asserts the order of the events whose letters are in `which`. */
void sim_assert_order(const sim *s, const char *which, const char *order);

/* Polls a non-blocking request to its end, with idle time between. */
uint8_t sim_poll(sim *s);

/* When the first event of a kind happened. */
uint64_t sim_time_of(const sim *s, char event);

/* What the simulation's own steps may add to a time, in microseconds. */
enum { SIM_SLACK = 60 };
void sim_assert_time(uint64_t time, uint64_t wanted);

/* Reads register 0 of unit 17; the second answers that after `delay`, and
 * asserts that it is read right. */
uint8_t sim_read_one(sim *s);
void sim_reads(sim *s, uint32_t delay);

/* The simulation and its master in a test. */
#define NODE                                                                                       \
    sim *s = (sim *)*state;                                                                        \
    mbm_master *n = &s->master

#define SIM_TEST(test) cmocka_unit_test_setup_teardown(test, sim_setup, sim_teardown)

#endif
