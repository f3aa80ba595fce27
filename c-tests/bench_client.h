/* The clients that the bench compares. Each reads ten registers by FC03 from one server. */
#ifndef BENCH_CLIENT_H
#define BENCH_CLIENT_H

#include <stdint.h>

enum { UNIT = 17, ADDRESS = 7, QUANTITY = 10, TIMEOUT_MS = 1000 };

/* The registers of the server. */
extern uint16_t expected[QUANTITY];

/* Prints the error of the last system call and ends the program. */
void fail(const char *what);

/* A client. `begin` gets a blocking descriptor: of a connection if `is_tcp`, else of a pty. `read`
 * makes one transaction and returns the registers, NULL if it failed. */
typedef struct contender {
    const char *name;
    int is_tcp;
    void (*begin)(int fd);
    const uint16_t *(*read)(void);
} contender;

/* Straight C: c-tests/bench_floor.c. */
void floor_begin(int fd);
const uint16_t *floor_read_tcp(void);
const uint16_t *floor_read_rtu(void);

/* nanoMODBUS: c-tests/bench_nano.c. */
void nano_begin_tcp(int fd);
void nano_begin_rtu(int fd);
const uint16_t *nano_read_registers(void);

#endif
