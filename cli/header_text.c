/* The parts of a device's header that every program may include, which are the constants of its
 * fields and the table of its plan; and the page of documentation, in Markdown. */
#include "header.h"

#include "report.h"

#include <inttypes.h>
#include <stdlib.h>
#include <string.h>

static const char *const ACCESSES[] = {"", "read", "write", "read and write"};

/* --- what the parts share --- */

void header_comment(FILE *out, const char *text)
{
    for (; *text; text++) {
        const unsigned char *at = (const unsigned char *)text;

        /* U+202A to U+202E and U+2066 to U+2069. */
        if (at[0] == 0xE2 && ((at[1] == 0x80 && at[2] >= 0xAA && at[2] <= 0xAE) ||
                              (at[1] == 0x81 && at[2] >= 0xA6 && at[2] <= 0xA9))) {
            fputc('?', out);
            text += 2;
            continue;
        }
        fputc(*text, out);
        if ((text[0] == '*' && text[1] == '/') || (text[0] == '/' && text[1] == '*') ||
            (text[0] == '?' && text[1] == '?'))
            fputc(' ', out);
    }
}

void header_place(const header *h, const mbm_planField *planned)
{
    FILE *const out = h->out;
    static const char *const ONE[] = {"", "coil", "discrete input", "holding register",
                                      "input register"};
    const uint32_t size = device_size(planned);

    if (device_is_part(planned) || device_is_wide_part(planned)) {
        fprintf(out, planned->count > 1 ? "bits %u" : "bit %u", planned->bit);
        if (planned->count > 1)
            fprintf(out, " to %u", planned->bit + planned->count - 1u);
        fprintf(out, " of ");
    }
    fprintf(out, "%s%s %s", ONE[planned->table], size > 1 ? "s" : "",
            device_address_text(h->of, planned->table, planned->address));
    if (size > 1)
        fprintf(out, " to %s",
                device_address_text(h->of, planned->table, planned->address + size - 1));
}

void header_begin_shared(const header *h, const char *title)
{
    fprintf(h->out,
            "\n/* ==== %s ==== */\n\n"
            "#if defined(%s_PLAN) || defined(%s_SERVER)\n#include \"mbm.h\"\n",
            title, h->upper, h->upper);
}

const char *header_type(const mbm_planField *planned)
{
    static const char *const TYPES[] = {"",         "uint8_t", "uint16_t", "int16_t",
                                        "uint32_t", "int32_t", "uint64_t", "int64_t",
                                        "float",    "double",  "char"};

    return device_is_part(planned) && planned->count > 8 ? "uint16_t" : TYPES[planned->type];
}

/* --- fields --- */

void header_write_constant(FILE *out, const char *number)
{
    const int is_negative = number[0] == '-';
    const uint64_t amount = strtoull(number + is_negative, NULL, 10);

    if (is_negative && amount == (uint64_t)INT64_MAX + 1)
        fprintf(out, "(-9223372036854775807ll - 1)");
    else if (is_negative && amount == (uint64_t)INT32_MAX + 1)
        fprintf(out, "(-2147483647l - 1)");
    else if (is_negative)
        fprintf(out, "(-%" PRIu64 "%s)", amount,
                amount <= 32767       ? ""
                : amount <= INT32_MAX ? "l"
                                      : "ll");
    else
        fprintf(out, "%" PRIu64 "%s", amount,
                amount <= 65535        ? "u"
                : amount <= UINT32_MAX ? "ul"
                                       : "ull");
}

/* Whether an enumerator, which is an int of 16 bits or more, can have all numbers. */
static int has_small_numbers(const device_field *field)
{
    uint16_t i;

    for (i = 0; i < field->label_count; i++) {
        const char *number = field->labels[i].number;

        /* strtoll makes INT64_MAX of numbers of uint64 that are too large. */
        if (strtoll(number, NULL, 10) > 32767 || strtoll(number, NULL, 10) < -32767)
            return 0;
    }
    return 1;
}

/* Writes the enumeration of a field. */
static int write_labels(header *h, uint16_t at)
{
    const device_field *field = &h->of->fields[at];
    const int is_small = has_small_numbers(field);
    uint16_t i;

    if (field->label_count == 0)
        return 1;
    if (is_small)
        fprintf(h->out, "enum {\n");
    for (i = 0; i < field->label_count; i++) {
        const device_label *label = &field->labels[i];
        char *name = header_upper(label->name), *suffix = NULL;
        int is_new;

        if (!name || asprintf(&suffix, "_%s", name) < 0) {
            free(name);
            (void)report(CODE_SYSTEM, REPORT_NO_MEMORY);
            return 0;
        }
        if (name[0] == '\0') {
            (void)report(CODE_WRONG,
                         "%s:%d: enumeration: the name \"%s\" has none of the letters A to Z and "
                         "digits, of which names in C are made",
                         h->path, label->line, label->name);
            is_new = 0;
        } else {
            is_new = header_define(h, at, suffix, label->line);
        }
        if (is_new) {
            fprintf(h->out, is_small ? "    %s_%s%s = " : "#define %s_%s%s ", h->upper,
                    h->fields[at], suffix);
            if (is_small)
                fprintf(h->out, "%s%s", label->number, i + 1 < field->label_count ? "," : "");
            else
                header_write_constant(h->out, label->number);
            fprintf(h->out, " /* ");
            header_comment(h->out, label->name);
            fprintf(h->out, " */\n");
        }
        free(name);
        free(suffix);
        if (!is_new)
            return 0;
    }
    if (is_small)
        fprintf(h->out, "};\n");
    return 1;
}

/* Writes one constant of a field. */
static int write_macro(header *h, uint16_t at, const char *suffix, uint32_t value)
{
    fprintf(h->out, "#define %s_%s%s %" PRIu32 "u\n", h->upper, h->fields[at], suffix, value);
    return header_define(h, at, suffix, h->of->fields[at].line);
}

static void write_what_it_is(header *h, uint16_t at)
{
    const mbm_planField *planned = &h->of->planned[at];
    const device_field *field = &h->of->fields[at];
    const header_scale *scale = &h->scales[at];

    fprintf(h->out, "\n/* ");
    header_comment(h->out, field->name);
    fprintf(h->out, ": ");
    header_place(h, planned);
    if (h->unit == 0)
        fprintf(h->out, " of unit %u", planned->unit);
    if (planned->type != MBM_TYPE_BIT)
        fprintf(h->out, ", %s", value_type_name(planned->type));
    if (field->layout)
        fprintf(h->out, " \"%s\"", field->layout);
    if (field->form.zone != 0)
        fprintf(h->out, ", at %c%02d:%02d", field->form.zone < 0 ? '-' : '+',
                abs(field->form.zone) / 60, abs(field->form.zone) % 60);
    if (value_is_text(planned->type))
        fprintf(h->out, " of %u characters", planned->count);
    else if (device_values_in(planned) > 1)
        fprintf(h->out, ", %u values", planned->count);
    if (planned->order != MBM_ORDER_ABCD && planned->type != MBM_TYPE_BIT)
        fprintf(h->out, ", order %s", value_order_names[planned->order]);
    fprintf(h->out, "; %s.", ACCESSES[field->access]);
    if (header_is_scaled(field) || field->unit_of_measurement) {
        fprintf(h->out, "\n * In ");
        if (header_is_scaled(field))
            fprintf(h->out, "%" PRId32, scale->multiplier);
        if (scale->divisor != 1)
            fprintf(h->out, "/%" PRId32, scale->divisor);
        if (header_is_scaled(field) && field->unit_of_measurement)
            fputc(' ', h->out);
        if (field->unit_of_measurement)
            header_comment(h->out, field->unit_of_measurement);
        fputc('.', h->out);
    }
    header_write_meaning(h->out, field, "\n * Then ", ".");
    if (conversion_has_limits(field->conversion)) {
        fprintf(h->out, "\n * What is written is ");
        header_write_limits(h->out, field);
        fputc('.', h->out);
    }
    if (field->description) {
        fprintf(h->out, "\n * ");
        header_comment(h->out, field->description);
    }
    fprintf(h->out, " */\n");
}

static int write_field(header *h, uint16_t at)
{
    const mbm_planField *planned = &h->of->planned[at];
    const device_field *field = &h->of->fields[at];
    const header_scale *scale = &h->scales[at];
    const int is_part = device_is_part(planned) || device_is_wide_part(planned);

    write_what_it_is(h, at);
    if ((h->unit == 0 && !write_macro(h, at, "_UNIT", planned->unit)) ||
        !write_macro(h, at, "_ADDRESS", planned->address) ||
        !write_macro(h, at, "_SIZE", device_size(planned)) ||
        (planned->count > 1 && !is_part && !write_macro(h, at, "_COUNT", planned->count)) ||
        (is_part && (!write_macro(h, at, "_BIT", planned->bit) ||
                     !write_macro(h, at, "_BITS", planned->count))))
        return 0;
    if (header_is_scaled(field)) {
        fprintf(h->out, "#define %s_%s_MULTIPLIER ", h->upper, h->fields[at]);
        fprintf(h->out, scale->multiplier < 0 ? "(%" PRId32 ")\n" : "%" PRId32 "\n",
                scale->multiplier);
        fprintf(h->out, "#define %s_%s_DIVISOR %" PRId32 "\n", h->upper, h->fields[at],
                scale->divisor);
        if (!header_define(h, at, "_MULTIPLIER", field->line) ||
            !header_define(h, at, "_DIVISOR", field->line))
            return 0;
    }
    if (field->conversion && field->conversion->has_precision &&
        !write_macro(h, at, "_PRECISION", field->conversion->precision))
        return 0;
    return header_write_limit_constants(h, at) && write_labels(h, at);
}

int header_write_fields(header *h)
{
    uint16_t i;

    fprintf(h->out,
            "\n/* ==== Fields: addresses as on the wire, sizes in registers or bits ==== */\n");
    if (h->of->notation != DEVICE_ON_WIRE)
        fprintf(h->out, "/* In comments they are as in the file, from 1 on. */\n");
    if (h->unit != 0)
        fprintf(h->out, "\n#define %s_UNIT %uu\n", h->upper, h->unit);
    for (i = 0; i < h->of->count; i++)
        if (!write_field(h, i))
            return 0;
    return 1;
}

/* --- the plan --- */

static void write_row(header *h, uint16_t at, int is_last)
{
    static const char *const TABLES[] = {"", "COILS", "DISCRETE_INPUTS", "HOLDING_REGISTERS",
                                         "INPUT_REGISTERS"};
    static const char *const TYPES[] = {"",       "BIT",    "UINT16", "INT16",
                                        "UINT32", "INT32",  "UINT64", "INT64",
                                        "FLOAT",  "DOUBLE", "TEXT",   "REGISTERS"};
    const mbm_planField own = device_read_as(&h->of->planned[at]), *planned = &own;
    const header_scale *scale = &h->scales[at];
    const int is_scaled =
        header_is_scaled(&h->of->fields[at]) && planned->type != MBM_TYPE_REGISTERS;

    fprintf(h->out, "    /* %s_%s */\n", h->upper, h->fields[at]);
    fprintf(h->out,
            "    {%uu, MBM_TABLE_%s, MBM_TYPE_%s, MBM_ORDER_%s, %uu, %uu, %uu, %" PRIu32
            "u, %" PRId32 ", %" PRId32 "}%s\n",
            planned->unit, TABLES[planned->table], TYPES[planned->type],
            value_order_names[planned->order], planned->bit, planned->address, planned->count,
            planned->intervalMs, is_scaled ? scale->multiplier : 0, is_scaled ? scale->divisor : 0,
            is_last ? "" : ",");
}

int header_write_plan(header *h)
{
    const uint16_t count = h->of->readable;
    uint16_t i;

    if (count == 0)
        return 1;
    fprintf(h->out,
            "\n/* ==== The plan: the fields that can be read, grouped into requests ==== */\n\n"
            "#ifdef %s_PLAN\n#include \"mbm.h\"\n\n"
            "/* The fields of the plan, for mbm_plan_getInt32 and the like. */\n"
            "enum %s_field {\n",
            h->upper, h->lower);
    for (i = 0; i < count; i++)
        fprintf(h->out, "    %s_%s%s\n", h->upper, h->fields[h->order[i]],
                i + 1 < count ? "," : "");
    fprintf(h->out,
            "};\n\n"
            "/* What the plan needs: mbm_planPosition, mbm_planRead, words of data. */\n"
            "#define %s_FIELDS %uu\n#define %s_READS %uu\n#define %s_DATA_WORDS %uu\n\n"
            "/* The members of mbm_planField in their order. */\n"
            "static const mbm_planField %s_fields[%s_FIELDS] = {\n",
            h->upper, count, h->upper, h->reads, h->upper, h->words, h->lower, h->upper);
    for (i = 0; i < count; i++)
        write_row(h, h->order[i], i + 1 == count);
    fprintf(h->out,
            "};\n\n"
            "/* How many of them each request reads, for mbm_plan_beginGrouped. */\n"
            "static const uint16_t %s_counts[%s_READS] = {",
            h->lower, h->upper);
    for (i = 0; i < h->reads; i++)
        fprintf(h->out, "%s%uu", i == 0 ? "" : i % 16 == 0 ? ",\n    " : ", ", h->counts[i]);
    fprintf(h->out, "};\n");
    if (!header_write_conversions(h))
        return 0;
    fprintf(h->out, "#endif\n");
    return 1;
}

/* --- the page --- */

static const char *const PAGE_ACCESSES[] = {"", "read", "write", "read, write"};

/* Writes a text of a table. */
static void write_text(FILE *out, const char *text)
{
    for (; *text; text++) {
        if (*text == '<')
            fputs("&lt;", out);
        else if (*text == '&')
            fputs("&amp;", out);
        else {
            if (strchr("\\|`*_[]", *text))
                fputc('\\', out);
            fputc(*text, out);
        }
    }
}

static void write_meaning(const header *h, uint16_t at)
{
    const device_field *field = &h->of->fields[at];
    uint16_t i;

    if (field->description)
        write_text(h->out, field->description);
    for (i = 0; i < field->label_count; i++) {
        fprintf(h->out, "%s%s ",
                i > 0                ? ", "
                : field->description ? ": "
                                     : "",
                field->labels[i].number);
        write_text(h->out, field->labels[i].name);
    }
}

static void write_page_row(const header *h, uint16_t at)
{
    const mbm_planField *planned = &h->of->planned[at];
    const device_field *field = &h->of->fields[at];
    const header_scale *scale = &h->scales[at];

    fprintf(h->out, "| ");
    write_text(h->out, field->name);
    fprintf(h->out, " | ");
    if (h->unit == 0)
        fprintf(h->out, "%u | ", planned->unit);
    header_place(h, planned);
    fprintf(h->out, " | %s", value_type_name(planned->type));
    if (value_is_text(planned->type))
        fprintf(h->out, ", %u characters", planned->count);
    else if (device_values_in(planned) > 1)
        fprintf(h->out, ", %u values", planned->count);
    if (planned->order != MBM_ORDER_ABCD && planned->type != MBM_TYPE_BIT)
        fprintf(h->out, ", %s", value_order_names[planned->order]);
    fprintf(h->out, " | ");
    if (header_is_scaled(field) && scale->divisor != 1)
        fprintf(h->out, "%" PRId32 "/%" PRId32, scale->multiplier, scale->divisor);
    else if (header_is_scaled(field))
        fprintf(h->out, "%" PRId32, scale->multiplier);
    header_write_meaning(h->out, field, header_is_scaled(field) ? ", " : "", "");
    fprintf(h->out, " | ");
    if (field->unit_of_measurement)
        write_text(h->out, field->unit_of_measurement);
    fprintf(h->out, " | %s", PAGE_ACCESSES[field->access]);
    if (conversion_has_limits(field->conversion)) {
        fputs(": ", h->out);
        header_write_limits(h->out, field);
    }
    fputs(" | ", h->out);
    write_meaning(h, at);
    fprintf(h->out, " |\n");
}

void header_write_page(header *h)
{
    static const char *const ADDRESSES[] = {
        "Addresses are those of the protocol and count from 0.",
        "Addresses count from 1: those of the protocol are one less.",
        "Addresses are in Modicon's notation: 40001 is holding register 0 of the protocol."};
    uint16_t i;

    fprintf(h->out, "# ");
    write_text(h->out, h->of->name ? h->of->name : h->upper);
    fprintf(h->out, "\n\nWritten by `mbm header` from ");
    write_text(h->out, h->file);
    fprintf(h->out, ". ");
    if (h->unit != 0)
        fprintf(h->out, "The unit id is %u. ", h->unit);
    fprintf(h->out,
            "%s\n\n| field | %splace | type | scale | in | access | meaning |\n"
            "|---|%s---|---|---|---|---|---|\n",
            ADDRESSES[h->of->notation], h->unit == 0 ? "unit | " : "", h->unit == 0 ? "---|" : "");
    for (i = 0; i < h->of->count; i++)
        write_page_row(h, i);
}
