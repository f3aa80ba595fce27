/* Programs that read the registers of devices on one simulated line: a node that does not block, or
 * a client in RTU or ASCII. */
#ifndef READER_H
#define READER_H

#include "sim.h"

enum {
    MS = 1000,
    PROMPT = 3 * MS,    /* what most devices take for a reply */
    NEVER = 2000000000, /* no limit */
    UNIT = 17,
    DEVICES = 8
};

/* A device answers in order, in its time. Its requests are numbered from 1 on. */
typedef struct device {
    uint8_t unit;
    uint32_t takes;
    unsigned lost, losses;   /* the number of the first reply that is lost, and how many are */
    unsigned late;           /* the number of the reply that is late */
    uint32_t takes_for_late; /* what the device takes for it */
    int8_t deviates;         /* how many registers more than requested its replies have */
    uint8_t repeats_wrong;   /* 1: the reply to a write repeats another value */
    uint8_t exception;       /* the exception with which it answers its first request */
    unsigned cut,
        damaged;       /* the numbers of replies that lose their second half, or have a wrong CRC */
    unsigned trailing; /* bytes 0x00 that its driver adds to each reply */
    unsigned requests;
    uint64_t free; /* when its last reply has been sent */
} device;

typedef enum reader_kind { NODE_READS, CLIENT_READS, ASCII_CLIENT_READS, READERS } reader_kind;

/* A line with devices, and the program that reads them. */
typedef struct bench {
    sim *s;
    device devices[DEVICES];
    unsigned count;
    reader_kind kind;
    mbm_client client;
    uint8_t frame[MBM_MAX_ASCII_FRAME];
    mbm_clientRequest request;
    uint16_t word;
} bench;

/* Begins on a line that has been silent for long, with a response timeout in microseconds. */
void bench_begin(bench *b, sim *s, reader_kind kind, uint32_t timeout);
device *bench_add(bench *b, uint8_t unit, uint32_t takes);
void bench_set_timeout(bench *b, uint32_t timeout);

/* Loses the next replies of a device; makes the next one late. */
void device_loses(device *d, unsigned losses);
void device_is_late(device *d, uint32_t takes);

/* The steps of a read, and a whole one, which gives up after the limit. A read that succeeds has
 * the right value. bench_goes_on returns MBM_PENDING if the request has not ended at the limit. */
uint8_t bench_starts(bench *b, uint8_t unit, uint16_t address);
uint8_t bench_polls(bench *b);
uint8_t bench_goes_on(bench *b, uint16_t address, uint32_t limit);
void bench_cancels(bench *b);
uint8_t bench_reads(bench *b, uint8_t unit, uint16_t address, uint32_t limit);

/* Sleeps as a program would: until a byte arrives, for at most `delay`, and not beyond `end`. */
void sleep_until_a_byte(sim *s, uint32_t delay, uint64_t end);

#endif
