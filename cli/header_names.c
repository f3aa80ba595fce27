#define _GNU_SOURCE
#include "header.h"

#include "report.h"

#include <ctype.h>
#include <search.h>
#include <stdlib.h>
#include <string.h>

static int is_plain(char one)
{
    return (unsigned char)one < 0x80 && isalnum((unsigned char)one);
}

char *header_upper(const char *text)
{
    char *upper = (char *)malloc(strlen(text) + 1);
    size_t length = 0;

    if (!upper)
        return NULL;
    for (; *text; text++) {
        if (is_plain(*text))
            upper[length++] = (char)toupper((unsigned char)*text);
        else if (length > 0 && upper[length - 1] != '_')
            upper[length++] = '_';
    }
    if (length > 0 && upper[length - 1] == '_')
        length--;
    upper[length] = '\0';
    return upper;
}

char *header_lower(const char *upper)
{
    char *lower = strdup(upper), *at;

    for (at = lower; at && *at; at++)
        *at = (char)tolower((unsigned char)*at);
    return lower;
}

static int fail(void)
{
    (void)report(CODE_SYSTEM, "there is no memory");
    return 0;
}

/* A name that the header defines, and the line of the file that it comes from; 0 for one that each
 * header has. */
typedef struct c_name {
    char *text;
    int line;
} c_name;

static int compare(const void *one, const void *other)
{
    return strcmp(((const c_name *)one)->text, ((const c_name *)other)->text);
}

static void free_name(void *name)
{
    free(((c_name *)name)->text);
    free(name);
}

/* Stores a name. Returns 0 after reporting that it is there already. */
static int store(header *h, char *text, int line)
{
    c_name *name = (c_name *)malloc(sizeof *name), *other;
    void *place;

    if (!name) {
        free(text);
        return fail();
    }
    name->text = text;
    name->line = line;
    place = tsearch(name, &h->names, compare);
    other = place ? *(c_name **)place : NULL;
    if (other == name)
        return 1;
    if (!other)
        (void)fail();
    else if (other->line == 0)
        (void)report(CODE_WRONG, "%s:%d: the C name %s is one that each header has: choose another",
                     h->path, line, text);
    else
        (void)report(
            CODE_WRONG,
            "%s:%d: the C name %s is that of line %d too: choose another. Case, spaces and "
            "signs make no difference",
            h->path, line > other->line ? line : other->line, text,
            line > other->line ? other->line : line);
    free_name(name);
    return 0;
}

void header_free_names(header *h)
{
    uint16_t i;

    tdestroy(h->names, free_name);
    for (i = 0; h->fields && i < h->of->count; i++)
        free(h->fields[i]);
    free(h->fields);
    free(h->upper);
    free(h->lower);
}

int header_define(header *h, uint16_t field, const char *suffix, int line)
{
    char *text;

    if (asprintf(&text, "%s_%s%s", h->upper, h->fields[field], suffix) < 0)
        return fail();
    return store(h, text, line);
}

/* Chooses the name of the device: the one that is given, else that of the file without its end. */
static int choose_device(header *h, const char *name)
{
    char *base = NULL, *end;

    if (!name && !h->of->name) {
        base = strdup(h->file);
        end = base ? strrchr(base, '.') : NULL;
        if (!base)
            return fail();
        if (end && end > base)
            *end = '\0';
    }
    name = name ? name : base ? base : h->of->name;
    h->upper = header_upper(name);
    h->lower = h->upper ? header_lower(h->upper) : NULL;
    if (!h->lower) {
        free(base);
        return fail();
    }
    if (!isalpha((unsigned char)h->upper[0]) || strcmp(h->upper, "MBM") == 0) {
        (void)report(CODE_WRONG,
                     "%s: \"%s\" cannot be the device's name in C, which begins with one of the "
                     "letters A to Z and is not MBM: give one with --name",
                     h->path, name);
        free(base);
        return 0;
    }
    free(base);
    return 1;
}

int header_choose_names(header *h, const char *name)
{
    static const char *const OWN[] = {"H",     "PLAN",       "SERVER", "FIELDS",
                                      "READS", "DATA_WORDS", "UNIT"};
    uint16_t i;

    h->fields = (char **)calloc(h->of->count, sizeof *h->fields);
    if (!h->fields)
        return fail();
    if (!choose_device(h, name))
        return 0;
    for (i = 0; i < sizeof OWN / sizeof OWN[0]; i++) {
        char *text;

        if (asprintf(&text, "%s_%s", h->upper, OWN[i]) < 0)
            return fail();
        if (!store(h, text, 0))
            return 0;
    }
    for (i = 0; i < h->of->count; i++) {
        const device_field *field = &h->of->fields[i];

        h->fields[i] = header_upper(field->name);
        if (!h->fields[i])
            return fail();
        if (h->fields[i][0] == '\0') {
            (void)report(CODE_WRONG,
                         "%s:%d: the name \"%s\" has none of the letters A to Z and digits, of "
                         "which names in C are made",
                         h->path, field->line, field->name);
            return 0;
        }
        if (!header_define(h, i, "", field->line))
            return 0;
    }
    return 1;
}
