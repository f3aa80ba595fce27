/* What the parts of the bench of servers share. */
#ifndef BENCH_SERVER_H
#define BENCH_SERVER_H

#include "mbm.h"

#include <modbus.h>

enum { UNIT = 17, MOST = 260 };

/* What both servers serve: four tables with one pattern. */
extern mbm_unit unit;
extern modbus_mapping_t *mapping;

uint16_t pattern(unsigned address);
void fail(const char *what);

/* Fills the tables of both servers. */
void prepare_tables(void);

/* Requests per second of two server loops with 32 connections. */
void compare_loops(void);

/* The instructions that loops execute for a request, for callgrind to count. */
void count_loops(void);

#endif
