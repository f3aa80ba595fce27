/* The page of documentation of a device, in Markdown. Licence: MIT OR Apache-2.0. */
#define _GNU_SOURCE
#include "header.h"

#include <inttypes.h>
#include <string.h>

static const char *const ACCESSES[] = {"", "read", "write", "read, write"};

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

static void write_row(const header *h, uint16_t at)
{
    const mbm_planField *planned = &h->of->planned[at];
    const device_field *field = &h->of->fields[at];
    const header_scale *scale = &h->scales[at];

    fprintf(h->out, "| ");
    write_text(h->out, field->name);
    fprintf(h->out, " | ");
    if (h->unit == 0)
        fprintf(h->out, "%u | ", planned->unit);
    header_place(h->out, planned);
    fprintf(h->out, " | %s", value_type_names[planned->type]);
    if (planned->type == MBM_TYPE_TEXT)
        fprintf(h->out, ", %u characters", planned->count);
    else if (planned->count > 1 && !device_is_part(planned))
        fprintf(h->out, ", %u values", planned->count);
    if (planned->order != MBM_ORDER_ABCD && planned->type != MBM_TYPE_BIT)
        fprintf(h->out, ", %s", value_order_names[planned->order]);
    fprintf(h->out, " | ");
    if (field->form.scale.digits && scale->divisor != 1)
        fprintf(h->out, "%" PRId32 "/%" PRId32, scale->multiplier, scale->divisor);
    else if (field->form.scale.digits)
        fprintf(h->out, "%" PRId32, scale->multiplier);
    fprintf(h->out, " | ");
    if (field->unit_of_measurement)
        write_text(h->out, field->unit_of_measurement);
    fprintf(h->out, " | %s | ", ACCESSES[field->access]);
    write_meaning(h, at);
    fprintf(h->out, " |\n");
}

void header_write_page(header *h)
{
    uint16_t i;

    fprintf(h->out, "# ");
    write_text(h->out, h->of->name ? h->of->name : h->upper);
    fprintf(h->out, "\n\nWritten by `mbm header` from ");
    write_text(h->out, h->file);
    fprintf(h->out, ". ");
    if (h->unit != 0)
        fprintf(h->out, "The unit id is %u. ", h->unit);
    fprintf(
        h->out,
        "Addresses are those of the protocol and count from 0.\n\n| field | %splace | type | scale | in | access | meaning |\n"
        "|---|%s---|---|---|---|---|---|\n",
        h->unit == 0 ? "unit | " : "", h->unit == 0 ? "---|" : "");
    for (i = 0; i < h->of->count; i++)
        write_row(h, i);
}
