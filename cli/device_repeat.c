/* Reads repetitions and groups of fields, and makes the names of repeated fields.
 *
 * Licence: MIT OR Apache-2.0. */
#include "device_repeat.h"

#include "mbm.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

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
