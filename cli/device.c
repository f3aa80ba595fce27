#define _GNU_SOURCE
#include "device.h"

#include "numbers.h"
#include "report.h"

#include <errno.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <yaml.h>

enum {
    MOST_REGISTERS = 125,
    MOST_BITS = 2000,
    MOST_WORD = 100,
    MOST_LABELS = 1000,
    UNIT = 1,
    INTERVAL_MS = 1000
};

/* Lists of words, beside those of value.h: the number of a word is its position, from 1 on. */
static const char *const ACCESSES[] = {"read", "write", "read-write", NULL};
static const char *const ANSWERS[] = {"no", "yes", NULL};
static const char *const BITS[] = {"0", "1", "false", "true", "off", "on", NULL};

/* The keys of the file and of a field. The numbers count from 0 here. */
enum { DEVICE, DEVICE_UNIT, DEVICE_INTERVAL, DEVICE_ORDER, MASK_WRITE, FIELDS, DEVICE_KEYS };
static const char *const DEVICE_NAMES[] = {"device",     "unit",   "interval", "order",
                                           "mask_write", "fields", NULL};
enum {
    NAME,
    TABLE,
    ADDRESS,
    TYPE,
    BIT,
    COUNT,
    SCALE,
    MEASURE,
    ACCESS,
    INTERVAL,
    VALUE,
    FIELD_UNIT,
    ORDER,
    DESCRIPTION,
    ENUMERATION,
    FIELD_KEYS
};
static const char *const FIELD_NAMES[] = {
    "name",   "table",       "address",     "type",
    "bit",    "count",       "scale",       "unit_of_measurement",
    "access", "interval",    "value",       "unit",
    "order",  "description", "enumeration", NULL};

/* A file that is being read. */
typedef struct reader {
    device *into;
    const char *path;
    yaml_parser_t parser;
    yaml_document_t document;
    uint32_t unit, interval;
    uint8_t order;
    int code; /* CODE_SYSTEM or CODE_WRONG after a failure */
} reader;

/* --- what is wrong --- */

/* Stores the reason, if it is the first. Returns 0. A line of 0 is none. */
__attribute__((format(printf, 3, 4))) static int refuse(reader *from, size_t line,
                                                        const char *format, ...)
{
    device *into = from->into;
    va_list values;
    int length;

    if (from->code != 0)
        return 0;
    from->code = CODE_WRONG;
    if (line > 0)
        length = snprintf(into->wrong, sizeof into->wrong, "%s:%zu: ", from->path, line);
    else
        length = snprintf(into->wrong, sizeof into->wrong, "%s: ", from->path);
    if ((size_t)length >= sizeof into->wrong)
        return 0;
    va_start(values, format);
    (void)vsnprintf(into->wrong + length, sizeof into->wrong - (size_t)length, format, values);
    va_end(values);
    return 0;
}

static int fail(reader *from, int error)
{
    (void)refuse(from, 0, "%s", strerror(error));
    from->code = CODE_SYSTEM;
    return 0;
}

/* --- nodes of the document --- */

static size_t line_of(const yaml_node_t *node)
{
    return node->start_mark.line + 1;
}

static const char *kind_of(const yaml_node_t *node)
{
    return node->type == YAML_SEQUENCE_NODE ? "a list" : "a mapping";
}

/* Returns the text of a node, or NULL after refusing one that is no text, or an empty one. The
 * text has at most `most` bytes and no control characters. */
static const char *read_text(reader *from, const char *key, const yaml_node_t *node, size_t most)
{
    const unsigned char *at;

    if (node->type != YAML_SCALAR_NODE)
        return refuse(from, line_of(node), "%s is %s: it must be one word", key, kind_of(node)),
               NULL;
    if (node->data.scalar.length == 0)
        return refuse(from, line_of(node), "%s is empty", key), NULL;
    if (node->data.scalar.length > most)
        return refuse(from, line_of(node), "%s has more than %zu bytes", key, most), NULL;
    for (at = node->data.scalar.value; at < node->data.scalar.value + node->data.scalar.length;
         at++)
        if (*at < ' ' || *at == 0x7F)
            return refuse(from, line_of(node), "%s has a control character", key), NULL;
    return (const char *)node->data.scalar.value;
}

/* Reads a word of a list as its number: its position, from 1 on. Returns 0 after a refusal. */
static uint8_t read_word(reader *from, const char *key, const yaml_node_t *node,
                         const char *const *list)
{
    const char *word = read_text(from, key, node, MOST_WORD), *wrong;
    int index;

    if (!word)
        return 0;
    wrong = number_word(word, list, &index);
    if (wrong)
        return (uint8_t)refuse(from, line_of(node), "%s: %s", key, wrong);
    return (uint8_t)(index + 1);
}

/* Reads a whole number. Returns 0 after a refusal. */
static int read_number(reader *from, const char *key, const yaml_node_t *node, uint32_t least,
                       uint32_t most, uint32_t *value)
{
    const char *word = read_text(from, key, node, MOST_WORD), *wrong;
    int64_t number;

    if (!word)
        return 0;
    /* Other programs read such a number as octal. */
    if (word[0] == '0' && word[1])
        return refuse(from, line_of(node), "%s: \"%s\" begins with 0: write a decimal number", key,
                      word);
    wrong = number_read(word, least, most, &number);
    if (wrong)
        return refuse(from, line_of(node), "%s: %s", key, wrong);
    *value = (uint32_t)number;
    return 1;
}

/* Reads a time as milliseconds. Returns 0 after a refusal. */
static int read_interval(reader *from, const yaml_node_t *node, uint32_t *value)
{
    const char *word = read_text(from, "interval", node, MOST_WORD), *wrong;

    if (!word)
        return 0;
    wrong = number_time(word, 1, MBM_PLAN_LONGEST_INTERVAL, value);
    return wrong ? refuse(from, line_of(node), "interval: %s", wrong) : 1;
}

/* Copies the text of a node. Returns 0 after a refusal. */
static int copy_text(reader *from, const char *key, const yaml_node_t *node, size_t most,
                     char **copy)
{
    const char *text = read_text(from, key, node, most);

    if (!text)
        return 0;
    *copy = strdup(text);
    return *copy ? 1 : fail(from, ENOMEM);
}

/* Sorts the values of a mapping by their keys: values[i] is that of names[i], NULL without one.
 * Returns 0 after a refusal. */
static int read_keys(reader *from, const yaml_node_t *mapping, const char *const *names,
                     yaml_node_t **values)
{
    yaml_node_pair_t *pair;

    for (pair = mapping->data.mapping.pairs.start; pair < mapping->data.mapping.pairs.top; pair++) {
        const yaml_node_t *key = yaml_document_get_node(&from->document, pair->key);
        const uint8_t number = read_word(from, "key", key, names);

        if (number == 0)
            return 0;
        if (values[number - 1])
            return refuse(from, line_of(key), "%s is there twice, first in line %zu",
                          names[number - 1], line_of(values[number - 1]));
        values[number - 1] = yaml_document_get_node(&from->document, pair->value);
    }
    return 1;
}

/* --- the words of a field --- */

int device_is_part(const mbm_planField *planned)
{
    return planned->type == MBM_TYPE_BIT && planned->table >= MBM_TABLE_HOLDING_REGISTERS;
}

uint32_t device_size(const mbm_planField *planned)
{
    const uint16_t count = planned->count ? planned->count : 1;
    const uint16_t one = value_registers(planned->type, count);

    return planned->type == MBM_TYPE_TEXT || device_is_part(planned) ? one : (uint32_t)one * count;
}

uint16_t device_part(const mbm_planField *planned, uint16_t bits)
{
    mbm_registers registers;
    uint16_t word = 0;

    (void)mbm_registers_intoWords(&registers, &word, 1, 0);
    (void)mbm_registers_setUint16(&registers, 0, planned->order, (uint16_t)(bits << planned->bit));
    return word;
}

uint16_t device_mask(const mbm_planField *planned)
{
    return device_is_part(planned) ? device_part(planned, (uint16_t)((1u << planned->count) - 1))
                                   : 0xFFFF;
}

/* --- a value --- */

/* Writes a text of UTF-8 as Latin-1, as far as it fits. Returns its length, or -1 if a character is
 * not in Latin-1. The parser has checked that it is UTF-8. */
static long to_latin(const char *text, char *latin, size_t capacity)
{
    size_t length = 0;

    for (; *text; text++) {
        unsigned char one = (unsigned char)*text;

        if (one > 0xC3)
            return -1;
        if (one >= 0xC2)
            one = (unsigned char)(one << 6 | (*++text & 0x3F));
        if (length < capacity)
            latin[length] = (char)one;
        length++;
    }
    return (long)length;
}

static int read_text_value(reader *from, const yaml_node_t *node, const mbm_planField *planned,
                           uint16_t *words)
{
    const char *text = read_text(from, "value", node, 4 * MOST_REGISTERS);
    char latin[2 * MOST_REGISTERS + 1] = "";
    mbm_registers registers;
    long length;

    if (!text)
        return 0;
    length = to_latin(text, latin, sizeof latin - 1);
    if (length < 0)
        return refuse(from, line_of(node), "value has a character that is not in Latin-1");
    if (length > planned->count)
        return refuse(from, line_of(node), "value has %ld characters, and count is %u", length,
                      planned->count);
    (void)mbm_registers_intoWords(&registers, words, (uint16_t)device_size(planned), 0);
    (void)mbm_registers_setString(&registers, 0, planned->count, planned->order, latin);
    return 1;
}

/* Reads one bit. Returns 1, 0 after a refusal. */
static uint16_t read_bit(reader *from, const yaml_node_t *node, uint16_t *word)
{
    const uint8_t position = read_word(from, "value", node, BITS);

    *word = (uint16_t)((position - 1) & 1);
    return position != 0;
}

/* Reads the number that bits of a register are. Returns 1, 0 after a refusal. */
static uint16_t read_part(reader *from, const yaml_node_t *node, const mbm_planField *planned,
                          uint16_t *word)
{
    uint32_t number = 0;

    if (planned->count == 1
            ? read_bit(from, node, word) == 0
            : !read_number(from, "value", node, 0, (1u << planned->count) - 1, &number))
        return 0;
    *word = device_part(planned, planned->count == 1 ? *word : (uint16_t)number);
    return 1;
}

/* Reads one number or bit. Returns how many words it has, 0 after a refusal. */
static uint16_t read_one_value(reader *from, const yaml_node_t *node, const device_field *field,
                               const mbm_planField *planned, uint16_t *words)
{
    const char *text = read_text(from, "value", node, VALUE_LONGEST), *wrong;
    uint16_t number[VALUE_WORDS], count;

    if (!text)
        return 0;
    if (device_is_part(planned))
        return read_part(from, node, planned, words);
    if (planned->type == MBM_TYPE_BIT)
        return read_bit(from, node, words);
    count = value_read(&field->form, text, strlen(text), number, &wrong);
    if (count == 0)
        (void)refuse(from, line_of(node), "value: \"%s\" %s%s%s", text, wrong,
                     strstr(wrong, "range") ? " of " : "",
                     strstr(wrong, "range") ? value_type_names[planned->type] : "");
    memcpy(words, number, count * sizeof *words);
    return count;
}

static int read_value(reader *from, const yaml_node_t *node, device_field *field,
                      const mbm_planField *planned)
{
    const yaml_node_item_t *item;
    uint16_t *words;

    if (!node)
        return 1;
    field->words = (uint16_t *)calloc(device_size(planned), sizeof *field->words);
    if (!field->words)
        return fail(from, ENOMEM);
    if (planned->type == MBM_TYPE_TEXT)
        return read_text_value(from, node, planned, field->words);
    if (planned->count == 1 || device_is_part(planned))
        return read_one_value(from, node, field, planned, field->words) > 0;
    if (node->type != YAML_SEQUENCE_NODE ||
        node->data.sequence.items.top - node->data.sequence.items.start != planned->count)
        return refuse(from, line_of(node), "value must be a list of %u values, as count says",
                      planned->count);
    words = field->words;
    for (item = node->data.sequence.items.start; item < node->data.sequence.items.top; item++) {
        const uint16_t count = read_one_value(from, yaml_document_get_node(&from->document, *item),
                                              field, planned, words);

        if (count == 0)
            return 0;
        words += count;
    }
    return 1;
}

/* --- an enumeration --- */

/* How many registers a number of a field has: 1 for bits. */
static uint16_t number_size(const mbm_planField *planned)
{
    return value_registers(planned->type, 1);
}

/* Reads a number of an enumeration, as value_read reads a value without a scale. Returns 0 after a
 * refusal. */
static int read_label_number(reader *from, const yaml_node_t *node, const mbm_planField *planned,
                             device_label *label)
{
    const char *text = read_text(from, "enumeration", node, VALUE_LONGEST), *digits, *wrong;
    const uint32_t most = device_is_part(planned) ? (1u << planned->count) - 1 : 1;
    value_form form = {.type = planned->type, .order = planned->order};

    if (!text)
        return 0;
    digits = text + (text[0] == '-');
    if (digits[0] == '\0' || digits[strspn(digits, "0123456789")] != '\0')
        return refuse(from, line_of(node), "enumeration: \"%s\" is not a whole decimal number",
                      text);
    if (digits[0] == '0' && (digits[1] != '\0' || digits > text))
        return refuse(from, line_of(node),
                      "enumeration: \"%s\" begins with 0: write a decimal number", text);
    if (planned->type == MBM_TYPE_BIT) {
        form.type = MBM_TYPE_UINT16;
        form.order = MBM_ORDER_ABCD;
    }
    if (value_read(&form, text, strlen(text), label->words, &wrong) == 0 ||
        (planned->type == MBM_TYPE_BIT && label->words[0] > most)) {
        if (planned->type == MBM_TYPE_BIT)
            return refuse(from, line_of(node),
                          "enumeration: \"%s\" is out of range: from 0 to %u is allowed", text,
                          (unsigned)most);
        return refuse(from, line_of(node), "enumeration: \"%s\" is out of range of %s", text,
                      value_type_names[planned->type]);
    }
    label->number = strdup(text);
    return label->number ? 1 : fail(from, ENOMEM);
}

/* Reads a number and its name, which must not be there yet. Returns 0 after a refusal. */
static int read_label(reader *from, const yaml_node_pair_t *pair, const mbm_planField *planned,
                      device_field *field)
{
    const yaml_node_t *number = yaml_document_get_node(&from->document, pair->key);
    const yaml_node_t *name = yaml_document_get_node(&from->document, pair->value);
    device_label *label = &field->labels[field->label_count];
    const size_t size = number_size(planned) * sizeof *label->words;
    const device_label *other;

    field->label_count++;
    label->line = (int)line_of(number);
    if (!read_label_number(from, number, planned, label) ||
        !copy_text(from, "enumeration", name, DEVICE_NAME_BYTES, &label->name))
        return 0;
    for (other = field->labels; other < label; other++) {
        if (memcmp(other->words, label->words, size) == 0)
            return refuse(from, line_of(number),
                          "enumeration has the number %s twice, first in line %d", label->number,
                          other->line);
        if (strcmp(other->name, label->name) == 0)
            return refuse(from, line_of(name),
                          "enumeration has the name %s twice, first in line %d", label->name,
                          other->line);
    }
    return 1;
}

static int read_enumeration(reader *from, const yaml_node_t *node, const yaml_node_t *scale,
                            const mbm_planField *planned, device_field *field)
{
    const yaml_node_pair_t *pair;
    size_t count;

    if (!node)
        return 1;
    if (planned->type >= MBM_TYPE_FLOAT)
        return refuse(from, line_of(node),
                      "a %s has no enumeration: only integers and bits have one",
                      value_type_names[planned->type]);
    if (scale)
        return refuse(from, line_of(node), "a field with a scale has no enumeration");
    if (node->type != YAML_MAPPING_NODE)
        return refuse(from, line_of(node),
                      "enumeration must be a mapping of numbers to names, such as {0: stopped, 1: "
                      "running}");
    count = (size_t)(node->data.mapping.pairs.top - node->data.mapping.pairs.start);
    if (count == 0)
        return refuse(from, line_of(node), "enumeration is empty");
    if (count > MOST_LABELS)
        return refuse(from, line_of(node), "enumeration has %zu names: %d are allowed", count,
                      MOST_LABELS);
    field->labels = (device_label *)calloc(count, sizeof *field->labels);
    if (!field->labels)
        return fail(from, ENOMEM);
    for (pair = node->data.mapping.pairs.start; pair < node->data.mapping.pairs.top; pair++)
        if (!read_label(from, pair, planned, field))
            return 0;
    return 1;
}

const char *device_label_of(const device *from, uint16_t field, const uint16_t *words)
{
    const device_field *of = &from->fields[field];
    const size_t size = number_size(&from->planned[field]) * sizeof *words;
    uint16_t i;

    for (i = 0; i < of->label_count; i++)
        if (memcmp(of->labels[i].words, words, size) == 0)
            return of->labels[i].name;
    return NULL;
}

/* --- a field --- */

/* Whether table and type are known and go together. Returns 0 after a refusal. */
static int read_type(reader *from, const yaml_node_t *field, yaml_node_t *const *values,
                     mbm_planField *planned)
{
    int is_bits;

    planned->table = read_word(from, "table", values[TABLE], value_table_names + 1);
    if (!planned->table)
        return 0;
    is_bits = planned->table <= MBM_TABLE_DISCRETE_INPUTS;
    if (!values[TYPE] && !is_bits)
        return refuse(from, line_of(field), "the field has no type");
    planned->type =
        values[TYPE] ? read_word(from, "type", values[TYPE], value_type_names + 1) : MBM_TYPE_BIT;
    if (!planned->type)
        return 0;
    if (is_bits && planned->type != MBM_TYPE_BIT)
        return refuse(from, line_of(values[TYPE]),
                      "type is %s: the type of coils and discrete inputs is bit",
                      value_type_names[planned->type]);
    if (values[BIT] && !device_is_part(planned))
        return refuse(from, line_of(values[BIT]),
                      "bit is for fields of the type bit in the tables holding and input");
    return 1;
}

/* Reads address and count, which must not reach beyond a request or the table. */
static int read_place(reader *from, const yaml_node_t *field, yaml_node_t *const *values,
                      mbm_planField *planned)
{
    uint32_t address = 0, bit = 0, count = 1, size;
    const int is_bit = planned->table <= MBM_TABLE_DISCRETE_INPUTS;

    if (planned->type == MBM_TYPE_TEXT && !values[COUNT])
        return refuse(from, line_of(field), "a text needs its number of characters as count");
    if (!read_number(from, "address", values[ADDRESS], 0, 65535, &address) ||
        (values[BIT] && !read_number(from, "bit", values[BIT], 0, 15, &bit)) ||
        (values[COUNT] && !read_number(from, "count", values[COUNT], 1, MOST_BITS, &count)))
        return 0;
    planned->address = (uint16_t)address;
    planned->count = (uint16_t)count;
    planned->bit = (uint8_t)bit;
    if (device_is_part(planned) && bit + count > 16)
        return refuse(from, line_of(values[COUNT] ? values[COUNT] : field),
                      "the field has %u bits from bit %u on: a register has the bits 0 to 15",
                      count, bit);
    size = device_size(planned);
    if (size > (is_bit ? MOST_BITS : MOST_REGISTERS))
        return refuse(from, line_of(values[COUNT] ? values[COUNT] : field),
                      "count is %u: these are %u registers, and one request reads at most %d",
                      count, size, MOST_REGISTERS);
    if (address + size > 65536)
        return refuse(from, line_of(values[ADDRESS]),
                      "the field has %u %s from address %u on: addresses end at 65535", size,
                      is_bit ? "bits" : "registers", address);
    return 1;
}

/* Reads what a field takes from the device unless it has its own. */
static int read_inherited(reader *from, yaml_node_t *const *values, mbm_planField *planned)
{
    uint32_t unit = from->unit;

    planned->intervalMs = from->interval;
    planned->order = from->order;
    if ((values[FIELD_UNIT] && !read_number(from, "unit", values[FIELD_UNIT], 1, 255, &unit)) ||
        (values[INTERVAL] && !read_interval(from, values[INTERVAL], &planned->intervalMs)))
        return 0;
    planned->unit = (uint16_t)unit;
    if (values[ORDER])
        planned->order = read_word(from, "order", values[ORDER], value_order_names + 1);
    return planned->order != 0;
}

static int read_access(reader *from, const yaml_node_t *node, const mbm_planField *planned,
                       device_field *field)
{
    const int is_input =
        planned->table == MBM_TABLE_DISCRETE_INPUTS || planned->table == MBM_TABLE_INPUT_REGISTERS;

    field->access = node ? read_word(from, "access", node, ACCESSES) : DEVICE_READ;
    if (node && field->access > DEVICE_READ && is_input)
        return refuse(from, line_of(node),
                      "access is %s: only coils and holding registers can be written",
                      ACCESSES[field->access - 1]);
    if (node && field->access > DEVICE_READ && device_is_part(planned) && !from->into->writes_masks)
        return refuse(from, line_of(node),
                      "access is %s: bits of a register cannot be written, unless the device has "
                      "function 22 and the file says \"mask_write: yes\"",
                      ACCESSES[field->access - 1]);
    return field->access != 0;
}

static int read_scale(reader *from, const yaml_node_t *node, const mbm_planField *planned,
                      device_field *field)
{
    const char *text;

    field->form.type = planned->type;
    field->form.order = planned->order;
    if (!node)
        return 1;
    field->scale_line = (int)line_of(node);
    text = read_text(from, "scale", node, VALUE_LONGEST);
    if (!text)
        return 0;
    if (planned->type == MBM_TYPE_BIT || planned->type == MBM_TYPE_TEXT)
        return refuse(from, line_of(node), "a %s has no scale", value_type_names[planned->type]);
    if (!value_scale_read(text, &field->form.scale))
        return refuse(from, line_of(node),
                      "scale: \"%s\" is not a decimal number of up to 18 digits other than 0",
                      text);
    return 1;
}

/* Returns whether two fields have an address in common for which the file gives other values. */
static int is_contradiction(const device *of, uint16_t one, uint16_t other)
{
    const mbm_planField *a = &of->planned[one], *b = &of->planned[other];
    const uint16_t mask = device_mask(a) & device_mask(b);
    const uint32_t end_a = a->address + device_size(a), end_b = b->address + device_size(b);
    uint32_t at = a->address > b->address ? a->address : b->address;

    if (a->unit != b->unit || a->table != b->table || !of->fields[one].words ||
        !of->fields[other].words)
        return 0;
    for (; at < end_a && at < end_b; at++)
        if ((of->fields[one].words[at - a->address] ^ of->fields[other].words[at - b->address]) &
            mask)
            return 1;
    return 0;
}

/* Whether a field goes with those before it. Returns 0 after a refusal. */
static int check_others(reader *from, const yaml_node_t *node, uint16_t at)
{
    const device_field *fields = from->into->fields;
    uint16_t i;

    for (i = 0; i < at; i++) {
        if (strcmp(fields[i].name, fields[at].name) == 0)
            return refuse(from, line_of(node), "the field in line %d has the name %s too",
                          fields[i].line, fields[i].name);
        if (is_contradiction(from->into, i, at))
            return refuse(from, line_of(node),
                          "%s shares an address with %s of line %d, and has another value",
                          fields[at].name, fields[i].name, fields[i].line);
    }
    return 1;
}

static int read_field(reader *from, yaml_node_t *node)
{
    static const uint8_t NEEDED[] = {NAME, TABLE, ADDRESS};
    device *into = from->into;
    device_field *field = &into->fields[into->count];
    mbm_planField *planned = &into->planned[into->count];
    yaml_node_t *values[FIELD_KEYS] = {NULL};
    size_t i;

    if (node->type != YAML_MAPPING_NODE)
        return refuse(from, line_of(node), "a field is a mapping that begins with \"- name:\"");
    field->line = (int)line_of(node);
    into->count++;
    if (!read_keys(from, node, FIELD_NAMES, values))
        return 0;
    for (i = 0; i < sizeof NEEDED; i++)
        if (!values[NEEDED[i]])
            return refuse(from, line_of(node), "the field has no %s", FIELD_NAMES[NEEDED[i]]);
    return copy_text(from, "name", values[NAME], DEVICE_NAME_BYTES, &field->name) &&
           (!values[MEASURE] || copy_text(from, "unit_of_measurement", values[MEASURE],
                                          DEVICE_NAME_BYTES, &field->unit_of_measurement)) &&
           (!values[DESCRIPTION] ||
            copy_text(from, "description", values[DESCRIPTION], 10000, &field->description)) &&
           read_type(from, node, values, planned) && read_place(from, node, values, planned) &&
           read_inherited(from, values, planned) &&
           read_access(from, values[ACCESS], planned, field) &&
           read_scale(from, values[SCALE], planned, field) &&
           read_value(from, values[VALUE], field, planned) &&
           read_enumeration(from, values[ENUMERATION], values[SCALE], planned, field) &&
           check_others(from, node, (uint16_t)(into->count - 1));
}

/* --- the file --- */

static int read_fields(reader *from, yaml_node_t *list)
{
    device *into = from->into;
    yaml_node_item_t *item;
    size_t count;

    if (list->type != YAML_SEQUENCE_NODE)
        return refuse(from, line_of(list), "fields must be a list: each field begins with \"-\"");
    count = (size_t)(list->data.sequence.items.top - list->data.sequence.items.start);
    if (count == 0)
        return refuse(from, line_of(list), "fields is empty");
    if (count > MBM_PLAN_MAX_FIELDS)
        return refuse(from, line_of(list), "the file has %zu fields: %d are allowed", count,
                      MBM_PLAN_MAX_FIELDS);
    into->fields = (device_field *)calloc(count, sizeof *into->fields);
    into->planned = (mbm_planField *)calloc(count, sizeof *into->planned);
    if (!into->fields || !into->planned)
        return fail(from, ENOMEM);
    for (item = list->data.sequence.items.start; item < list->data.sequence.items.top; item++)
        if (!read_field(from, yaml_document_get_node(&from->document, *item)))
            return 0;
    return 1;
}

static int read_device(reader *from, yaml_node_t *root)
{
    yaml_node_t *values[DEVICE_KEYS] = {NULL};

    if (!root)
        return refuse(from, 0, "the file is empty");
    if (root->type != YAML_MAPPING_NODE)
        return refuse(from, line_of(root), "the file has no key fields");
    if (!read_keys(from, root, DEVICE_NAMES, values))
        return 0;
    if (!values[FIELDS])
        return refuse(from, line_of(root), "the file has no key fields");
    from->unit = UNIT;
    from->interval = INTERVAL_MS;
    from->order = MBM_ORDER_ABCD;
    if (values[DEVICE] &&
        !copy_text(from, "device", values[DEVICE], DEVICE_NAME_BYTES, &from->into->name))
        return 0;
    if (values[DEVICE_UNIT] && !read_number(from, "unit", values[DEVICE_UNIT], 1, 255, &from->unit))
        return 0;
    if (values[DEVICE_INTERVAL] && !read_interval(from, values[DEVICE_INTERVAL], &from->interval))
        return 0;
    if (values[DEVICE_ORDER])
        from->order = read_word(from, "order", values[DEVICE_ORDER], value_order_names + 1);
    if (values[MASK_WRITE]) {
        const uint8_t word = read_word(from, "mask_write", values[MASK_WRITE], ANSWERS);

        from->into->writes_masks = word == 2;
        if (word == 0)
            return 0;
    }
    return from->order != 0 && read_fields(from, values[FIELDS]);
}

/* Refuses what is not YAML. */
static int refuse_syntax(reader *from, FILE *file)
{
    const yaml_parser_t *parser = &from->parser;

    if (parser->error == YAML_MEMORY_ERROR)
        return fail(from, ENOMEM);
    if (ferror(file))
        return fail(from, errno);
    if (parser->error == YAML_READER_ERROR)
        return refuse(from, 0, "this is not YAML: %s, at byte %zu", parser->problem,
                      parser->problem_offset);
    return refuse(from, parser->problem_mark.line + 1, "this is not YAML: %s%s%s",
                  parser->context ? parser->context : "", parser->context ? ", " : "",
                  parser->problem);
}

/* Reads the document, after which no other may follow. */
static void read_document(reader *from, FILE *file)
{
    yaml_document_t second;
    const yaml_node_t *root;

    if (!yaml_parser_load(&from->parser, &from->document)) {
        (void)refuse_syntax(from, file);
        return;
    }
    if (read_device(from, yaml_document_get_root_node(&from->document))) {
        if (!yaml_parser_load(&from->parser, &second)) {
            (void)refuse_syntax(from, file);
        } else {
            root = yaml_document_get_root_node(&second);
            if (root)
                (void)refuse(from, line_of(root),
                             "a second document begins: a file has one device");
            yaml_document_delete(&second);
        }
    }
    yaml_document_delete(&from->document);
}

/* Moves the fields that can be read before those that cannot. Returns 0 after a failure. */
static int sort_fields(reader *from)
{
    device *into = from->into;
    const uint16_t count = into->count;
    device_field *fields = (device_field *)calloc(count, sizeof *fields);
    mbm_planField *planned = (mbm_planField *)calloc(count, sizeof *planned);
    uint16_t i, to = 0;
    int turn;

    if (!fields || !planned) {
        free(fields);
        free(planned);
        return fail(from, ENOMEM);
    }
    for (turn = 0; turn < 2; turn++) {
        for (i = 0; i < count; i++)
            if (((into->fields[i].access & DEVICE_READ) == 0) == turn) {
                fields[to] = into->fields[i];
                planned[to++] = into->planned[i];
            }
        if (turn == 0)
            into->readable = to;
    }
    free(into->fields);
    free(into->planned);
    into->fields = fields;
    into->planned = planned;
    return 1;
}

int device_read(device *into, const char *path)
{
    reader from = {.into = into, .path = path};
    FILE *file;

    memset(into, 0, sizeof *into);
    file = fopen(path, "rb");
    if (!file) {
        (void)fail(&from, errno);
        return from.code;
    }
    if (yaml_parser_initialize(&from.parser)) {
        yaml_parser_set_input_file(&from.parser, file);
        read_document(&from, file);
        yaml_parser_delete(&from.parser);
    } else {
        (void)fail(&from, ENOMEM);
    }
    (void)fclose(file);
    if (from.code == 0)
        (void)sort_fields(&from);
    if (from.code != 0)
        device_free(into);
    return from.code;
}

void device_free(device *into)
{
    while (into->count > 0) {
        device_field *field = &into->fields[--into->count];

        while (field->label_count > 0) {
            free(field->labels[--field->label_count].name);
            free(field->labels[field->label_count].number);
        }
        free(field->labels);
        free(field->name);
        free(field->unit_of_measurement);
        free(field->description);
        free(field->words);
    }
    free(into->fields);
    free(into->planned);
    free(into->name);
    into->fields = NULL;
    into->planned = NULL;
    into->name = NULL;
    into->readable = 0;
}

int device_find(const device *from, const char *name)
{
    int at;

    for (at = 0; at < from->count; at++)
        if (strcmp(from->fields[at].name, name) == 0)
            return at;
    return -1;
}
