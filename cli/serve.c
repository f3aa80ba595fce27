/* mbm serve: a device from a file, one whose values vary, or one that holds what is written.
 *
 * Licence: MIT OR Apache-2.0. */
#define _GNU_SOURCE
#include "commands.h"
#include "device_file.h"
#include "numbers.h"
#include "options.h"
#include "report.h"
#include "serve_line.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { RANDOM_KEY = 0x2000, ECHO_KEY, FAULT_KEY };

static struct {
    const char *line, *file, *unit_text;
    const char *fault_texts[FAULT_MOST];
    uint32_t fault_count;
    int is_random, is_echo, is_quiet;
} wanted;

static place where;
static fault_list faults;
static uint8_t ids[OPTIONS_UNITS], id_count;

/* --- the command line --- */

/* Checks what was given, once all of it is known. */
static void check(const struct argp_state *state)
{
    uint32_t i;

    if (!wanted.line)
        options_wrong(state, "LINE is missing, such as pty: or tcp://:1502");
    if ((wanted.file != NULL) + wanted.is_random + wanted.is_echo != 1)
        options_wrong(state, "give a device FILE, or --random, or --echo");
    if (wanted.unit_text && wanted.file)
        options_wrong(state, "--unit goes with --random and --echo: a device file has its units");
    options_place(state, &where, wanted.line, 1);
    for (i = 0; i < wanted.fault_count; i++) {
        const char *wrong = fault_read(&faults, wanted.fault_texts[i], where.kind);

        if (wrong)
            options_wrong(state, "--fault %s", wrong);
    }
    id_count =
        (uint8_t)options_units(state, "--unit", wanted.unit_text ? wanted.unit_text : "1", ids);
}

static error_t parse(int key, char *text, struct argp_state *state)
{
    switch (key) {
    case 'u': wanted.unit_text = text; return 0;
    case RANDOM_KEY: wanted.is_random = 1; return 0;
    case ECHO_KEY: wanted.is_echo = 1; return 0;
    case 'q': wanted.is_quiet = 1; return 0;
    case FAULT_KEY:
        if (wanted.fault_count == FAULT_MOST)
            options_wrong(state, "there are more than %d --fault options", FAULT_MOST);
        wanted.fault_texts[wanted.fault_count++] = text;
        return 0;
    case ARGP_KEY_ARG:
        if (state->arg_num > 1)
            options_too_many(state, text);
        *(state->arg_num == 0 ? &wanted.line : &wanted.file) = text;
        return 0;
    case ARGP_KEY_END: check(state); return 0;
    default: return ARGP_ERR_UNKNOWN;
    }
}

static const struct argp_option texts[] = {
    {"random", RANDOM_KEY, NULL, 0,
     "Every address can be read and written; values that were not written vary", 1},
    {"echo", ECHO_KEY, NULL, 0, "Every address is 0 at first, and holds what is written", 1},
    {"unit", 'u', "N", 0, "Units of --random and --echo, such as 1, 1,17 or 1-10 (1)", 1},
    {"fault", FAULT_KEY, "FAULT", 0, "Answer wrongly: see below", 2},
    {"quiet", 'q', NULL, 0, "Print no summary to stderr", 3},
    {NULL, 0, NULL, 0, NULL, 0}};

static const struct argp_child children[] = {{&options_trace, 0, NULL, 0}, {NULL, 0, NULL, 0}};

static const struct argp parser = {
    texts,
    parse,
    "LINE FILE\nLINE --random\nLINE --echo",
    "Serves a device until Ctrl-C: the values of a device file, or every address.\v"
    "LINE is pty: (a pseudo terminal), pty:PATH (one with a link to it), rtu:PATH, ascii:PATH, "
    "tcp://:PORT, rtu+tcp://:PORT, udp://:PORT or tls://:PORT?ca=FILE&cert=FILE&key=FILE. With "
    "port 0 the system chooses one. The first line of the output says where it serves.\n\n" FAULT_HELP
    "\nmbm serve pty:/tmp/meter meter.yaml --fault late=2s@10\n"
    "mbm serve tcp://:1502 --random --unit 1-10 --fault 'exception=6@5/5'",
    children,
    NULL,
    NULL};

/* --- the command --- */

/* Prints the line that scripts wait for: serving unit 1 on /dev/pts/3. */
static void announce(const served_units *units, const char *name)
{
    int i, last;

    printf("serving unit%s ", units->count > 1 ? "s" : "");
    for (i = 0; i < units->count; i = last + 1) {
        for (last = i;
             last + 1 < units->count && units->units[last + 1].id == units->units[last].id + 1;
             last++)
            ;
        printf("%s%u", i ? ", " : "", units->units[i].id);
        if (last > i)
            printf("-%u", units->units[last].id);
    }
    printf(" on %s\n", name);
    report_flush();
}

static int make_units(served_units *units, const device *from, served_hook *hook)
{
    const int status =
        wanted.file ? served_make_device(units, from, hook)
                    : served_make_units(units, wanted.is_random ? SERVED_RANDOM : SERVED_ECHO, ids,
                                        id_count, hook);

    return status == 0 ? CODE_DONE : report(CODE_SYSTEM, "there is no memory for the units");
}

static int serve(served_units *units)
{
    char name[SERVE_LINE_NAME_BYTES];
    int code = serve_line_open(&where, name);

    if (code == CODE_DONE) {
        announce(units, name);
        code = serve_line_run(units);
        if (!wanted.is_quiet)
            fprintf(stderr, "%s: requests: %u, with a fault: %u.\n", report_name, faults.requests,
                    faults.hit);
    }
    serve_line_close();
    return code;
}

int serve_command(int argc, char **argv)
{
    static served_units units;
    served_hook hook = {.before = serve_line_before, .context = &faults};
    device from = {0};
    char wrong[YAML_FILE_WRONG_BYTES] = "";
    int code = CODE_DONE;

    argp_parse(&parser, argc, argv, 0, NULL, NULL);
    if (wanted.file)
        code = device_file_read(&from, wanted.file, wrong);
    if (code != CODE_DONE)
        return report(code, "%s", wrong);
    code = make_units(&units, &from, &hook);
    if (code == CODE_DONE)
        code = serve(&units);
    served_free(&units);
    device_free(&from);
    return code;
}
