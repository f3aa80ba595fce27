/* The contents of a configuration file of another program, from YAML, JSON or TOML: words, lists
 * and maps, each with its line. What is looked up is marked, so that the rest can be named. */
#pragma once

#include "yaml_file.h"

enum { TREE_WORD, TREE_LIST, TREE_MAP };

typedef struct tree {
    int kind;
    char *key;  /* in a map; NULL in a list and at the root */
    char *text; /* of a word */
    int line;
    int is_used; /* tree_find or tree_use has returned it */
    struct tree *first, *last, *next;
} tree;

/* Reads a file. Returns NULL after a failure: `code` is an exit code, and `wrong` a sentence
 * without its full stop. */
tree *tree_read_yaml(const char *path, int *code, char wrong[YAML_FILE_WRONG_BYTES]);
tree *tree_read_toml(const char *path, int *code, char wrong[YAML_FILE_WRONG_BYTES]);
void tree_free(tree *of);

/* Make a node, at the end of its parent if that is not NULL. The texts are copied; a text may be
 * NULL. Returns NULL without memory. */
tree *tree_add(tree *parent, int kind, int line, const char *key, const char *text);

/* Finds a key of a map, or NULL, and marks it as used. tree_peek does not mark it. */
tree *tree_find(tree *map, const char *key);
tree *tree_peek(const tree *map, const char *key);

/* The first item of a list, from which `next` leads to the others; NULL if it is no list. */
tree *tree_items(const tree *list);

/* Whether a key of a map is this word. It is not marked. */
int tree_has(const tree *map, const char *key, const char *word);

/* The text of a key that is a word, or `otherwise`. */
const char *tree_text(tree *map, const char *key, const char *otherwise);

/* The line of a key, or that of its map. */
int tree_line(const tree *map, const char *key);

/* Marks a node and all below it as used. */
void tree_use(tree *of);
