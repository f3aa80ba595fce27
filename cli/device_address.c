/* Reads addresses as on the wire, from 1 on, and as Modicon and others write them: 40101, HR101. */
#include "device_keys.h"

#include "numbers.h"

#include <stdio.h>
#include <string.h>
#include <strings.h>

enum { LONGEST = 20, LAST = 65536 /* of addresses that count from 1 */ };

#define MODICON_HELP                                                                                 \
    "in the notation modicon coils are 1 to 9999, discrete inputs 10001 to 19999, input registers "  \
    "30001 to 39999 and holding registers 40001 to 49999; with six digits 000001 to 065536, 100001 " \
    "to 165536 and so on; also c1, di1, ir1 and hr1"

int device_address_read_notation(yaml_file *file, const yaml_node_t *notation,
                                 const yaml_node_t *one_based, device *into)
{
    static const char *const NOTATIONS[] = {"wire", "modicon", NULL};
    uint8_t is_one_based = 0;
    int is_modicon = 0;

    if (!yaml_file_word(file, "notation", notation, NOTATIONS, &is_modicon) ||
        !yaml_file_answer(file, "one_based", one_based, &is_one_based))
        return 0;
    if (is_modicon && one_based)
        return yaml_file_refuse(file, one_based,
                                "one_based and \"notation: modicon\" exclude each other: 40001 "
                                "counts from 1 already");
    into->notation = is_modicon ? DEVICE_MODICON : is_one_based ? DEVICE_ONE_BASED : DEVICE_ON_WIRE;
    return 1;
}

int device_address_read_table(yaml_file *file, const yaml_node_t *node, uint8_t *table)
{
    return yaml_file_kind(file, "table", node, value_table_names + 1, table);
}

/* Reads a number from 1 to 65536 that is the rest of an address. Returns 0 if it is none. */
static int read_rest(const char *text, uint32_t *address)
{
    int64_t number;

    if (number_read(text, 1, LAST, &number) != NULL)
        return 0;
    *address = (uint32_t)number - 1;
    return 1;
}

/* Reads HR101 and the like. Returns 0 if it is none. */
static int read_letters(const char *text, device_place *into)
{
    static const struct {
        const char *letters;
        uint8_t table;
    } NAMES[] = {{"co", MBM_TABLE_COILS},
                 {"c", MBM_TABLE_COILS},
                 {"di", MBM_TABLE_DISCRETE_INPUTS},
                 {"ir", MBM_TABLE_INPUT_REGISTERS},
                 {"hr", MBM_TABLE_HOLDING_REGISTERS}};
    size_t i;

    for (i = 0; i < sizeof NAMES / sizeof NAMES[0]; i++) {
        const size_t length = strlen(NAMES[i].letters);

        if (strncasecmp(text, NAMES[i].letters, length) == 0 && text[length] != '0' &&
            read_rest(text + length, &into->address)) {
            into->table = NAMES[i].table;
            return 1;
        }
    }
    return 0;
}

/* Reads 40101, 400101 and the like. Returns 0 if it is none. */
static int read_digits(const char *text, device_place *into)
{
    static const uint8_t TABLES[] = {MBM_TABLE_COILS, MBM_TABLE_DISCRETE_INPUTS, 0,
                                     MBM_TABLE_INPUT_REGISTERS, MBM_TABLE_HOLDING_REGISTERS};
    const size_t length = strlen(text);

    if (length == 0 || length > 6 || strspn(text, "0123456789") != length)
        return 0;
    into->table = MBM_TABLE_COILS;
    if (length >= 5) {
        if (text[0] > '4')
            return 0;
        into->table = TABLES[text[0] - '0'];
        text++;
    }
    return into->table != 0 && read_rest(text, &into->address);
}

/* Reads an address of Modicon's notation, whose table must be that of `into` if it is known. */
static int read_modicon(yaml_file *file, const char *key, const yaml_node_t *node, const char *text,
                        device_place *into)
{
    device_place found = {0};

    if (!read_letters(text, &found) && !read_digits(text, &found))
        return yaml_file_refuse(file, node, "%s: \"%s\" is no address: " MODICON_HELP, key, text);
    if (into->table != 0 && into->table != found.table)
        return yaml_file_refuse(file, node, "%s: \"%s\" is an address of the table %s, not of %s",
                                key, text, value_table_names[found.table],
                                value_table_names[into->table]);
    into->table = found.table;
    into->address = found.address;
    return 1;
}

/* Reads one address from a text. */
static int read_one(yaml_file *file, const char *key, const yaml_node_t *node, const char *text,
                    const device *of, device_place *into)
{
    const int first = of->notation == DEVICE_ONE_BASED;
    const char *wrong;
    int64_t number;

    if (of->notation == DEVICE_MODICON)
        return read_modicon(file, key, node, text, into);
    if (text[0] == '0' && text[1])
        return yaml_file_refuse(file, node, "%s: \"%s\" begins with 0: write a decimal number", key,
                                text);
    wrong = number_read(text, first, 65535 + first, &number);
    if (wrong)
        return yaml_file_refuse(file, node, "%s: %s", key, wrong);
    into->address = (uint32_t)(number - first);
    return 1;
}

int device_address_read(yaml_file *file, const char *key, const yaml_node_t *node, const device *of,
                        device_place *into)
{
    const char *text = yaml_file_text(file, key, node, LONGEST);

    return text && read_one(file, key, node, text, of, into);
}

int device_address_read_range(yaml_file *file, const char *key, const yaml_node_t *node,
                              const device *of, device_place *into)
{
    const char *text = yaml_file_text(file, key, node, 2 * LONGEST), *dash;
    char first[2 * LONGEST + 1];
    device_place last;

    if (!text)
        return 0;
    dash = strchr(text, '-');
    snprintf(first, sizeof first, "%.*s", dash ? (int)(dash - text) : 2 * LONGEST, text);
    if (!read_one(file, key, node, first, of, into))
        return 0;
    last = *into;
    if (dash && !read_one(file, key, node, dash + 1, of, &last))
        return 0;
    into->last = last.address;
    if (into->last < into->address)
        return yaml_file_refuse(file, node, "%s: \"%s\" ends before it begins", key, text);
    return 1;
}
