#define _GNU_SOURCE
#include "mqtt_fields.h"

#include "mqtt_payload.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* The words of a line before the options. */
enum { NAME, UNIT, TABLE, ADDRESS, TYPE, INTERVAL, WORDS };

static const char *const TABLES[] = {"coil", "discrete", "holding", "input", NULL};
static const char *const TYPES[] = {"bit",   "uint16", "int16",  "uint32", "int32", "uint64",
                                    "int64", "float",  "double", "text",   NULL};
static const char *const ORDERS[] = {"ABCD", "CDAB", "BADC", "DCBA", NULL};

/* Returns the position of a word in a list, from 1 on; 0 if the list does not have it. */
static uint8_t position(const char *const *list, const char *word)
{
    uint8_t at;

    for (at = 0; list[at]; at++)
        if (strcmp(list[at], word) == 0)
            return (uint8_t)(at + 1);
    return 0;
}

/* Converts a number from `least` to `most`. Returns 0 if the word is no such number. */
static int number(const char *word, unsigned long least, unsigned long most, unsigned long *value)
{
    char *rest;

    errno = 0;
    *value = strtoul(word, &rest, strncmp(word, "0x", 2) == 0 ? 16 : 10);
    return word[0] >= '0' && word[0] <= '9' && !*rest && errno == 0 && *value >= least &&
           *value <= most;
}

/* Reads one option. Returns NULL, or what is wrong with it. */
static const char *read_option(char *word, mqtt_field *field, mbm_planField *planned)
{
    unsigned long value;

    if (strcmp(word, "write") == 0) {
        field->is_writable = 1;
        return NULL;
    }
    if (strncmp(word, "scale=", 6) == 0) {
        field->is_scaled = 1;
        return mqtt_payload_scale(word + 6, &field->scale)
                   ? NULL
                   : "the scale is no decimal number of up to 18 digits, or 0";
    }
    if (strncmp(word, "order=", 6) == 0) {
        planned->order = position(ORDERS, word + 6);
        return planned->order ? NULL : "the order is not ABCD, CDAB, BADC or DCBA";
    }
    if (strncmp(word, "count=", 6) == 0) {
        if (!number(word + 6, 1, 2000, &value))
            return "the count is not a number from 1 to 2000";
        planned->count = (uint16_t)value;
        return NULL;
    }
    return "unknown option";
}

/* Returns NULL, or what is wrong with a name: it is the middle of topics. */
static const char *check_name(const char *name)
{
    const char *last = strrchr(name, '/'), *at = name;
    int levels = 1;

    last = last ? last + 1 : name;
    if (strpbrk(name, "+#") || name[0] == '/')
        return "a name must not have + or # in it, nor begin with /";
    for (; *at; at++)
        levels += *at == '/';
    if (levels > MQTT_LEVELS || at - name > MQTT_LONGEST_NAME)
        return "a name has at most 200 bytes and 8 levels";
    if (strcmp(last, "set") == 0 || strcmp(last, "result") == 0 || strcmp(name, "status") == 0 ||
        (levels == 3 && strncmp(name, "unit/", 5) == 0 && strcmp(last, "status") == 0))
        return "the name is that of a topic of the bridge: NAME/set, NAME/result, status or "
               "unit/N/status";
    return NULL;
}

/* Reads the words of one line. Returns NULL, or what is wrong with them. */
static const char *read_words(char *words[WORDS], mqtt_field *field, mbm_planField *planned)
{
    unsigned long unit, address, interval;
    const char *wrong = check_name(words[NAME]);

    if (wrong)
        return wrong;
    if (!number(words[UNIT], 1, 255, &unit))
        return "the unit is not a number from 1 to 255";
    planned->unit = (uint8_t)unit;
    planned->table = position(TABLES, words[TABLE]);
    if (!planned->table)
        return "the table is not coil, discrete, holding or input";
    if (!number(words[ADDRESS], 0, 65535, &address))
        return "the address is not a number from 0 to 65535";
    planned->address = (uint16_t)address;
    planned->type = position(TYPES, words[TYPE]);
    if (!planned->type)
        return "unknown type";
    if (!number(words[INTERVAL], 1, MBM_PLAN_LONGEST_INTERVAL, &interval))
        return "the interval is not a number of milliseconds from 1 to a day";
    planned->intervalMs = (uint32_t)interval;
    field->scale = (mqtt_scale){.digits = 1, .value = 1};
    field->name = strdup(words[NAME]);
    return field->name ? NULL : strerror(ENOMEM);
}

/* Returns NULL if the options agree with the rest of the line, or what is wrong. */
static const char *check_options(const mqtt_field *field, const mbm_planField *planned)
{
    const int is_table_written =
        planned->table == MBM_TABLE_COILS || planned->table == MBM_TABLE_HOLDING_REGISTERS;

    if (field->is_scaled && (planned->type == MBM_TYPE_BIT || planned->type == MBM_TYPE_TEXT))
        return "a bit and a text have no scale";
    if (field->is_writable && !is_table_written)
        return "only coils and holding registers can be written";
    if (field->is_writable && (planned->count > 1 || planned->type == MBM_TYPE_TEXT))
        return "only single numbers and bits can be written";
    return NULL;
}

/* Makes the arrays one longer. Returns 0 if there is no memory. */
static int grow(mqtt_fields *fields)
{
    const size_t count = (size_t)fields->count + 1;
    void *grown;

    if ((grown = realloc(fields->fields, count * sizeof *fields->fields)) == NULL)
        return 0;
    fields->fields = (mqtt_field *)grown;
    if ((grown = realloc(fields->planned, count * sizeof *fields->planned)) == NULL)
        return 0;
    fields->planned = (mbm_planField *)grown;
    if ((grown = realloc(fields->lines, count * sizeof *fields->lines)) == NULL)
        return 0;
    fields->lines = (int *)grown;
    memset(&fields->fields[count - 1], 0, sizeof *fields->fields);
    memset(&fields->planned[count - 1], 0, sizeof *fields->planned);
    return 1;
}

/* Reads one line, which may be empty. Returns NULL, or what is wrong with it. */
static const char *read_line(mqtt_fields *fields, char *line, int at)
{
    static const char SPACE[] = " \t\r\n";
    char *words[WORDS], *rest = NULL, *word;
    const char *wrong;
    mbm_planField *planned;
    mqtt_field *field;
    int count = 0;

    line[strcspn(line, "#")] = '\0';
    for (word = strtok_r(line, SPACE, &rest); word && count < WORDS;
         word = count < WORDS ? strtok_r(NULL, SPACE, &rest) : NULL)
        words[count++] = word;
    if (count == 0)
        return NULL;
    if (count < WORDS)
        return "a line has name, unit, table, address, type and interval";
    if (mqtt_fields_find(fields, words[NAME]) >= 0)
        return "a field above has this name";
    if (fields->count == MBM_PLAN_MAX_FIELDS)
        return "too many fields";
    if (!grow(fields))
        return strerror(ENOMEM);
    field = &fields->fields[fields->count];
    planned = &fields->planned[fields->count];
    fields->lines[fields->count] = at;
    wrong = read_words(words, field, planned);
    while (!wrong && (word = strtok_r(NULL, SPACE, &rest)) != NULL)
        wrong = read_option(word, field, planned);
    if (!wrong)
        wrong = check_options(field, planned);
    fields->count++;
    return wrong;
}

int mqtt_fields_read(mqtt_fields *fields, const char *path)
{
    const char *wrong = NULL;
    char *line = NULL;
    size_t size = 0;
    int at = 0;
    FILE *file;

    memset(fields, 0, sizeof *fields);
    file = fopen(path, "r");
    if (!file) {
        fprintf(stderr, "%s: %s\n", path, strerror(errno));
        return -1;
    }
    while (!wrong && getline(&line, &size, file) >= 0)
        wrong = read_line(fields, line, ++at);
    if (!wrong && fields->count == 0)
        wrong = "the file has no field";
    if (wrong)
        fprintf(stderr, "%s:%d: %s\n", path, at, wrong);
    free(line);
    (void)fclose(file);
    return wrong ? -1 : 0;
}

int mqtt_fields_find(const mqtt_fields *fields, const char *name)
{
    int at;

    for (at = 0; at < fields->count; at++)
        if (fields->fields[at].name && strcmp(fields->fields[at].name, name) == 0)
            return at;
    return -1;
}

void mqtt_fields_free(mqtt_fields *fields)
{
    while (fields->count > 0)
        free(fields->fields[--fields->count].name);
    free(fields->fields);
    free(fields->planned);
    free(fields->lines);
}
