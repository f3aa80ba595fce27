/* A configuration file in YAML, read strictly: each refusal names the file and its line. */
#pragma once

#include <stddef.h>
#include <stdint.h>
#include <yaml.h>

enum { YAML_FILE_WRONG_BYTES = 1000, YAML_FILE_NUMBER_BYTES = 12 };

/* Stands for the number of a repetition in its words. */
#define YAML_FILE_NUMBER "{n}"

typedef struct yaml_file {
    const char *path;
    yaml_document_t document; /* while the file is open */
    int code;                 /* CODE_DONE; CODE_SYSTEM or CODE_WRONG after the first refusal */
    char wrong[YAML_FILE_WRONG_BYTES];   /* a sentence without its full stop: "FILE:12: ..." */
    char number[YAML_FILE_NUMBER_BYTES]; /* of the repetition that is read; empty in none */
    struct yaml_file_word *made;         /* words in which that number stands */
} yaml_file;

/* Reads the root of a file into `into`. Returns 0 after a refusal. */
typedef int (*yaml_file_reader)(yaml_file *file, const yaml_node_t *node, void *into);

/* Reads a file into `into`: `read` gets its root. Returns CODE_DONE; CODE_SYSTEM or CODE_WRONG with
 * what is wrong. */
int yaml_file_read(const char *path, yaml_file_reader read, void *into,
                   char wrong[YAML_FILE_WRONG_BYTES]);

/* The line of the file in which a node begins, from 1 on. */
size_t yaml_file_line(const yaml_node_t *node);

/* Notes what is wrong, if it is the first. `node` says the line; NULL for none. Returns 0. */
int yaml_file_refuse(yaml_file *file, const yaml_node_t *node, const char *format, ...)
    __attribute__((format(printf, 3, 4)));

/* The same with the number of a line; 0 for none. */
int yaml_file_refuse_line(yaml_file *file, int line, const char *format, ...)
    __attribute__((format(printf, 3, 4)));

/* Notes a failure of the system, an errno, if it is the first. Returns 0. */
int yaml_file_fail(yaml_file *file, int error);

/* Sorts the values of a mapping by their keys: values[i] is that of names[i], NULL without one. The
 * names end with NULL. If bit i of `needed` is set, the key names[i] must be there: one of the
 * first 32. Returns 0 after a refusal: `what` names the mapping there, such as "the line". */
int yaml_file_keys(yaml_file *file, const char *what, const yaml_node_t *mapping,
                   const char *const *names, uint32_t needed, const yaml_node_t **values);

/* --- one word --- */

/* The text of a node, which has at most `most` bytes and no control characters. In a repetition its
 * number stands in place of each YAML_FILE_NUMBER. Returns NULL after a refusal. */
const char *yaml_file_text(yaml_file *file, const char *key, const yaml_node_t *node, size_t most);

/* The same of a number, which must not begin with 0. */
const char *yaml_file_decimal(yaml_file *file, const char *key, const yaml_node_t *node);

/* Read a copy of the text, for free(); the place of the word in a list that NULL ends, from 0 on;
 * the same from 1 on; yes or no; the number; the time in milliseconds. If the node is NULL, the
 * value stays. They return 0 after a refusal. */
int yaml_file_copy(yaml_file *file, const char *key, const yaml_node_t *node, size_t most,
                   char **copy);
int yaml_file_word(yaml_file *file, const char *key, const yaml_node_t *node,
                   const char *const *words, int *index);
int yaml_file_kind(yaml_file *file, const char *key, const yaml_node_t *node,
                   const char *const *words, uint8_t *kind);
int yaml_file_answer(yaml_file *file, const char *key, const yaml_node_t *node, uint8_t *is_yes);
int yaml_file_number(yaml_file *file, const char *key, const yaml_node_t *node, uint32_t least,
                     uint32_t most, uint32_t *value);
int yaml_file_time(yaml_file *file, const char *key, const yaml_node_t *node, uint32_t least,
                   uint32_t most, uint32_t *value);

/* --- lists and mappings --- */

/* How many items a list or pairs a mapping has; 0 of a word. */
size_t yaml_file_size(const yaml_node_t *node);

/* The size of a node that must be a list, or a mapping with keys that the user chooses, of 1 to
 * `most`. `of` says what a mapping consists of, such as "numbers to names". Return 0 after a
 * refusal. */
size_t yaml_file_items(yaml_file *file, const char *key, const yaml_node_t *node, size_t most);
size_t yaml_file_pairs(yaml_file *file, const char *key, const yaml_node_t *node, size_t most,
                       const char *of);

/* An item of a list, or a pair of a mapping. `at` is less than its size. */
typedef struct yaml_file_pair {
    const yaml_node_t *key, *value;
} yaml_file_pair;
const yaml_node_t *yaml_file_item(yaml_file *file, const yaml_node_t *list, size_t at);
yaml_file_pair yaml_file_pair_at(yaml_file *file, const yaml_node_t *mapping, size_t at);
