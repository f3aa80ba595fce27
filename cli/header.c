/* mbm header: writes the C header of a device for firmware, or a page about it. */
#include "header.h"

#include "device.h"
#include "device_plan.h"
#include "names.h"
#include "options.h"
#include "report.h"

#include <ctype.h>
#include <errno.h>
#include <search.h>
#include <stdlib.h>
#include <string.h>

/* What the command line says. */
typedef struct job {
    const char *file, *output, *name;
    int gap; /* DEVICE_PLAN_OWN_GAP: that of the file */
    uint8_t is_page;
} job;

/* --- the command line --- */

enum { NAME = 0x2000, GAP, MARKDOWN };

static error_t parse(int key, char *text, struct argp_state *state)
{
    job *j = (job *)state->input;

    switch (key) {
    case 'o': j->output = text; return 0;
    case NAME: j->name = text; return 0;
    case GAP: j->gap = (int)options_number(state, "--gap", text, 0, 2000); return 0;
    case MARKDOWN: j->is_page = 1; return 0;
    case ARGP_KEY_ARG:
        if (state->arg_num > 0)
            options_too_many(state, text);
        j->file = text;
        return 0;
    case ARGP_KEY_END:
        if (!j->file)
            options_wrong(state, "FILE is missing");
        return 0;
    default: return ARGP_ERR_UNKNOWN;
    }
}

static const struct argp_option texts[] = {
    {"output", 'o', "FILE", 0, "Write to this file, not to standard output", 1},
    {"name", NAME, "NAME", 0, "The device's name in C (that of the device, or else of the file)",
     1},
    {"gap", GAP, "N", 0,
     "One request may read up to N addresses between two fields too, if the device has them (gap "
     "of FILE, or 0)",
     1},
    {"markdown", MARKDOWN, NULL, 0, "Write a page with a table of the fields, not a header", 1},
    {0}};

static const struct argp arguments = {
    .options = texts,
    .parser = parse,
    .args_doc = "FILE",
    .doc =
        "Writes a C header for firmware from a device file: constants, a table for a plan, and tables "
        "and functions for a server.\v"
        "docs/device-file.md describes the device file, docs/serve.md the header.\n\n"
        "  mbm header meter.yaml -o meter.h\n"};

/* --- names in C --- */

char *header_upper(const char *text)
{
    char *upper = names_identifier(text), *at;

    for (at = upper; at && *at; at++)
        *at = (char)toupper((unsigned char)*at);
    return upper;
}

/* The same name in lower case. NULL without memory. */
static char *to_lower(const char *upper)
{
    char *lower = strdup(upper), *at;

    for (at = lower; at && *at; at++)
        *at = (char)tolower((unsigned char)*at);
    return lower;
}

static int fail(void)
{
    (void)report(CODE_SYSTEM, REPORT_NO_MEMORY);
    return 0;
}

/* A name that the header defines, and the line of the file that it comes from; 0 for one that is of
 * no field. */
typedef struct c_name {
    char *text;
    int line;
} c_name;

static int compare(const void *one, const void *other)
{
    return strcmp(((const c_name *)one)->text, ((const c_name *)other)->text);
}

static void free_name(void *name)
{
    free(((c_name *)name)->text);
    free(name);
}

/* Stores a name. Returns 0 after reporting that it is there already. */
static int store(header *h, char *text, int line)
{
    c_name *name = (c_name *)malloc(sizeof *name), *other;
    void *place;

    if (!name) {
        free(text);
        return fail();
    }
    name->text = text;
    name->line = line;
    place = tsearch(name, &h->names, compare);
    other = place ? *(c_name **)place : NULL;
    if (other == name)
        return 1;
    if (!other)
        (void)fail();
    else if (other->line == 0)
        (void)report(CODE_WRONG, "%s:%d: the C name %s is one of the header itself: choose another",
                     h->path, line, text);
    else
        (void)report(
            CODE_WRONG,
            "%s:%d: the C name %s is that of line %d too: choose another. Case, spaces and "
            "signs make no difference",
            h->path, line > other->line ? line : other->line, text,
            line > other->line ? other->line : line);
    free_name(name);
    return 0;
}

/* Frees what the names took. */
static void free_names(header *h)
{
    uint16_t i;

    tdestroy(h->names, free_name);
    for (i = 0; h->fields && i < h->of->count; i++)
        free(h->fields[i]);
    for (i = 0; h->lowers && i < h->of->count; i++)
        free(h->lowers[i]);
    free(h->fields);
    free(h->lowers);
    free(h->upper);
    free(h->lower);
}

int header_define(header *h, uint16_t field, const char *suffix, int line)
{
    char *text;

    if (asprintf(&text, "%s_%s%s", h->upper, h->fields[field], suffix) < 0)
        return fail();
    return store(h, text, line);
}

/* Chooses the name of the device: the one that is given, else that of the file without its end. */
static int choose_device(header *h, const char *name)
{
    char *base = NULL, *end;

    if (!name && !h->of->name) {
        base = strdup(h->file);
        end = base ? strrchr(base, '.') : NULL;
        if (!base)
            return fail();
        if (end && end > base)
            *end = '\0';
    }
    name = name ? name : base ? base : h->of->name;
    h->upper = header_upper(name);
    h->lower = h->upper ? to_lower(h->upper) : NULL;
    if (!h->lower) {
        free(base);
        return fail();
    }
    if (!isalpha((unsigned char)h->upper[0]) || strcmp(h->upper, "MBM") == 0 ||
        strlen(h->upper) > HEADER_NAME_BYTES) {
        (void)report(CODE_WRONG,
                     "%s: \"%s\" cannot be the device's name in C, which begins with one of the "
                     "letters A to Z, has at most 255 bytes and is not MBM: give one with --name",
                     h->path, name);
        free(base);
        return 0;
    }
    free(base);
    return 1;
}

/* Stores a name that the header has for itself. Returns 0 without memory. */
static int reserve(header *h, const char *name)
{
    char *text;

    return asprintf(&text, "%s_%s", h->upper, name) < 0 ? fail() : store(h, text, 0);
}

/* Chooses the C names of the device and of its fields. `name` is that of the device, or NULL to
 * take that of the file. Returns 0 after reporting a refusal. */
static int choose_names(header *h, const char *name)
{
    static const char *const OWN[] = {"H",     "PLAN",       "SERVER", "FIELDS",
                                      "READS", "DATA_WORDS", "UNIT"};
    uint16_t i;

    h->fields = (char **)calloc(h->of->count, sizeof *h->fields);
    h->lowers = (char **)calloc(h->of->count, sizeof *h->lowers);
    if (!h->fields || !h->lowers)
        return fail();
    if (!choose_device(h, name))
        return 0;
    for (i = 0; i < sizeof OWN / sizeof OWN[0]; i++)
        if (!reserve(h, OWN[i]))
            return 0;
    for (i = 0; i < REACH_KEYS; i++)
        if (header_reach_name(h, i) && !reserve(h, header_reach_name(h, i)))
            return 0;
    for (i = 0; i < h->of->count; i++) {
        const device_field *field = &h->of->fields[i];

        h->fields[i] = header_upper(field->name);
        h->lowers[i] = h->fields[i] ? to_lower(h->fields[i]) : NULL;
        if (!h->lowers[i])
            return fail();
        if (!header_define(h, i, "", field->line))
            return 0;
    }
    return 1;
}

/* --- scales --- */

/* Divides both numbers by their greatest common divisor. */
static void reduce(uint64_t *one, uint64_t *other)
{
    uint64_t a = *one, b = *other;

    while (b != 0) {
        const uint64_t rest = a % b;

        a = b;
        b = rest;
    }
    *one /= a;
    *other /= a;
}

/* Finds the multiplier and the divisor that are exactly a scale. Returns 0 if they do not fit. */
static int find_scale(const device_field *field, header_scale *found)
{
    const value_scale *scale = &field->form.scale;
    uint64_t multiplier = scale->digits, divisor = 1;
    long exponent = scale->exponent;

    found->multiplier = found->divisor = 1;
    if (!header_is_scaled(field))
        return 1;
    for (; exponent > 0; exponent--) {
        if (multiplier > INT32_MAX)
            return 0;
        multiplier *= 10;
    }
    for (; exponent < 0; exponent++) {
        if (divisor > UINT64_MAX / 10)
            return 0;
        divisor *= 10;
    }
    reduce(&multiplier, &divisor);
    if (multiplier > INT32_MAX || divisor > INT32_MAX)
        return 0;
    found->multiplier = scale->is_negative ? -(int32_t)multiplier : (int32_t)multiplier;
    found->divisor = (int32_t)divisor;
    return 1;
}

/* Returns CODE_DONE, or another exit code after reporting the reason. */
static int find_scales(header *h)
{
    uint16_t i;

    h->scales = (header_scale *)calloc(h->of->count, sizeof *h->scales);
    if (!h->scales)
        return report(CODE_SYSTEM, REPORT_NO_MEMORY);
    for (i = 0; i < h->of->count; i++)
        if (!find_scale(&h->of->fields[i], &h->scales[i]))
            return report(
                CODE_WRONG,
                "%s:%d: scale is not a fraction of two whole numbers up to 2147483647, as "
                "a plan needs it",
                h->path, h->of->fields[i].scale_line);
    return CODE_DONE;
}

/* --- the plan --- */

/* Appends to `order` the fields that a read covers and no read before it had, sorted by address.
 * Returns the new number of fields there. */
static uint16_t take_fields(const header *h, const mbm_planReadInfo *read, uint16_t taken,
                            uint8_t *is_taken)
{
    uint16_t *order = h->order;
    const uint16_t first = taken;
    uint16_t i, place;

    for (i = 0; i < h->of->readable; i++) {
        if (is_taken[i] || !device_plan_covers(read, &h->of->planned[i]))
            continue;
        is_taken[i] = 1;
        for (place = taken++; place > first; place--) {
            if (h->of->planned[order[place - 1]].address <= h->of->planned[i].address)
                break;
            order[place] = order[place - 1];
        }
        order[place] = i;
    }
    return taken;
}

/* Notes the reads of a plan, with their fields. Returns 0 without memory. */
static int note_reads(header *h, const mbm_plan *plan)
{
    uint8_t *is_taken = (uint8_t *)calloc(h->of->readable, 1);
    mbm_planReadInfo read;
    uint16_t taken = 0;
    uint32_t words = 0;

    h->order = (uint16_t *)calloc(h->of->readable, sizeof *h->order);
    h->counts = (uint16_t *)calloc(h->of->readable, sizeof *h->counts);
    if (!is_taken || !h->order || !h->counts) {
        free(is_taken);
        return 0;
    }
    for (h->reads = 0; mbm_plan_getRead(plan, h->reads, &read) == MBM_OK; h->reads++) {
        const uint16_t before = taken;

        taken = take_fields(h, &read, taken, is_taken);
        h->counts[h->reads] = (uint16_t)(taken - before);
        words += device_is_of_bits(read.table) ? (read.quantity + 15u) / 16 : read.quantity;
    }
    h->words = (uint16_t)words;
    free(is_taken);
    return 1;
}

/* Begins a plan, as firmware does, and notes its reads. Returns CODE_DONE, or another exit code
 * after reporting the reason. */
static int begin_plan(header *h, const mbm_planSetup *setup)
{
    static mbm_plan plan;
    uint16_t wrong;
    const uint8_t status = device_plan_try(&plan, setup, &wrong);
    int is_noted;

    if (status != MBM_OK)
        return report(CODE_WRONG, "%s", device_plan_wrong(h->of, h->path, status, wrong));
    is_noted = note_reads(h, &plan);
    (void)mbm_plan_end(&plan);
    return is_noted ? CODE_DONE : report(CODE_SYSTEM, REPORT_NO_MEMORY);
}

/* Gives the fields of a plan their scales. Registers as they are have none. */
static void scale_fields(const header *h, mbm_planField *fields)
{
    uint16_t i;

    for (i = 0; i < h->of->readable; i++) {
        if (h->scales && header_is_scaled(&h->of->fields[i]) &&
            fields[i].type != MBM_TYPE_REGISTERS) {
            fields[i].multiplier = h->scales[i].multiplier;
            fields[i].divisor = h->scales[i].divisor;
        }
    }
}

/* Groups the fields that can be read. Returns CODE_DONE, or another exit code after reporting the
 * reason. */
static int group_fields(header *h)
{
    const uint16_t count = h->of->readable;
    mbm_planSetup setup = MBM_INIT;
    int code;

    if (count == 0)
        return CODE_DONE;
    if (device_plan_make(&setup, h->of, h->gap, 1)) {
        scale_fields(h, (mbm_planField *)(uintptr_t)setup.fields);
        code = begin_plan(h, &setup);
    } else {
        code = report(CODE_SYSTEM, REPORT_NO_MEMORY);
    }
    device_plan_free(&setup);
    return code;
}

/* --- the header --- */

static uint16_t find_unit(const header *h)
{
    uint16_t i;

    for (i = 1; i < h->of->count; i++)
        if (h->of->planned[i].unit != h->of->planned[0].unit)
            return 0;
    return h->of->planned[0].unit;
}

/* Writes the header or the page. Returns 0 after reporting a refusal. */
static int write_header(job *j, header *h)
{
    if (j->is_page) {
        header_write_page(h);
        return 1;
    }
    fprintf(h->out, "/* ");
    header_comment(h->out, h->of->name ? h->of->name : h->upper);
    fprintf(h->out, ", written by mbm header from ");
    header_comment(h->out, h->file);
    fprintf(h->out, ": do not edit.\n *\n");
    if (h->of->readable > 0)
        fprintf(h->out, " * Define %s_PLAN before you include it for the table of a plan.\n",
                h->upper);
    else if (header_has_reach(h))
        fprintf(h->out, " * Define %s_PLAN before you include it for the functions of a client.\n",
                h->upper);
    fprintf(
        h->out,
        " * Define %s_SERVER for the tables of a server, and functions that get and set fields. */\n"
        "#ifndef %s_H\n#define %s_H\n\n#include <stddef.h>\n#include <stdint.h>\n",
        h->upper, h->upper, h->upper);
    if (!header_write_fields(h) || !header_write_plan(h))
        return 0;
    header_write_reach(h);
    header_write_checks(h);
    if (!header_write_types(h) || !header_write_server(h))
        return 0;
    fprintf(h->out, "\n#endif\n");
    return 1;
}

/* Makes the text in memory first, so that a file that is refused leaves nothing. */
static int make(job *j, header *h)
{
    size_t length = 0;
    char *text = NULL;
    int code;

    h->out = open_memstream(&text, &length);
    if (!h->out)
        return report(CODE_SYSTEM, "%s", strerror(errno));
    code = write_header(j, h) ? CODE_DONE : report_code;
    if (fclose(h->out) != 0 && code == CODE_DONE)
        code = report(CODE_SYSTEM, "%s", strerror(errno));
    if (code == CODE_DONE)
        code = report_write_file(j->output, text, length);
    free(text);
    return code;
}

int header_command(int argc, char **argv)
{
    job data = {.gap = DEVICE_PLAN_OWN_GAP}, *j = &data;
    device meter;
    header h = {.of = &meter};
    char wrong[YAML_FILE_WRONG_BYTES];
    int code;

    argp_parse(&arguments, argc, argv, 0, NULL, j);
    code = device_file_read(&meter, j->file, wrong);
    if (code != CODE_DONE)
        return report(code, "%s", wrong);
    h.path = j->file;
    h.file = strrchr(j->file, '/') ? strrchr(j->file, '/') + 1 : j->file;
    h.gap = j->gap;
    h.unit = find_unit(&h);
    code = choose_names(&h, j->name) ? find_scales(&h) : report_code;
    if (code == CODE_DONE)
        code = group_fields(&h);
    if (code == CODE_DONE)
        code = make(j, &h);
    free_names(&h);
    free(h.scales);
    free(h.order);
    free(h.counts);
    device_free(&meter);
    return code;
}
