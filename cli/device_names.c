/* The names of a device file: those of repeated fields, and the topic and identifier of each field.
 */
#include "device_keys.h"

#include "mbm.h"
#include "names.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* --- repetitions and groups --- */

enum { COUNT, EVERY, FIRST, REPEAT_KEYS };
static const char *const REPEAT_NAMES[] = {"count", "every", "first", NULL};
enum { REPEAT, FIELDS, GROUP_KEYS };
static const char *const GROUP_NAMES[] = {"repeat", "fields", NULL};

int device_repeat_read(yaml_file *file, const yaml_node_t *node, device_repeat *into)
{
    const yaml_node_t *values[REPEAT_KEYS] = {NULL};

    *into = (device_repeat){.count = 1, .first = 1};
    return !node ||
           (yaml_file_keys(file, "repeat", node, REPEAT_NAMES, 1u << COUNT | 1u << EVERY, values) &&
            yaml_file_number(file, "count", values[COUNT], 1, MBM_PLAN_MAX_FIELDS, &into->count) &&
            yaml_file_number(file, "every", values[EVERY], 1, 65535, &into->every) &&
            yaml_file_number(file, "first", values[FIRST], 0, 65535, &into->first));
}

void device_repeat_begin(yaml_file *file, const device_repeat *repeat, uint32_t at)
{
    snprintf(file->number, sizeof file->number, "%u", (unsigned)(repeat->first + at));
}

void device_repeat_end(yaml_file *file)
{
    file->number[0] = '\0';
}

const yaml_node_t *device_repeat_group(yaml_file *file, const yaml_node_t *item,
                                       const yaml_node_t **repeat)
{
    const yaml_node_t *values[GROUP_KEYS] = {NULL};
    size_t at, size = item->type == YAML_MAPPING_NODE ? yaml_file_size(item) : 0;

    for (at = 0; at < size; at++) {
        const yaml_node_t *key = yaml_file_pair_at(file, item, at).key;

        if (key->type == YAML_SCALAR_NODE &&
            strcmp((const char *)key->data.scalar.value, GROUP_NAMES[FIELDS]) == 0)
            break;
    }
    if (at == size ||
        !yaml_file_keys(file, "the group of fields", item, GROUP_NAMES, 1u << REPEAT, values))
        return NULL;
    *repeat = values[REPEAT];
    return values[FIELDS];
}

int device_repeat_name(yaml_file *file, const yaml_node_t *node, size_t most, char **name)
{
    const char *number = file->number, *text = yaml_file_text(file, "name", node, most);

    if (!text)
        return 0;
    if (!*number || strstr((const char *)node->data.scalar.value, YAML_FILE_NUMBER))
        number = NULL;
    if (asprintf(name, "%s%s%s", text, number ? " " : "", number ? number : "") < 0) {
        *name = NULL;
        return yaml_file_fail(file, ENOMEM);
    }
    return strlen(*name) <= most ||
           yaml_file_refuse(file, node, "name has more than %zu bytes with its number", most);
}

/* --- topics and identifiers --- */

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
