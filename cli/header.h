/* The C header of a device: what cli/header.c, which is `mbm header`, shares with the writers of
 * its parts. Each part is written to `out`, which is in memory: nothing is kept of a header that is
 * refused. */
#pragma once

#include "device.h"

#include <stdio.h>

/* Bytes of the longest C name of a device. */
enum { HEADER_NAME_BYTES = 255 };

/* The scale of a field: the number in the registers is multiplied, then divided. 1 and 1 without a
 * scale. */
typedef struct header_scale {
    int32_t multiplier, divisor;
} header_scale;

typedef struct header {
    FILE *out;
    const device *of;
    const char *path, *file; /* of the device file, whole and without its folders */
    char *upper, *lower;     /* the C name of the device */
    char **fields, **lowers; /* the C names of its fields, in upper and in lower case */
    header_scale *scales;
    void *names;   /* that the header defines: a tree of tsearch */
    uint16_t unit; /* of all fields; 0 if they have several */
    /* The plan: its fields in the order of their reads, as indexes of the device's fields, how many
     * fields each read has, and the words of data. */
    uint16_t *order, *counts;
    uint16_t reads, words;
    int gap; /* of the command line, or DEVICE_PLAN_OWN_GAP */
} header;

/* Notes a name that the header defines, a field's name and what follows it, such as "_ADDRESS".
 * Returns 0 after reporting that there is the same name already. */
int header_define(header *h, uint16_t field, const char *suffix, int line);

/* Turns a text into a part of a C name: its identifier in upper case. NULL without memory; empty if
 * it has no letter and no digit. */
char *header_upper(const char *text);

/* Writes a text for a comment in C: what would end or begin a comment, or change the direction of
 * the line, is replaced. */
void header_comment(FILE *out, const char *text);

/* Writes where a field is, such as "holding registers 0 to 1", with the addresses as in the file.
 */
void header_place(const header *h, const mbm_planField *planned);

/* Writes a whole number as a constant in C of a type that holds it everywhere. */
void header_write_constant(FILE *out, const char *number);

/* The C type of a field's value; that of a bit is uint8_t. */
const char *header_type(const mbm_planField *planned);

/* The same of any number, also of a type that a plan does not know. */
const char *header_number_type(const mbm_planField *planned);

/* Whether a field has a scale that is a number. */
int header_is_scaled(const device_field *field);

/* Writes a number that a file has as a decimal one, after `before`. */
void header_write_number(FILE *out, const char *before, const value_scale *number);

/* Write the limits of a field in words; and its power of ten and its offset, if it has them:
 * "times 10^(power_sf), plus -40", between `before` and `after`. */
void header_write_limits(FILE *out, const device_field *field);
void header_write_meaning(FILE *out, const device_field *field, const char *before,
                          const char *after);

/* Begins a part for clients and servers, with a title. `#endif` ends it. */
void header_begin_shared(const header *h, const char *title);

/* Begins the function that gets the value of a field of a plan: as a double, or times 10^decimals.
 */
void header_begin_getter(const header *h, uint16_t at, int is_decimal);

/* Writes the constants of a field's limits. Returns 0 after reporting a refusal. */
int header_write_limit_constants(header *h, uint16_t at);

/* Writes the functions that check whether a number is within the limits of a field; whether a field
 * has such a function. */
void header_write_checks(const header *h);
int header_is_checked(const header *h, uint16_t at);

/* Writes the conversions of a plan's fields. Returns 0 after reporting a refusal. */
int header_write_conversions(header *h);

/* The offset of a field as a number of 32 bits and its decimals. Returns 0 after reporting that it
 * does not fit. */
int header_find_offset(const header *h, const device_field *field, int32_t *offset,
                       unsigned *decimals);

/* Write a part of the header. They return 0 after reporting a refusal. */
int header_write_fields(header *h);
int header_write_plan(header *h);
int header_write_server(header *h);

/* The name of the constant that a key of the reach becomes, without the device's; NULL if the
 * device has no such key, or says the default. */
const char *header_reach_name(const header *h, int key);

/* Writes the constants and functions of the reach; whether there are any. */
void header_write_reach(const header *h);
int header_has_reach(const header *h);

/* Whether a field has functions of its own, because a plan does not know its type or order. */
int header_is_special(const mbm_planField *planned);

/* Writes the functions that take such fields out of registers and put them into them, and those
 * that get their values of a plan, which returns 0 after reporting a refusal; and those of a
 * server, which get and set one in the array of its table, of the addresses `first` to `last`. */
int header_write_types(const header *h);
void header_write_special(const header *h, uint16_t at, const char *name, const char *array,
                          uint32_t first, uint32_t last);

/* Writes the page of documentation. */
void header_write_page(header *h);
