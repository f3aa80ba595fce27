/* The commands, and the options that several of them share, as children of their argp parsers.
 *
 *     static const struct argp_child children[] = {
 *         {.argp = &options_unit}, {.argp = &options_client}, {0}}; */
#pragma once

#include "conversion.h"
#include "reach.h"
#include "value.h"

#include <argp.h>
#include <stdint.h>

struct place;

typedef struct client_options {
    /* of options_request */
    uint8_t in_flight, has_replace_after, replace_after;
    /* of options_reach */
    reach reach;
    /* of options_output */
    uint8_t is_json, is_quiet;
    /* of options_unit */
    uint8_t unit;
    /* of options_values */
    uint8_t table; /* one of MBM_TABLE_ */
    value_form form;
    conversion conversion; /* of `form` */
    uint8_t has_type, is_one_based;
} client_options;

/* What the options say; their defaults if they are not given. */
extern client_options options;

/* --trace and --pcap; a program that is no client has these alone. */
extern const struct argp options_trace;
/* --timeout, --accept, --lenient, --delay, --message-wait, --close, --retries, --busy-retries,
 * --busy-wait. */
extern const struct argp options_reach;
/* --in-flight, --replace-after, and those of options_reach. */
extern const struct argp options_request;
/* --json, --quiet. */
extern const struct argp options_output;
/* Those of options_request, options_output and options_trace. */
extern const struct argp options_client;
/* --unit. */
extern const struct argp options_unit;
/* --table, --type, --order, --scale, --offset, --hex, --one-based. At the end of the command line
 * the type is that of the table: a bit, or a uint16 if none is given. */
extern const struct argp options_values;

/* Read a text of the command line; `what` names it, for example "COUNT". If the text is not right,
 * they say what is allowed and end the program with CODE_WRONG. */
int64_t options_number(const struct argp_state *state, const char *what, const char *text,
                       int64_t least, int64_t most);
uint32_t options_time(const struct argp_state *state, const char *what, const char *text,
                      uint32_t least, uint32_t most);
int options_word(const struct argp_state *state, const char *what, const char *text,
                 const char *const *words);

/* Reads unit ids from 0 to 255 such as 1,17,30-39, and puts them in ascending order. Returns how
 * many there are. */
enum { OPTIONS_UNITS = 256 };
unsigned options_units(const struct argp_state *state, const char *what, const char *text,
                       uint8_t units[OPTIONS_UNITS]);

/* Reads an address, with --one-based from 1 on. Call it when all options are read. */
uint16_t options_address(const struct argp_state *state, const char *text);

/* Ends the program with CODE_WRONG and a sentence that argp follows by where to find help. */
void options_wrong(const struct argp_state *state, const char *format, ...)
    __attribute__((format(printf, 2, 3), noreturn));

/* Refuses a word after the last one that a command takes. */
void options_too_many(const struct argp_state *state, const char *text) __attribute__((noreturn));

/* Refuses unit 0, unless it is a unit of Modbus TCP, or a client writes on a serial line. */
void options_check_unit(const struct argp_state *state, const struct place *where, int is_write);

/* Refuses unit 0 among units that are read, unless it is a unit of Modbus TCP. */
void options_check_units(const struct argp_state *state, const struct place *where,
                         const uint8_t *units);

/* Reads the LINE of a client, or of a server. */
void options_place(const struct argp_state *state, struct place *where, const char *text,
                   int is_server);

/* --- the commands, each in a file of its own --- */

/* A command gets its own arguments, the first of which is "mbm" and its name, and returns an exit
 * code: one of CODE_ of report.h. */
int read_command(int argc, char **argv);
int write_command(int argc, char **argv);
int call_command(int argc, char **argv);
int scan_command(int argc, char **argv);
int identify_command(int argc, char **argv);
int poll_command(int argc, char **argv);
int serve_command(int argc, char **argv);
int sniff_command(int argc, char **argv);
int gateway_command(int argc, char **argv);
int header_command(int argc, char **argv);
int import_command(int argc, char **argv);
int bridge_command(int argc, char **argv);
