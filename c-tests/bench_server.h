/* What the files of the server benchmark share. */
#ifndef BENCH_SERVER_H
#define BENCH_SERVER_H

#include "mbm.h"

#include <modbus.h>

enum { UNIT = 17, MOST = 260 };

/* The unit that both servers serve: four tables filled with one pattern. */
extern mbm_unit unit;
extern modbus_mapping_t *mapping;

uint16_t pattern(unsigned address);
void fail(const char *what);

/* Fills the tables of both servers. */
void prepare_tables(void);

/* Measures the requests per second of the server loops with 32 connections, and of the program
 * `other`, which prints the port on which it serves. */
void compare_loops(const char *other);

/* Makes `total` requests with 32 connections to a server. */
void make_requests(const char *port, const char *total);

/* Runs the loops for callgrind, which counts the instructions of each request. */
void count_loops(void);

#endif
