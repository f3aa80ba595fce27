/* Keeps the contents of a file as a tree, and reads it from YAML. */
#include "tree.h"

#include "report.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>

/* An alias may repeat a part of a file again and again. */
enum { MOST_NODES = 200000, MOST_DEPTH = 50 };

tree *tree_add(tree *parent, int kind, int line, const char *key, const char *text)
{
    tree *made = (tree *)calloc(1, sizeof *made);

    if (!made)
        return NULL;
    made->kind = kind;
    made->line = line;
    made->key = key ? strdup(key) : NULL;
    made->text = text ? strdup(text) : NULL;
    if ((key && !made->key) || (text && !made->text)) {
        tree_free(made);
        return NULL;
    }
    if (parent && parent->last)
        parent->last->next = made;
    else if (parent)
        parent->first = made;
    if (parent)
        parent->last = made;
    return made;
}

void tree_free(tree *of)
{
    while (of) {
        tree *next = of->next;

        tree_free(of->first);
        free(of->key);
        free(of->text);
        free(of);
        of = next;
    }
}

tree *tree_peek(const tree *map, const char *key)
{
    tree *at = map && map->kind == TREE_MAP ? map->first : NULL;

    while (at && strcmp(at->key, key) != 0)
        at = at->next;
    return at;
}

tree *tree_find(tree *map, const char *key)
{
    tree *found = tree_peek(map, key);

    if (found)
        found->is_used = 1;
    return found;
}

tree *tree_items(const tree *list)
{
    return list && list->kind == TREE_LIST ? list->first : NULL;
}

int tree_has(const tree *map, const char *key, const char *word)
{
    const tree *found = tree_peek(map, key);

    return found && found->kind == TREE_WORD && strcmp(found->text, word) == 0;
}

int tree_line(const tree *map, const char *key)
{
    const tree *found = tree_peek(map, key);

    return found ? found->line : map->line;
}

const char *tree_text(tree *map, const char *key, const char *otherwise)
{
    const tree *found = tree_find(map, key);

    return found && found->kind == TREE_WORD ? found->text : otherwise;
}

void tree_use(tree *of)
{
    tree *at;

    of->is_used = 1;
    for (at = of->first; at; at = at->next)
        tree_use(at);
}

/* --- YAML, and JSON, which is YAML --- */

typedef struct loader {
    tree *root;
    unsigned nodes;
} loader;

static tree *load(yaml_file *file, loader *into, const yaml_node_t *node, tree *parent,
                  const char *key, int depth);

/* Loads the pairs of a map, of a key that is there twice the first. Those of a merge key, <<, are
 * loaded last, since the map's own keys come first. */
static int load_pairs(yaml_file *file, loader *into, const yaml_node_t *map, tree *made, int depth)
{
    const yaml_node_t *merged = NULL;
    size_t at;

    for (at = 0; at < yaml_file_size(map); at++) {
        const yaml_file_pair pair = yaml_file_pair_at(file, map, at);

        if (pair.key->type != YAML_SCALAR_NODE)
            return yaml_file_refuse(file, pair.key, "a key is no word");
        if (strcmp((const char *)pair.key->data.scalar.value, "<<") == 0)
            merged = pair.value;
        else if (tree_peek(made, (const char *)pair.key->data.scalar.value))
            continue;
        else if (!load(file, into, pair.value, made, (const char *)pair.key->data.scalar.value,
                       depth + 1))
            return 0;
    }
    if (!merged || depth > MOST_DEPTH)
        return 1;
    if (merged->type == YAML_MAPPING_NODE)
        return load_pairs(file, into, merged, made, depth + 1);
    for (at = 0; merged->type == YAML_SEQUENCE_NODE && at < yaml_file_size(merged); at++) {
        const yaml_node_t *one = yaml_file_item(file, merged, at);

        if (one->type == YAML_MAPPING_NODE && !load_pairs(file, into, one, made, depth + 1))
            return 0;
    }
    return 1;
}

static tree *load(yaml_file *file, loader *into, const yaml_node_t *node, tree *parent,
                  const char *key, int depth)
{
    const int kind = node->type == YAML_SEQUENCE_NODE  ? TREE_LIST
                     : node->type == YAML_MAPPING_NODE ? TREE_MAP
                                                       : TREE_WORD;
    tree *made;
    size_t at;

    if (++into->nodes > MOST_NODES || depth > MOST_DEPTH)
        return (void)yaml_file_refuse(file, node, "the file has too many parts"), NULL;
    made = tree_add(parent, kind, (int)yaml_file_line(node), key,
                    kind == TREE_WORD ? (const char *)node->data.scalar.value : NULL);
    if (!made)
        return (void)yaml_file_fail(file, ENOMEM), NULL;
    if (!parent)
        into->root = made;
    if (kind == TREE_MAP && !load_pairs(file, into, node, made, depth))
        return NULL;
    for (at = 0; kind == TREE_LIST && at < yaml_file_size(node); at++)
        if (!load(file, into, yaml_file_item(file, node, at), made, NULL, depth + 1))
            return NULL;
    return made;
}

static int load_root(yaml_file *file, const yaml_node_t *root, void *into)
{
    return load(file, (loader *)into, root, NULL, NULL, 0) != NULL;
}

tree *tree_read_yaml(const char *path, int *code, char wrong[YAML_FILE_WRONG_BYTES])
{
    loader into = {0};

    *code = yaml_file_read(path, load_root, &into, wrong);
    if (*code == CODE_DONE)
        return into.root;
    tree_free(into.root);
    return NULL;
}
