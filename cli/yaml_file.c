/* Parses a YAML file with libyaml, and checks its keys and values. */
#include "yaml_file.h"

#include "numbers.h"
#include "report.h"

#include <errno.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { MOST_WORD = 100 };

/* A word that is not in the file as it is read. */
struct yaml_file_word {
    struct yaml_file_word *next;
    char text[];
};

size_t yaml_file_line(const yaml_node_t *node)
{
    return node->start_mark.line + 1;
}

__attribute__((format(printf, 3, 0))) static int refuse_at(yaml_file *file, size_t line,
                                                           const char *format, va_list values)
{
    size_t length;

    if (file->code != CODE_DONE)
        return 0;
    file->code = CODE_WRONG;
    if (line > 0)
        snprintf(file->wrong, sizeof file->wrong, "%s:%zu: ", file->path, line);
    else
        snprintf(file->wrong, sizeof file->wrong, "%s: ", file->path);
    length = strlen(file->wrong);
    if (*file->number)
        length += (size_t)snprintf(file->wrong + length, sizeof file->wrong - length,
                                   "repetition %s: ", file->number);
    vsnprintf(file->wrong + length, sizeof file->wrong - length, format, values);
    return 0;
}

int yaml_file_refuse(yaml_file *file, const yaml_node_t *node, const char *format, ...)
{
    va_list values;

    va_start(values, format);
    (void)refuse_at(file, node ? yaml_file_line(node) : 0, format, values);
    va_end(values);
    return 0;
}

int yaml_file_refuse_line(yaml_file *file, int line, const char *format, ...)
{
    va_list values;

    va_start(values, format);
    (void)refuse_at(file, (size_t)line, format, values);
    va_end(values);
    return 0;
}

int yaml_file_fail(yaml_file *file, int error)
{
    if (file->code != CODE_DONE)
        return 0;
    (void)yaml_file_refuse_line(file, 0, "%s", strerror(error));
    file->code = CODE_SYSTEM;
    return 0;
}

static void refuse_syntax(yaml_file *file, const yaml_parser_t *parser, FILE *from)
{
    if (parser->error == YAML_MEMORY_ERROR)
        (void)yaml_file_fail(file, ENOMEM);
    else if (ferror(from))
        (void)yaml_file_fail(file, errno);
    else if (parser->error == YAML_READER_ERROR)
        (void)yaml_file_refuse_line(file, 0, "this is not YAML: %s, at byte %zu", parser->problem,
                                    parser->problem_offset);
    else
        (void)yaml_file_refuse_line(
            file, (int)parser->problem_mark.line + 1, "this is not YAML: %s%s%s",
            parser->context ? parser->context : "", parser->context ? ", " : "", parser->problem);
}

/* Reads the document, after which no other may follow. */
static void read_document(yaml_file *file, yaml_parser_t *parser, FILE *from)
{
    yaml_document_t second;
    const yaml_node_t *root;

    if (!yaml_parser_load(parser, &file->document)) {
        memset(&file->document, 0, sizeof file->document);
        refuse_syntax(file, parser, from);
        return;
    }
    if (!yaml_parser_load(parser, &second)) {
        refuse_syntax(file, parser, from);
        return;
    }
    root = yaml_document_get_root_node(&second);
    if (root)
        (void)yaml_file_refuse(file, root, "a second document begins: the file has one");
    yaml_document_delete(&second);
}

/* Reads a file. Returns its root, or NULL after a refusal. */
static yaml_node_t *open_file(yaml_file *file, const char *path)
{
    yaml_parser_t parser;
    yaml_node_t *root;
    FILE *from;

    memset(file, 0, sizeof *file);
    file->path = path;
    from = fopen(path, "rb");
    if (!from)
        return yaml_file_fail(file, errno), NULL;
    if (yaml_parser_initialize(&parser)) {
        yaml_parser_set_input_file(&parser, from);
        read_document(file, &parser, from);
        yaml_parser_delete(&parser);
    } else {
        (void)yaml_file_fail(file, ENOMEM);
    }
    (void)fclose(from);
    root = file->code == CODE_DONE ? yaml_document_get_root_node(&file->document) : NULL;
    if (file->code == CODE_DONE && !root)
        (void)yaml_file_refuse(file, NULL, "the file is empty");
    return root;
}

int yaml_file_read(const char *path, yaml_file_reader read, void *into,
                   char wrong[YAML_FILE_WRONG_BYTES])
{
    static yaml_file file;
    const yaml_node_t *root = open_file(&file, path);

    if (root)
        (void)read(&file, root, into);
    while (file.made) {
        struct yaml_file_word *word = file.made;

        file.made = word->next;
        free(word);
    }
    yaml_document_delete(&file.document);
    memcpy(wrong, file.wrong, sizeof file.wrong);
    return file.code;
}

/* Puts the number of the repetition in its places. Returns NULL after a refusal. */
static const char *put_number(yaml_file *file, const char *key, const yaml_node_t *node,
                              const char *text, size_t most)
{
    const size_t mark = sizeof YAML_FILE_NUMBER - 1, length = strlen(file->number);
    struct yaml_file_word *word;
    size_t marks = 0;
    const char *at;
    char *to;

    for (at = text; (at = strstr(at, YAML_FILE_NUMBER)) != NULL; at += mark)
        marks++;
    word = (struct yaml_file_word *)malloc(sizeof *word + strlen(text) + marks * length + 1);
    if (!word)
        return yaml_file_fail(file, ENOMEM), NULL;
    word->next = file->made;
    file->made = word;
    for (to = word->text; (at = strstr(text, YAML_FILE_NUMBER)) != NULL; text = at + mark)
        to += sprintf(to, "%.*s%s", (int)(at - text), text, file->number);
    strcpy(to, text);
    if (strlen(word->text) > most)
        return yaml_file_refuse(file, node, "%s has more than %zu bytes with its number", key,
                                most),
               NULL;
    return word->text;
}

const char *yaml_file_text(yaml_file *file, const char *key, const yaml_node_t *node, size_t most)
{
    const unsigned char *at;

    if (node->type != YAML_SCALAR_NODE)
        return yaml_file_refuse(file, node, "%s is a %s: it must be one word", key,
                                node->type == YAML_SEQUENCE_NODE ? "list" : "mapping"),
               NULL;
    if (node->data.scalar.length == 0)
        return yaml_file_refuse(file, node, "%s is empty", key), NULL;
    if (node->data.scalar.length > most)
        return yaml_file_refuse(file, node, "%s has more than %zu bytes", key, most), NULL;
    for (at = node->data.scalar.value; at < node->data.scalar.value + node->data.scalar.length;
         at++)
        if (*at < ' ' || *at == 0x7F || (*at == 0xC2 && at[1] < 0xA0))
            return yaml_file_refuse(file, node, "%s has a control character", key), NULL;
    if (*file->number && strstr((const char *)node->data.scalar.value, YAML_FILE_NUMBER))
        return put_number(file, key, node, (const char *)node->data.scalar.value, most);
    return (const char *)node->data.scalar.value;
}

int yaml_file_copy(yaml_file *file, const char *key, const yaml_node_t *node, size_t most,
                   char **copy)
{
    const char *text;

    if (!node)
        return 1;
    text = yaml_file_text(file, key, node, most);
    if (!text)
        return 0;
    *copy = strdup(text);
    return *copy ? 1 : yaml_file_fail(file, ENOMEM);
}

/* Refuses a value if `wrong` says what is wrong with it. Returns 0 then. */
static int check_value(yaml_file *file, const char *key, const yaml_node_t *node, const char *wrong)
{
    return wrong ? yaml_file_refuse(file, node, "%s: %s", key, wrong) : 1;
}

int yaml_file_word(yaml_file *file, const char *key, const yaml_node_t *node,
                   const char *const *words, int *index)
{
    const char *text;

    if (!node)
        return 1;
    text = yaml_file_text(file, key, node, MOST_WORD);
    return text && check_value(file, key, node, number_word(text, words, index));
}

int yaml_file_kind(yaml_file *file, const char *key, const yaml_node_t *node,
                   const char *const *words, uint8_t *kind)
{
    int index = *kind - 1;

    if (!yaml_file_word(file, key, node, words, &index))
        return 0;
    *kind = (uint8_t)(index + 1);
    return 1;
}

int yaml_file_answer(yaml_file *file, const char *key, const yaml_node_t *node, uint8_t *is_yes)
{
    const char *text;

    if (!node)
        return 1;
    text = yaml_file_text(file, key, node, MOST_WORD);
    return text && check_value(file, key, node, number_answer(text, is_yes));
}

const char *yaml_file_decimal(yaml_file *file, const char *key, const yaml_node_t *node)
{
    const char *text = yaml_file_text(file, key, node, MOST_WORD);

    /* Other programs read such a number as octal. */
    if (text && ((text[0] == '0' && text[1]) || (text[0] == '-' && text[1] == '0')))
        return yaml_file_refuse(file, node, "%s: \"%s\" begins with 0: write a decimal number", key,
                                text),
               NULL;
    return text;
}

int yaml_file_number(yaml_file *file, const char *key, const yaml_node_t *node, uint32_t least,
                     uint32_t most, uint32_t *value)
{
    const char *text;
    int64_t number;

    if (!node)
        return 1;
    text = yaml_file_decimal(file, key, node);
    if (!text || !check_value(file, key, node, number_read(text, least, most, &number)))
        return 0;
    *value = (uint32_t)number;
    return 1;
}

int yaml_file_time(yaml_file *file, const char *key, const yaml_node_t *node, uint32_t least,
                   uint32_t most, uint32_t *value)
{
    const char *text;

    if (!node)
        return 1;
    text = yaml_file_text(file, key, node, MOST_WORD);
    return text && check_value(file, key, node, number_time(text, least, most, value));
}

size_t yaml_file_size(const yaml_node_t *node)
{
    switch (node->type) {
    case YAML_SEQUENCE_NODE:
        return (size_t)(node->data.sequence.items.top - node->data.sequence.items.start);
    case YAML_MAPPING_NODE:
        return (size_t)(node->data.mapping.pairs.top - node->data.mapping.pairs.start);
    default: return 0;
    }
}

/* The size of a list or a mapping, which must be 1 to `most`. Returns 0 after a refusal. */
static size_t check_size(yaml_file *file, const char *key, const yaml_node_t *node, size_t most)
{
    const size_t size = yaml_file_size(node);

    if (size == 0)
        (void)yaml_file_refuse(file, node, "%s is empty", key);
    if (size > most)
        (void)yaml_file_refuse(file, node, "%s has %zu items: %zu are allowed", key, size, most);
    return size <= most ? size : 0;
}

size_t yaml_file_items(yaml_file *file, const char *key, const yaml_node_t *node, size_t most)
{
    if (node->type == YAML_SEQUENCE_NODE)
        return check_size(file, key, node, most);
    (void)yaml_file_refuse(file, node, "%s must be a list: each item begins with \"-\"", key);
    return 0;
}

size_t yaml_file_pairs(yaml_file *file, const char *key, const yaml_node_t *node, size_t most,
                       const char *of)
{
    if (node->type == YAML_MAPPING_NODE)
        return check_size(file, key, node, most);
    (void)yaml_file_refuse(file, node, "%s must be a mapping of %s", key, of);
    return 0;
}

const yaml_node_t *yaml_file_item(yaml_file *file, const yaml_node_t *list, size_t at)
{
    return yaml_document_get_node(&file->document, list->data.sequence.items.start[at]);
}

yaml_file_pair yaml_file_pair_at(yaml_file *file, const yaml_node_t *mapping, size_t at)
{
    const yaml_node_pair_t *pair = &mapping->data.mapping.pairs.start[at];

    return (yaml_file_pair){yaml_document_get_node(&file->document, pair->key),
                            yaml_document_get_node(&file->document, pair->value)};
}

int yaml_file_keys(yaml_file *file, const char *what, const yaml_node_t *mapping,
                   const char *const *names, uint32_t needed, const yaml_node_t **values)
{
    size_t at;
    int index = 0;

    if (mapping->type != YAML_MAPPING_NODE)
        return yaml_file_refuse(file, mapping, "%s must be a mapping of keys, such as \"%s:\"",
                                what, names[0]);
    for (at = 0; at < yaml_file_size(mapping); at++) {
        const yaml_file_pair pair = yaml_file_pair_at(file, mapping, at);

        if (!yaml_file_word(file, "key", pair.key, names, &index))
            return 0;
        if (values[index])
            return yaml_file_refuse(file, pair.key, "%s is there twice, first in line %zu",
                                    names[index], yaml_file_line(values[index]));
        values[index] = pair.value;
    }
    for (index = 0; names[index]; index++)
        if (index < 32 && (needed >> index & 1) && !values[index])
            return yaml_file_refuse(file, mapping, "%s has no key %s", what, names[index]);
    return 1;
}
