/* The device file that `mbm import` makes of another program's configuration: its keys and fields,
 * and what could not be taken over. */
#pragma once

#include "tree.h"

#include <stdint.h>

/* A key and its value as they are written, and the line of the foreign file that they come from. */
typedef struct import_pair {
    char *key, *value;
    int line;
} import_pair;

enum { IMPORT_KEYS = 32 };

/* The head of the file, or a field. */
typedef struct import_part {
    char *name, *topic, *identifier; /* of a field; see names.h */
    import_pair pairs[IMPORT_KEYS];
    unsigned count;
    int line; /* of the foreign file */
} import_part;

/* An import. It is zeroed at first, but for what the command line says. */
typedef struct import {
    const char *path;
    /* options */
    const char *output, *hub;
    uint32_t address, count, unit;
    int has_address, has_count, has_unit;

    char *line; /* the name of the line that the configuration has, or NULL */
    import_part head, *fields;
    unsigned field_count, capacity;
    unsigned lost; /* how many things were not taken over */
    int is_out_of_memory;
} import;

/* Names something that is not taken over, on stderr: "mbm import: FILE:12: WHAT: why." */
void import_lose(import *j, int line, const char *what, const char *why, ...)
    __attribute__((format(printf, 4, 5)));

/* Names each key of a map that nothing has looked up. `of` says of what: "sensor Voltage". */
void import_lose_rest(import *j, const tree *map, const char *of);

/* A word of the other program, and the word of the device file that means the same. The last of an
 * array has NULL for both. */
typedef struct import_words {
    const char *theirs, *ours;
} import_words;

/* Returns the device file's word for a word of the other program; NULL if it has none. */
const char *import_word(const import_words *words, const char *theirs);

/* Set the name of the line, as the command line of mbm has it. import_line takes any name.
 * import_serial_line makes that of a serial line: `frames` is rtu or ascii, and only the first
 * character of `parity` and of `data` counts. */
void import_line(import *j, const char *name, ...) __attribute__((format(printf, 2, 3)));
void import_serial_line(import *j, const char *frames, const char *path, const char *baud,
                        const char *parity, const char *stop, const char *data);

/* Begins a field. Its name is `text`, changed so that it obeys the rule of names and no field
 * before has it. Returns its index. */
unsigned import_field(import *j, int line, const char *text);

/* The name of a field, without quotes. */
const char *import_name(const import *j, unsigned field);

/* Sets a key of a field, or of the head (IMPORT_HEAD): a value as YAML writes it, or any text,
 * which is quoted if necessary. */
enum { IMPORT_HEAD = 0x7FFFFFFF };
void import_set(import *j, unsigned field, int line, const char *key, const char *value, ...)
    __attribute__((format(printf, 5, 6)));
void import_set_text(import *j, unsigned field, int line, const char *key, const char *text);

/* A text as YAML writes it, in a buffer that the fourth next call overwrites. */
const char *import_quote(const char *text);

/* Removes a field, which must be the last one. */
void import_drop(import *j);

/* Read a configuration. They return an exit code, after reporting the reason if it is not
 * CODE_DONE. */
int import_homeassistant(import *j);
int import_telegraf(import *j);
int import_sunspec(import *j);

/* Leaves out what the device file refuses, names it, and writes the file. Returns an exit code. */
int import_write(import *j);
void import_free(import *j);
