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

/* A field in an order of their names. */
typedef struct named {
    const device_field *field;
} named;

/* Orders fields by topic or identifier, then by line. */
static int compare_lines(const device_field *one, const device_field *other)
{
    return (one->line > other->line) - (one->line < other->line);
}

static int compare_topics(const void *one, const void *other)
{
    const device_field *a = ((const named *)one)->field;
    const device_field *b = ((const named *)other)->field;
    const int order = strcmp(a->topic, b->topic);

    return order != 0 ? order : compare_lines(a, b);
}

static int compare_identifiers(const void *one, const void *other)
{
    const device_field *a = ((const named *)one)->field;
    const device_field *b = ((const named *)other)->field;
    const int order = strcmp(a->identifier, b->identifier);

    return order != 0 ? order : compare_lines(a, b);
}

static int refuse_same(yaml_file *file, const device_field *first, const device_field *second,
                       const char *text, const char *what)
{
    return yaml_file_refuse_line(file, second->line,
                                 "the name %s and that of line %d, %s, become the same %s, %s: "
                                 "choose another",
                                 second->name, first->line, first->name, what, text);
}

static int check_all(yaml_file *file, named *sorted, uint16_t count)
{
    uint16_t i;

    qsort(sorted, count, sizeof *sorted, compare_topics);
    for (i = 1; i < count; i++)
        if (strcmp(sorted[i - 1].field->topic, sorted[i].field->topic) == 0)
            return refuse_same(file, sorted[i - 1].field, sorted[i].field, sorted[i].field->topic,
                               "topic");
    qsort(sorted, count, sizeof *sorted, compare_identifiers);
    for (i = 1; i < count; i++)
        if (strcmp(sorted[i - 1].field->identifier, sorted[i].field->identifier) == 0)
            return refuse_same(file, sorted[i - 1].field, sorted[i].field,
                               sorted[i].field->identifier, "identifier");
    return 1;
}

int device_names_make(yaml_file *file, device *of)
{
    named *sorted;
    uint16_t i;
    int is_right;

    for (i = 0; i < of->count; i++)
        if (!make_one(file, &of->fields[i]))
            return 0;
    sorted = (named *)calloc(of->count + 1u, sizeof *sorted);
    if (!sorted)
        return yaml_file_fail(file, ENOMEM);
    for (i = 0; i < of->count; i++)
        sorted[i].field = &of->fields[i];
    is_right = check_all(file, sorted, of->count);
    free(sorted);
    return is_right;
}
