/* mbm header: writes the C header of a device for firmware, or a page about it.
 *
 * Licence: MIT OR Apache-2.0. */
#define _GNU_SOURCE
#include "header.h"

#include "commands.h"
#include "device_file.h"
#include "options.h"
#include "report.h"
#include "trial.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>

static struct {
    const char *file, *output, *name;
    uint16_t gap;
    uint8_t is_page;
} wanted;

static device meter;

/* --- the command line --- */

enum { NAME = 0x2000, GAP, MARKDOWN };

static error_t parse(int key, char *text, struct argp_state *state)
{
    switch (key) {
    case 'o': wanted.output = text; return 0;
    case NAME: wanted.name = text; return 0;
    case GAP: wanted.gap = (uint16_t)options_number(state, "--gap", text, 0, 2000); return 0;
    case MARKDOWN: wanted.is_page = 1; return 0;
    case ARGP_KEY_ARG:
        if (state->arg_num > 0)
            options_too_many(state, text);
        wanted.file = text;
        return 0;
    case ARGP_KEY_END:
        if (!wanted.file)
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
     "One request may read up to N addresses between two fields too, if the device has them (0)",
     1},
    {"markdown", MARKDOWN, NULL, 0, "Write a page with a table of the fields, not a header", 1},
    {NULL, 0, NULL, 0, NULL, 0}};

static const struct argp arguments = {
    texts,
    parse,
    "FILE",
    "Writes a C header for firmware from a device file: constants, a table for a plan, and tables "
    "and functions for a server.\v"
    "docs/serve.md describes the device file and the header.\n\n"
    "  mbm header meter.yaml -o meter.h\n",
    NULL,
    NULL,
    NULL};

/* --- scales --- */

/* Divides both numbers by what divides both. */
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
static int find_scale(const value_scale *scale, header_scale *found)
{
    uint64_t multiplier = scale->digits, divisor = 1;
    long exponent = scale->exponent;

    found->multiplier = found->divisor = 1;
    if (multiplier == 0)
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

    h->scales = (header_scale *)calloc(meter.count, sizeof *h->scales);
    if (!h->scales)
        return report(CODE_SYSTEM, "there is no memory");
    for (i = 0; i < meter.count; i++)
        if (!find_scale(&meter.fields[i].form.scale, &h->scales[i]))
            return report(
                CODE_WRONG,
                "%s:%d: scale is not a fraction of two whole numbers up to 2147483647, as "
                "a plan needs it",
                h->path, meter.fields[i].scale_line);
    return CODE_DONE;
}

/* --- the plan --- */

/* Whether a read covers a field, and nothing of it is elsewhere. */
static int covers(const mbm_planReadInfo *read, const mbm_planField *field)
{
    return read->unit == field->unit && read->table == field->table &&
           read->intervalMs == field->intervalMs && read->address <= field->address &&
           (uint32_t)read->address + read->quantity >= field->address + device_size(field);
}

/* Puts the fields that a read covers, of those that no read had before, behind the others of
 * `order`, sorted by address. Returns the new number of fields there. */
static uint16_t take_fields(const mbm_planReadInfo *read, uint16_t *order, uint16_t taken,
                            uint8_t *is_taken)
{
    const uint16_t first = taken;
    uint16_t i, place;

    for (i = 0; i < meter.readable; i++) {
        if (is_taken[i] || !covers(read, &meter.planned[i]))
            continue;
        is_taken[i] = 1;
        for (place = taken++; place > first; place--) {
            if (meter.planned[order[place - 1]].address <= meter.planned[i].address)
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
    uint8_t *is_taken = (uint8_t *)calloc(meter.readable, 1);
    mbm_planReadInfo read;
    uint16_t taken = 0;
    uint32_t words = 0;

    h->order = (uint16_t *)calloc(meter.readable, sizeof *h->order);
    h->counts = (uint16_t *)calloc(meter.readable, sizeof *h->counts);
    if (!is_taken || !h->order || !h->counts) {
        free(is_taken);
        return 0;
    }
    for (h->reads = 0; mbm_plan_getRead(plan, h->reads, &read) == MBM_OK; h->reads++) {
        const uint16_t before = taken;

        taken = take_fields(&read, h->order, taken, is_taken);
        h->counts[h->reads] = (uint16_t)(taken - before);
        words +=
            read.table <= MBM_TABLE_DISCRETE_INPUTS ? (read.quantity + 15u) / 16 : read.quantity;
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
    const uint8_t status = trial_begin(&plan, setup, &wrong);
    int is_noted;

    if (status == MBM_BUFFER_TOO_SMALL && wrong < meter.readable)
        return report(CODE_WRONG, "%s:%d: the fields up to here take more than 65535 words of data",
                      h->path, meter.fields[wrong].line);
    if (status != MBM_OK && wrong < meter.readable)
        return report(CODE_WRONG, "%s:%d: %s", h->path, meter.fields[wrong].line,
                      mbm_status_text(status));
    if (status != MBM_OK)
        return report(CODE_WRONG, "%s: %s", h->path, mbm_status_text(status));
    is_noted = note_reads(h, &plan);
    (void)mbm_plan_end(&plan);
    return is_noted ? CODE_DONE : report(CODE_SYSTEM, "there is no memory");
}

/* Copies the fields that can be read, with their scales. */
static void scale_fields(const header *h, mbm_planField *fields)
{
    uint16_t i;

    for (i = 0; i < meter.readable; i++) {
        fields[i] = meter.planned[i];
        if (meter.fields[i].form.scale.digits) {
            fields[i].multiplier = h->scales[i].multiplier;
            fields[i].divisor = h->scales[i].divisor;
        }
    }
}

/* Groups the fields that can be read. Returns CODE_DONE, or another exit code after reporting the
 * reason. */
static int group_fields(header *h)
{
    static mbm_clientRequest request;
    const uint16_t count = meter.readable;
    mbm_planField *fields;
    mbm_planSetup setup = {.fieldCount = count,
                           .readCount = count,
                           .dataWords = UINT16_MAX,
                           .bitGap = h->gap,
                           .registerGap =
                               h->gap < MBM_MAX_READ_REGISTERS ? h->gap : MBM_MAX_READ_REGISTERS,
                           .requests = &request,
                           .requestCount = 1};
    int code;

    if (count == 0)
        return CODE_DONE;
    setup.fields = fields = (mbm_planField *)calloc(count, sizeof *fields);
    setup.positions = (mbm_planPosition *)calloc(count, sizeof *setup.positions);
    setup.reads = (mbm_planRead *)calloc(count, sizeof *setup.reads);
    setup.data = (uint16_t *)calloc(setup.dataWords, sizeof *setup.data);
    if (fields && setup.positions && setup.reads && setup.data) {
        scale_fields(h, fields);
        code = begin_plan(h, &setup);
    } else {
        code = report(CODE_SYSTEM, "there is no memory for %u fields", count);
    }
    free(fields);
    free(setup.positions);
    free(setup.reads);
    free(setup.data);
    return code;
}

/* --- the header --- */

static uint16_t find_unit(void)
{
    uint16_t i;

    for (i = 1; i < meter.count; i++)
        if (meter.planned[i].unit != meter.planned[0].unit)
            return 0;
    return meter.planned[0].unit;
}

/* Writes the header or the page. Returns 0 after reporting a refusal. */
static int write_header(header *h)
{
    if (wanted.is_page) {
        header_write_page(h);
        return 1;
    }
    fprintf(h->out, "/* ");
    header_comment(h->out, meter.name ? meter.name : h->upper);
    fprintf(h->out, ", written by mbm header from ");
    header_comment(h->out, h->file);
    fprintf(h->out, ": do not edit.\n *\n");
    if (meter.readable > 0)
        fprintf(h->out, " * Define %s_PLAN before you include it for the table of a plan.\n",
                h->upper);
    fprintf(
        h->out,
        " * Define %s_SERVER for the tables of a server, and functions that get and set fields. */\n"
        "#ifndef %s_H\n#define %s_H\n\n#include <stddef.h>\n#include <stdint.h>\n",
        h->upper, h->upper, h->upper);
    if (!header_write_fields(h) || !header_write_plan(h) || !header_write_server(h))
        return 0;
    fprintf(h->out, "\n#endif\n");
    return 1;
}

/* Writes the text to where it is wanted. Returns the exit code. */
static int keep(const char *text, size_t length)
{
    FILE *file = wanted.output ? fopen(wanted.output, "wb") : stdout;
    int is_right;

    if (!file)
        return report(CODE_SYSTEM, "%s: %s", wanted.output, strerror(errno));
    is_right = fwrite(text, 1, length, file) == length;
    if (!wanted.output) {
        report_flush(); /* notes whether standard output took it */
        return CODE_DONE;
    }
    if (fclose(file) != 0 || !is_right)
        return report(CODE_SYSTEM, "%s: %s", wanted.output, strerror(errno));
    return CODE_DONE;
}

/* Makes the text in memory first, so that a file that is refused leaves nothing. */
static int make(header *h)
{
    size_t length = 0;
    char *text = NULL;
    int code;

    h->out = open_memstream(&text, &length);
    if (!h->out)
        return report(CODE_SYSTEM, "%s", strerror(errno));
    code = write_header(h) ? CODE_DONE : report_code;
    if (fclose(h->out) != 0 && code == CODE_DONE)
        code = report(CODE_SYSTEM, "%s", strerror(errno));
    if (code == CODE_DONE)
        code = keep(text, length);
    free(text);
    return code;
}

int header_command(int argc, char **argv)
{
    header h = {.of = &meter};
    char wrong[YAML_FILE_WRONG_BYTES];
    int code;

    argp_parse(&arguments, argc, argv, 0, NULL, NULL);
    code = device_file_read(&meter, wanted.file, wrong);
    if (code != CODE_DONE)
        return report(code, "%s", wrong);
    h.path = wanted.file;
    h.file = strrchr(wanted.file, '/') ? strrchr(wanted.file, '/') + 1 : wanted.file;
    h.gap = wanted.gap;
    h.unit = find_unit();
    code = header_choose_names(&h, wanted.name) ? find_scales(&h) : report_code;
    if (code == CODE_DONE)
        code = group_fields(&h);
    if (code == CODE_DONE)
        code = make(&h);
    header_free_names(&h);
    free(h.scales);
    free(h.order);
    free(h.counts);
    device_free(&meter);
    return code;
}
