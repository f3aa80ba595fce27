/* The cells of the tables of a device, for the server's part of its header.
 *
 * Licence: MIT OR Apache-2.0. */
#ifndef HEADER_CELLS_H
#define HEADER_CELLS_H

#include "header.h"

/* HEADER_TABLES is how many tables of a kind a unit has at most: of its MBM_MAX_SERVICES records,
 * some are left for others. */
enum { HEADER_CELLS = 65536, HEADER_TABLES = 3 };

/* What a unit has at an address. */
enum { HAS_CELL = 1, HAS_READ = 2, HAS_WRITE = 4 };

/* The cells of one table of one unit, and its parts: from first[i] to last[i], each with an array
 * of its own. A hole that is small is within a part. */
typedef struct header_cells {
    uint16_t unit;
    uint8_t table;
    uint8_t has[HEADER_CELLS];
    uint16_t words[HEADER_CELLS]; /* what the file says */
    uint32_t first[HEADER_TABLES], last[HEADER_TABLES];
    int parts; /* 0 if the unit has no such table */
} header_cells;

/* Finds the cells of a table of a unit. */
void header_find_cells(const header *h, uint16_t unit, uint8_t table, header_cells *into);

/* Whether the table has bits, and not registers. */
int header_is_bits(uint8_t table);

/* Returns the part that has an address. */
int header_part_of(const header_cells *of, uint16_t address);

/* The name of a table in C, such as "holding". */
const char *header_table_name(uint8_t table);

/* Writes the name of a part of a table: sdm120_holding, or sdm120_unit17_holding_400. */
void header_write_name(const header *h, const header_cells *of, int part);

/* Writes the functions that get and set the value of a field, whose table has these cells. Returns
 * 0 without memory. */
int header_write_accessors(const header *h, uint16_t at, const header_cells *of);

/* Writes the function that swaps bytes, if one of those needs it. */
void header_write_swap(const header *h);

#endif
