/* Gives each field of a device file its topic and its identifier.
 *
 * Licence: MIT OR Apache-2.0. */
#include "device_names.h"

#include "names.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>

static int make_one(yaml_file *file, device_field *field)
{
    if (names_levels(field->name) > NAMES_LEVELS)
        return yaml_file_refuse_line(file, field->line,
                                     "the name %s has more than %d levels with / between them",
                                     field->name, NAMES_LEVELS);
    field->topic = names_topic(field->name);
    field->identifier = names_identifier(field->name);
    if (!field->topic || !field->identifier)
        return yaml_file_fail(file, ENOMEM);
    if (*field->identifier == '\0')
        return yaml_file_refuse_line(file, field->line,
                                     "the name %s has no letter and no digit, of which identifiers "
                                     "are made",
                                     field->name);
    return 1;
}

/* A field and what its name becomes: its topic or its identifier. */
typedef struct named {
    const device_field *field;
    const char *text;
} named;

/* Orders fields by what their names become, then by line. */
static int compare(const void *one, const void *other)
{
    const named *a = (const named *)one, *b = (const named *)other;
    const int order = strcmp(a->text, b->text);

    return order != 0 ? order
                      : (a->field->line > b->field->line) - (a->field->line < b->field->line);
}

/* Sorts what names become, and refuses two that are the same. */
static int check(yaml_file *file, named *all, uint16_t count, const char *what)
{
    uint16_t i;

    qsort(all, count, sizeof *all, compare);
    for (i = 1; i < count; i++)
        if (strcmp(all[i - 1].text, all[i].text) == 0)
            return yaml_file_refuse_line(
                file, all[i].field->line,
                "the name %s and that of line %d, %s, become the same %s, %s: choose another",
                all[i].field->name, all[i - 1].field->line, all[i - 1].field->name, what,
                all[i].text);
    return 1;
}

int device_names_make(yaml_file *file, device *of)
{
    named *all;
    uint16_t i;
    int is_right;

    for (i = 0; i < of->count; i++)
        if (!make_one(file, &of->fields[i]))
            return 0;
    all = (named *)calloc(of->count + 1u, sizeof *all);
    if (!all)
        return yaml_file_fail(file, ENOMEM);
    for (i = 0; i < of->count; i++)
        all[i] = (named){&of->fields[i], of->fields[i].topic};
    is_right = check(file, all, of->count, "topic");
    for (i = 0; i < of->count; i++)
        all[i] = (named){&of->fields[i], of->fields[i].identifier};
    is_right = is_right && check(file, all, of->count, "identifier");
    free(all);
    return is_right;
}
