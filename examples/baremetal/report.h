/* The firmware's report: words that it writes into the device's holding registers after all
 * requests.
 * Licence: MIT OR Apache-2.0. */
#ifndef REPORT_H
#define REPORT_H

/* The requests, in the order in which they are sent. */
enum step {
    WRITE_REGISTER,
    WRITE_REGISTERS,
    WRITE_COIL,
    WRITE_COILS,
    READ_HOLDING,
    READ_INPUT_REGISTERS,
    READ_COILS,
    READ_INPUTS,
    MASK_WRITE,
    READ_WRITE,
    READ_LONGEST,
    READ_ABSENT_REGISTER,
    BROADCAST,
    READ_WHAT_WAS_BROADCAST,
    ASK_ABSENT_UNIT,
    READ_AGAIN,
    STEPS
};

/* The words before those of the steps. */
enum {
    REPORT_MAGIC,
    REPORT_STEPS,
    REPORT_UNEXPECTED,    /* number of steps that ended with another status than expected */
    REPORT_ABSENT_MILLIS, /* how long the master waited for the absent unit */
    REPORT_REQUESTS,      /* the low words of the counters */
    REPORT_REPLIES,
    REPORT_EXCEPTIONS,
    REPORT_BAD_CRC,
    REPORT_TIMEOUTS,
    REPORT_FOREIGN_FRAMES,
    REPORT_RESYNCHRONISATIONS,
    REPORT_POLLS,      /* how often the sleeping application polled, else 0 */
    REPORT_SLEEPS,     /* how often it slept */
    REPORT_LOST_BYTES, /* bytes that its ring lost because it was full */
    REPORT_HEAD
};

/* The words of each step. */
enum { STEP_STATUS, STEP_WORDS, STEP_SUM, STEP_SIZE };

enum {
    REPORT_ADDRESS = 300,
    REPORT_SIZE = REPORT_HEAD + STEPS * STEP_SIZE,
    REPORT_IS_HERE = 0x6D62,
    UNIT = 17,
    ABSENT_UNIT = 99,
    /* Milliseconds. A simulator delivers bytes one by one, slowly on a slow computer. */
    PRESENT_TIMEOUT = 10000,
    ABSENT_TIMEOUT = 150
};

#endif
