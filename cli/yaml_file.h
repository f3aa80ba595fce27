/* A configuration file in YAML, read strictly: each refusal names the file and its line.
 *
 * Licence: MIT OR Apache-2.0. */
#ifndef YAML_FILE_H
#define YAML_FILE_H

#include <stddef.h>
#include <stdint.h>
#include <yaml.h>

enum { YAML_FILE_WRONG_BYTES = 600 };

typedef struct yaml_file {
    const char *path;
    yaml_document_t document; /* while the file is open */
    int code;                 /* CODE_DONE; CODE_SYSTEM or CODE_WRONG after the first refusal */
    char wrong[YAML_FILE_WRONG_BYTES]; /* a sentence without its full stop: "FILE:12: ..." */
} yaml_file;

/* Reads a part of a file into `into`. Returns 0 after a refusal. */
typedef int (*yaml_file_reader)(yaml_file *file, const yaml_node_t *node, void *into);

/* Reads a file into `into`: `read` gets its root. Returns CODE_DONE; CODE_SYSTEM or CODE_WRONG with
 * what is wrong. */
int yaml_file_read(const char *path, yaml_file_reader read, void *into,
                   char wrong[YAML_FILE_WRONG_BYTES]);

/* Notes what is wrong, if it is the first. `node` says the line; NULL for none. Returns 0. */
int yaml_file_refuse(yaml_file *file, const yaml_node_t *node, const char *format, ...)
    __attribute__((format(printf, 3, 4)));

/* Sorts the values of a mapping by their keys: values[i] is that of names[i], NULL without one. The
 * names end with NULL. Returns 0 after a refusal: `what` names the mapping there. */
int yaml_file_keys(yaml_file *file, const char *what, const yaml_node_t *mapping,
                   const char *const *names, yaml_node_t **values);

/* The text of a node of at most `most` bytes and without control characters, the number or the time
 * in milliseconds that it is. They return NULL or 0 after a refusal; a number of no node stays. */
const char *yaml_file_text(yaml_file *file, const char *key, const yaml_node_t *node, size_t most);
int yaml_file_number(yaml_file *file, const char *key, const yaml_node_t *node, uint32_t least,
                     uint32_t most, uint32_t *value);
int yaml_file_time(yaml_file *file, const char *key, const yaml_node_t *node, uint32_t least,
                   uint32_t most, uint32_t *value);

/* Reads each item of a list of 1 to `most`. Returns 0 after a refusal. */
int yaml_file_list(yaml_file *file, const char *key, const yaml_node_t *node, size_t most,
                   yaml_file_reader read, void *into);

#endif
