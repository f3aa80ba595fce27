/* Reads TOML as far as configuration files need it: tables and arrays of tables, dotted and quoted
 * keys, strings of all four kinds, arrays, inline tables, and every other value as a word. */
#include "report.h"
#include "tree.h"

#include <ctype.h>
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { MOST_BYTES = 4000000, MOST_DEPTH = 50, KEY_BYTES = 256 };

typedef struct toml {
    const char *path, *at;
    int line;
    char *wrong;
    tree *root;
    char *text; /* the last string or word, in memory of the size of the file */
} toml;

/* Notes what is wrong, if it is the first. Returns 0. */
static int refuse(toml *t, const char *what)
{
    if (!*t->wrong)
        snprintf(t->wrong, YAML_FILE_WRONG_BYTES, "%s:%d: this is not TOML: %s", t->path, t->line,
                 what);
    return 0;
}

/* Passes over spaces; with `lines` also over ends of lines and comments. */
static void skip(toml *t, int lines)
{
    for (;; t->at++) {
        if (*t->at == '\n' && lines)
            t->line++;
        else if (*t->at == '#' && lines)
            while (t->at[1] && t->at[1] != '\n')
                t->at++;
        else if (*t->at != ' ' && *t->at != '\t' && *t->at != '\r')
            return;
    }
}

/* --- strings --- */

/* Writes a character as UTF-8. Returns its length. */
static size_t write_utf8(uint32_t character, char *to)
{
    if (character < 0x80) {
        to[0] = (char)character;
        return 1;
    }
    if (character < 0x800) {
        to[0] = (char)(0xC0 | character >> 6);
        to[1] = (char)(0x80 | (character & 0x3F));
        return 2;
    }
    if (character < 0x10000) {
        to[0] = (char)(0xE0 | character >> 12);
        to[1] = (char)(0x80 | (character >> 6 & 0x3F));
        to[2] = (char)(0x80 | (character & 0x3F));
        return 3;
    }
    to[0] = (char)(0xF0 | (character >> 18 & 7));
    to[1] = (char)(0x80 | (character >> 12 & 0x3F));
    to[2] = (char)(0x80 | (character >> 6 & 0x3F));
    to[3] = (char)(0x80 | (character & 0x3F));
    return 4;
}

/* Reads what follows a backslash. Returns how many bytes it writes, 0 after a refusal; `is_none` is
 * set if it stands for nothing: a backslash at the end of a line. */
static size_t read_escape(toml *t, char *to, int *is_none)
{
    static const char NAMES[] = "btnfre\"\\", CODES[] = "\b\t\n\f\r\033\"\\";
    const char *found = *t->at ? strchr(NAMES, *t->at) : NULL;
    uint32_t character = 0;
    int digits;

    if (found) {
        *to = CODES[found - NAMES];
        t->at++;
        return 1;
    }
    if (*t->at == 'u' || *t->at == 'U') {
        digits = *t->at++ == 'u' ? 4 : 8;
        for (; digits > 0 && isxdigit((unsigned char)*t->at); digits--, t->at++)
            character =
                character << 4 | (uint32_t)(isdigit((unsigned char)*t->at)
                                                ? *t->at - '0'
                                                : tolower((unsigned char)*t->at) - 'a' + 10);
        if (digits == 0 && character > 0 && character < 0x110000)
            return write_utf8(character, to);
    } else if (*t->at == '\n' || *t->at == '\r' || *t->at == ' ') {
        skip(t, 1);
        *is_none = 1;
        return 0;
    }
    (void)refuse(t, "an unknown escape");
    return 0;
}

/* Reads a string into `text`. */
static int read_string(toml *t)
{
    const char quote = *t->at;
    const int is_long = t->at[1] == quote && t->at[2] == quote;
    size_t length = 0, wrote;
    int is_none;

    t->at += is_long ? 3 : 1;
    if (is_long && *t->at == '\n') {
        t->line++;
        t->at++;
    }
    for (;;) {
        if (!*t->at || (*t->at == '\n' && !is_long))
            return refuse(t, "a string has no end");
        if (*t->at == quote && (!is_long || (t->at[1] == quote && t->at[2] == quote)))
            break;
        if (*t->at == '\\' && quote == '"') {
            t->at++;
            is_none = 0;
            wrote = read_escape(t, t->text + length, &is_none);
            if (wrote == 0 && !is_none)
                return 0;
            length += wrote;
            continue;
        }
        t->line += *t->at == '\n';
        t->text[length++] = *t->at++;
    }
    t->at += is_long ? 3 : 1;
    t->text[length] = '\0';
    return 1;
}

/* --- keys --- */

/* Reads one part of a key. */
static int read_key(toml *t, char key[KEY_BYTES])
{
    size_t length = 0;

    skip(t, 0);
    if (*t->at == '"' || *t->at == '\'') {
        if (!read_string(t))
            return 0;
        if (strlen(t->text) >= KEY_BYTES)
            return refuse(t, "a key is too long");
        strcpy(key, t->text);
    } else {
        while (isalnum((unsigned char)*t->at) || *t->at == '_' || *t->at == '-') {
            if (length + 1 == KEY_BYTES)
                return refuse(t, "a key is too long");
            key[length++] = *t->at++;
        }
        key[length] = '\0';
        if (length == 0)
            return refuse(t, "a key is missing");
    }
    skip(t, 0);
    return 1;
}

/* Returns the map at a key of a map, which is made if it is not there; of an array of tables its
 * last one. NULL after a refusal. */
static tree *enter(toml *t, tree *map, const char *key)
{
    tree *found = tree_peek(map, key);

    if (!found)
        found = tree_add(map, TREE_MAP, t->line, key, NULL);
    else if (found->kind == TREE_LIST)
        found = found->last;
    if (found && found->kind == TREE_MAP)
        return found;
    (void)refuse(t, found ? "a key is a value and a table" : REPORT_NO_MEMORY);
    return NULL;
}

/* Reads a key with dots, up to its last part. Returns the map in which that is, or NULL. */
static tree *read_path(toml *t, tree *map, char key[KEY_BYTES])
{
    if (!read_key(t, key))
        return NULL;
    while (map && *t->at == '.') {
        t->at++;
        map = enter(t, map, key);
        if (map && !read_key(t, key))
            return NULL;
    }
    return map;
}

/* --- values --- */

static int read_pair(toml *t, tree *map, int depth);

/* Reads a value as a key of a map, or as an item of a list if the key is NULL. */
static int read_value(toml *t, tree *parent, const char *key, int depth)
{
    const char first = *t->at;
    tree *made;
    size_t length;

    if (depth > MOST_DEPTH)
        return refuse(t, "values are nested too deeply");
    if (first == '[' || first == '{') {
        const char last = first == '[' ? ']' : '}';

        made = tree_add(parent, first == '[' ? TREE_LIST : TREE_MAP, t->line, key, NULL);
        t->at++;
        for (;;) {
            skip(t, 1);
            if (*t->at == last)
                break;
            if (!made ||
                !(first == '[' ? read_value(t, made, NULL, depth + 1) : read_pair(t, made, depth)))
                return refuse(t, REPORT_NO_MEMORY);
            skip(t, 1);
            if (*t->at == ',')
                t->at++;
            else if (*t->at != last)
                return refuse(t, "a comma or the end of a list is missing");
        }
        t->at++;
        return made ? 1 : refuse(t, REPORT_NO_MEMORY);
    }
    if (first == '"' || first == '\'') {
        const int line = t->line;

        return read_string(t) &&
               (tree_add(parent, TREE_WORD, line, key, t->text) || refuse(t, REPORT_NO_MEMORY));
    }
    length = strcspn(t->at, ",]}# \t\r\n");
    if (length == 0)
        return refuse(t, "a value is missing");
    memcpy(t->text, t->at, length);
    t->text[length] = '\0';
    t->at += length;
    return tree_add(parent, TREE_WORD, t->line, key, t->text) || refuse(t, REPORT_NO_MEMORY);
}

static int read_pair(toml *t, tree *map, int depth)
{
    char key[KEY_BYTES];
    tree *in = read_path(t, map, key);

    if (!in)
        return 0;
    if (*t->at != '=')
        return refuse(t, "= is missing after a key");
    if (tree_peek(in, key))
        return refuse(t, "a key is there twice");
    t->at++;
    skip(t, 0);
    return read_value(t, in, key, depth + 1);
}

/* Reads [a.b] or [[a.b]]. Returns the map to which the next pairs belong, or NULL. */
static tree *read_table(toml *t)
{
    const int is_list = t->at[1] == '[';
    char key[KEY_BYTES];
    tree *in, *list;

    t->at += is_list ? 2 : 1;
    in = read_path(t, t->root, key);
    if (!in)
        return NULL;
    if (*t->at != ']' || (is_list && t->at[1] != ']'))
        return (void)refuse(t, "] is missing"), NULL;
    t->at += is_list ? 2 : 1;
    if (!is_list)
        return enter(t, in, key);
    list = tree_peek(in, key);
    if (!list)
        list = tree_add(in, TREE_LIST, t->line, key, NULL);
    else if (list->kind != TREE_LIST)
        return (void)refuse(t, "a key is a value and a table"), NULL;
    in = list ? tree_add(list, TREE_MAP, t->line, NULL, NULL) : NULL;
    if (!in)
        (void)refuse(t, REPORT_NO_MEMORY);
    return in;
}

static int read_all(toml *t)
{
    tree *map = t->root;

    for (;;) {
        skip(t, 1);
        if (!*t->at)
            return 1;
        if (*t->at == '[') {
            map = read_table(t);
            if (!map)
                return 0;
        } else if (!read_pair(t, map, 0)) {
            return 0;
        }
        skip(t, 0);
        if (*t->at && *t->at != '\n' && *t->at != '#')
            return refuse(t, "a line goes on after its value");
    }
}

/* Reads a file into memory. Returns NULL with errno set. */
static char *read_file(const char *path)
{
    FILE *from = fopen(path, "rb");
    char *text = from ? (char *)malloc(MOST_BYTES + 1) : NULL;
    size_t length = text ? fread(text, 1, MOST_BYTES, from) : 0;
    int error = errno;

    if (text)
        text[length] = '\0';
    if (from && ferror(from)) {
        free(text);
        text = NULL;
    }
    if (from)
        (void)fclose(from);
    errno = error;
    return text;
}

tree *tree_read_toml(const char *path, int *code, char wrong[YAML_FILE_WRONG_BYTES])
{
    char *text = read_file(path);
    toml t = {.path = path, .at = text, .line = 1, .wrong = wrong};

    *wrong = '\0';
    *code = CODE_SYSTEM;
    if (!text) {
        snprintf(wrong, YAML_FILE_WRONG_BYTES, "%s: %s", path, strerror(errno));
        return NULL;
    }
    t.root = tree_add(NULL, TREE_MAP, 1, NULL, NULL);
    t.text = (char *)malloc(strlen(text) + 1);
    if (!t.root || !t.text) {
        snprintf(wrong, YAML_FILE_WRONG_BYTES, REPORT_NO_MEMORY);
    } else {
        *code = read_all(&t) ? CODE_DONE : CODE_WRONG;
    }
    if (*code != CODE_DONE) {
        tree_free(t.root);
        t.root = NULL;
    }
    free(t.text);
    free(text);
    return t.root;
}
