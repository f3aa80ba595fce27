#define _GNU_SOURCE
#include "yaml_file.h"

#include "numbers.h"
#include "report.h"

#include <errno.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

enum { MOST_WORD = 100 };

static size_t line_of(const yaml_node_t *node)
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
    vsnprintf(file->wrong + length, sizeof file->wrong - length, format, values);
    return 0;
}

int yaml_file_refuse(yaml_file *file, const yaml_node_t *node, const char *format, ...)
{
    va_list values;

    va_start(values, format);
    (void)refuse_at(file, node ? line_of(node) : 0, format, values);
    va_end(values);
    return 0;
}

__attribute__((format(printf, 3, 4))) static void refuse_line(yaml_file *file, size_t line,
                                                              const char *format, ...)
{
    va_list values;

    va_start(values, format);
    (void)refuse_at(file, line, format, values);
    va_end(values);
}

static void fail(yaml_file *file, int error)
{
    refuse_line(file, 0, "%s", strerror(error));
    file->code = CODE_SYSTEM;
}

static void refuse_syntax(yaml_file *file, const yaml_parser_t *parser, FILE *from)
{
    if (parser->error == YAML_MEMORY_ERROR)
        fail(file, ENOMEM);
    else if (ferror(from))
        fail(file, errno);
    else if (parser->error == YAML_READER_ERROR)
        refuse_line(file, 0, "this is not YAML: %s, at byte %zu", parser->problem,
                    parser->problem_offset);
    else
        refuse_line(file, parser->problem_mark.line + 1, "this is not YAML: %s%s%s",
                    parser->context ? parser->context : "", parser->context ? ", " : "",
                    parser->problem);
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
        return fail(file, errno), NULL;
    if (yaml_parser_initialize(&parser)) {
        yaml_parser_set_input_file(&parser, from);
        read_document(file, &parser, from);
        yaml_parser_delete(&parser);
    } else {
        fail(file, ENOMEM);
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
    yaml_document_delete(&file.document);
    memcpy(wrong, file.wrong, sizeof file.wrong);
    return file.code;
}

const char *yaml_file_text(yaml_file *file, const char *key, const yaml_node_t *node, size_t most)
{
    const unsigned char *at;

    if (node->type != YAML_SCALAR_NODE)
        return yaml_file_refuse(file, node, "%s is a list or a mapping: it must be one word", key),
               NULL;
    if (node->data.scalar.length == 0)
        return yaml_file_refuse(file, node, "%s is empty", key), NULL;
    if (node->data.scalar.length > most)
        return yaml_file_refuse(file, node, "%s has more than %zu bytes", key, most), NULL;
    for (at = node->data.scalar.value; at < node->data.scalar.value + node->data.scalar.length;
         at++)
        if (*at < ' ' || *at == 0x7F)
            return yaml_file_refuse(file, node, "%s has a control character", key), NULL;
    return (const char *)node->data.scalar.value;
}

int yaml_file_number(yaml_file *file, const char *key, const yaml_node_t *node, uint32_t least,
                     uint32_t most, uint32_t *value)
{
    const char *word, *wrong;
    int64_t number;

    if (!node)
        return 1;
    word = yaml_file_text(file, key, node, MOST_WORD);
    if (!word)
        return 0;
    wrong = number_read(word, least, most, &number);
    if (wrong)
        return yaml_file_refuse(file, node, "%s: %s", key, wrong);
    *value = (uint32_t)number;
    return 1;
}

int yaml_file_time(yaml_file *file, const char *key, const yaml_node_t *node, uint32_t least,
                   uint32_t most, uint32_t *value)
{
    const char *word, *wrong;

    if (!node)
        return 1;
    word = yaml_file_text(file, key, node, MOST_WORD);
    if (!word)
        return 0;
    wrong = number_time(word, least, most, value);
    return wrong ? yaml_file_refuse(file, node, "%s: %s", key, wrong) : 1;
}

int yaml_file_keys(yaml_file *file, const char *what, const yaml_node_t *mapping,
                   const char *const *names, yaml_node_t **values)
{
    yaml_node_pair_t *pair;

    if (mapping->type != YAML_MAPPING_NODE)
        return yaml_file_refuse(file, mapping, "%s must be a mapping of keys, such as \"%s:\"",
                                what, names[0]);
    for (pair = mapping->data.mapping.pairs.start; pair < mapping->data.mapping.pairs.top; pair++) {
        const yaml_node_t *key = yaml_document_get_node(&file->document, pair->key);
        const char *word = yaml_file_text(file, "a key", key, MOST_WORD), *wrong;
        int index;

        if (!word)
            return 0;
        wrong = number_word(word, names, &index);
        if (wrong)
            return yaml_file_refuse(file, key, "key: %s", wrong);
        if (values[index])
            return yaml_file_refuse(file, key, "%s is there twice, first in line %zu", names[index],
                                    line_of(values[index]));
        values[index] = yaml_document_get_node(&file->document, pair->value);
    }
    return 1;
}

int yaml_file_list(yaml_file *file, const char *key, const yaml_node_t *node, size_t most,
                   yaml_file_reader read, void *into)
{
    const yaml_node_item_t *item;
    size_t count;

    if (node->type != YAML_SEQUENCE_NODE)
        return yaml_file_refuse(file, node, "%s must be a list: each item begins with \"-\"", key);
    count = (size_t)(node->data.sequence.items.top - node->data.sequence.items.start);
    if (count == 0)
        return yaml_file_refuse(file, node, "%s is empty", key);
    if (count > most)
        return yaml_file_refuse(file, node, "%s has %zu items: %zu are allowed", key, count, most);
    for (item = node->data.sequence.items.start; item < node->data.sequence.items.top; item++)
        if (!read(file, yaml_document_get_node(&file->document, *item), into))
            return 0;
    return 1;
}
