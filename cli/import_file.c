/* Collects the keys and fields of an import, leaves out what a device file cannot have, and writes
 * the rest. */
#include "import.h"

#include "device.h"
#include "names.h"
#include "numbers.h"
#include "report.h"

#include <errno.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <unistd.h>

/* --- what is lost --- */

void import_lose(import *j, int line, const char *what, const char *why, ...)
{
    va_list values;
    char text[400];

    va_start(values, why);
    vsnprintf(text, sizeof text, why, values);
    va_end(values);
    j->lost++;
    if (line > 0)
        fprintf(stderr, "%s: %s:%d: %s: %s.\n", report_name, j->path, line, what, text);
    else
        fprintf(stderr, "%s: %s: %s: %s.\n", report_name, j->path, what, text);
}

void import_lose_rest(import *j, const tree *map, const char *of)
{
    const tree *at;

    for (at = map->first; at; at = at->next)
        if (!at->is_used)
            import_lose(j, at->line, of, "%s is not taken over", at->key ? at->key : "an item");
}

/* --- texts --- */

const char *import_quote(const char *text)
{
    static char buffers[4][3 * DEVICE_NAME_BYTES + 600];
    /* What readers of YAML take for something else. */
    static const char *const WORDS[] = {"y",     "yes", "n",   "no",   "true",
                                        "false", "on",  "off", "null", ".nan"};
    static unsigned next;
    size_t i;
    char *quoted = buffers[next++ % 4], *to = quoted;
    const char *at;

    int is_plain = (*text >= 'a' && *text <= 'z') || (*text >= 'A' && *text <= 'Z');

    for (at = text; *at; at++)
        is_plain &= !strchr("\"\\:#{}[],&*!|>'%@`", *at) && (unsigned char)*at >= ' ';
    for (i = 0; i < sizeof WORDS / sizeof WORDS[0]; i++)
        is_plain &= strcasecmp(text, WORDS[i]) != 0;
    is_plain = is_plain && text[strlen(text) - 1] != ' ';
    if (is_plain)
        return strncpy(quoted, text, sizeof buffers[0] - 1);
    *to++ = '"';
    for (at = text; *at && to < quoted + sizeof buffers[0] - 4; at++) {
        if (*at == '"' || *at == '\\')
            *to++ = '\\';
        *to++ = (unsigned char)*at < ' ' ? ' ' : *at;
    }
    *to++ = '"';
    *to = '\0';
    return quoted;
}

/* --- words and lines --- */

const char *import_word(const import_words *words, const char *theirs)
{
    while (words->theirs && strcmp(words->theirs, theirs) != 0)
        words++;
    return words->ours;
}

void import_line(import *j, const char *name, ...)
{
    va_list values;

    va_start(values, name);
    if (vasprintf(&j->line, name, values) < 0)
        j->line = NULL;
    va_end(values);
}

void import_serial_line(import *j, const char *frames, const char *path, const char *baud,
                        const char *parity, const char *stop, const char *data)
{
    const char *word = *parity == 'E' ? "even" : *parity == 'O' ? "odd" : "none";

    import_line(j, "%s:%s?baud=%s&parity=%s&stop=%s%s", frames, path, baud, word, stop,
                strcmp(frames, "ascii") == 0 && *data == '7' ? "&data=7" : "");
}

/* --- parts --- */

static import_part *part_of(import *j, unsigned field)
{
    return field == IMPORT_HEAD ? &j->head : &j->fields[field];
}

static void add_pair(import *j, import_part *part, int line, const char *key, char *value)
{
    char *copy = strdup(key);

    if (!copy || !value || part->count == IMPORT_KEYS) {
        j->is_out_of_memory = 1;
        free(copy);
        free(value);
        return;
    }
    part->pairs[part->count++] = (import_pair){copy, value, line};
}

void import_set(import *j, unsigned field, int line, const char *key, const char *value, ...)
{
    va_list values;
    char *text = NULL;

    if (j->is_out_of_memory)
        return;
    va_start(values, value);
    if (vasprintf(&text, value, values) < 0)
        text = NULL;
    va_end(values);
    add_pair(j, part_of(j, field), line, key, text);
}

void import_set_text(import *j, unsigned field, int line, const char *key, const char *text)
{
    if (!j->is_out_of_memory)
        add_pair(j, part_of(j, field), line, key, strdup(import_quote(text)));
}

static void free_names(import_part *part)
{
    free(part->name);
    free(part->topic);
    free(part->identifier);
}

static void free_part(import_part *part)
{
    while (part->count > 0) {
        free(part->pairs[--part->count].key);
        free(part->pairs[part->count].value);
    }
    free_names(part);
}

/* --- names --- */

const char *import_name(const import *j, unsigned field)
{
    return j->is_out_of_memory ? "" : j->fields[field].name;
}

/* Whether a field before this one becomes the same topic or the same identifier. */
static int is_taken(const import *j, const import_part *part)
{
    const import_part *other;

    for (other = j->fields; other < part; other++)
        if (strcmp(other->topic, part->topic) == 0 ||
            strcmp(other->identifier, part->identifier) == 0)
            return 1;
    return 0;
}

/* Gives the last field a name. Returns 0 if a field before it has the same. */
static int set_name(import *j, import_part *part, const char *name)
{
    free_names(part);
    part->name = strdup(name);
    part->topic = names_topic(name);
    part->identifier = names_identifier(name);
    if (!part->name || !part->topic || !part->identifier)
        j->is_out_of_memory = 1;
    return j->is_out_of_memory || !is_taken(j, part);
}

/* Makes a text that may be a name: without control characters, of at most 8 levels, short, and with
 * a letter or a digit. */
static void clean_name(const import *j, const char *text, char name[DEVICE_NAME_BYTES])
{
    const int has_levels = names_levels(text) <= NAMES_LEVELS;
    size_t length = 0;
    char *identifier;

    while (*text == ' ')
        text++;
    for (; *text && length + 12 < DEVICE_NAME_BYTES; text++)
        name[length++] = (unsigned char)*text < ' ' || (*text == '/' && !has_levels) ? ' ' : *text;
    while (length > 0 && (name[length - 1] == ' ' || (*text & 0xC0) == 0x80))
        text = name + --length;
    name[length] = '\0';
    identifier = names_identifier(name);
    if (!identifier || !*identifier)
        snprintf(name, DEVICE_NAME_BYTES, "field %u", j->field_count + 1);
    free(identifier);
}

unsigned import_field(import *j, int line, const char *text)
{
    char name[DEVICE_NAME_BYTES], other[DEVICE_NAME_BYTES + 12];
    unsigned number = 1;
    import_part *part;

    if (j->field_count == j->capacity) {
        const unsigned capacity = j->capacity ? 2 * j->capacity : 64;
        import_part *more = (import_part *)realloc(j->fields, capacity * sizeof *more);

        if (!more) {
            j->is_out_of_memory = 1;
            return 0;
        }
        j->fields = more;
        j->capacity = capacity;
    }
    part = &j->fields[j->field_count];
    memset(part, 0, sizeof *part);
    part->line = line;
    clean_name(j, text, name);
    snprintf(other, sizeof other, "%s", name);
    while (!set_name(j, part, other))
        snprintf(other, sizeof other, "%s %u", name, ++number);
    if (strcmp(other, text) != 0)
        import_lose(j, line, text, "the name is \"%s\" here%s", other,
                    number > 1 ? ": another field has it" : "");
    j->field_count++;
    import_set_text(j, j->field_count - 1, line, "name", other);
    return j->field_count - 1;
}

void import_drop(import *j)
{
    if (j->field_count > 0)
        free_part(&j->fields[--j->field_count]);
}

/* --- the file --- */

/* Which part and pair is in a line of the file. */
typedef struct place_in_file {
    unsigned part, pair;
} place_in_file;

typedef struct draft {
    FILE *out;
    place_in_file *places; /* of each line */
    size_t lines, capacity;
} draft;

static void add_line(draft *d, unsigned part, unsigned pair)
{
    if (d->lines == d->capacity) {
        d->capacity = d->capacity ? 2 * d->capacity : 256;
        d->places = (place_in_file *)realloc(d->places, d->capacity * sizeof *d->places);
        if (!d->places)
            exit(report(CODE_SYSTEM, REPORT_NO_MEMORY));
        memset(&d->places[d->lines], 0, (d->capacity - d->lines) * sizeof *d->places);
    }
    d->places[d->lines++] = (place_in_file){part, pair};
}

static void write_draft(const import *j, draft *d)
{
    const char *slash = strrchr(j->path, '/');
    unsigned i, k;

    d->lines = 0;
    fprintf(d->out, "# Made by mbm import from %s.\n", slash ? slash + 1 : j->path);
    add_line(d, IMPORT_HEAD, IMPORT_KEYS);
    if (j->line) {
        fprintf(d->out, "# The line: \"%s\"\n", j->line);
        add_line(d, IMPORT_HEAD, IMPORT_KEYS);
    }
    for (k = 0; k < j->head.count; k++) {
        fprintf(d->out, "%s: %s\n", j->head.pairs[k].key, j->head.pairs[k].value);
        add_line(d, IMPORT_HEAD, k);
    }
    fputs("fields:\n", d->out);
    add_line(d, IMPORT_HEAD, IMPORT_KEYS);
    for (i = 0; i < j->field_count; i++)
        for (k = 0; k < j->fields[i].count; k++) {
            const import_pair *pair = &j->fields[i].pairs[k];

            fprintf(d->out, "%s%s: %s\n", k == 0 ? "  - " : "    ", pair->key, pair->value);
            add_line(d, i, k);
        }
}

/* Keys without which a field would have a wrong value, or another one. */
static int is_needed(const char *key)
{
    static const char *const NEEDED[] = {"name",  "table", "address", "type",
                                         "count", "bit",   "scale",   "offset",
                                         "order", "unit",  "repeat",  "not_available"};
    size_t i;

    for (i = 0; i < sizeof NEEDED / sizeof NEEDED[0]; i++)
        if (strcmp(key, NEEDED[i]) == 0)
            return 1;
    return 0;
}

static void remove_pair(import_part *part, unsigned pair)
{
    free(part->pairs[pair].key);
    free(part->pairs[pair].value);
    memmove(&part->pairs[pair], &part->pairs[pair + 1],
            (part->count - pair - 1) * sizeof part->pairs[0]);
    part->count--;
}

static void remove_field(import *j, unsigned field)
{
    free_part(&j->fields[field]);
    memmove(&j->fields[field], &j->fields[field + 1],
            (j->field_count - field - 1) * sizeof j->fields[0]);
    j->field_count--;
}

/* Takes out what the reader refuses: a key, or the field if the rest would be wrong without it.
 * Returns 0 if that is not possible. */
static int take_out(import *j, const draft *d, const char *wrong)
{
    const char *colon = strchr(wrong, ':');
    const unsigned long at = colon ? strtoul(colon + 1, NULL, 10) : 0;
    const char *why = colon ? strstr(colon, ": ") : NULL;
    const place_in_file *place;
    import_part *part;

    if (at == 0 || at > d->lines || !why)
        return 0;
    place = &d->places[at - 1];
    part = part_of(j, place->part);
    if (place->pair >= part->count)
        return 0;
    if (place->part == IMPORT_HEAD) {
        import_lose(j, part->pairs[place->pair].line, "the head", "%s", why + 2);
        remove_pair(part, place->pair);
    } else if (is_needed(part->pairs[place->pair].key)) {
        import_lose(j, part->line, import_name(j, place->part), "%s: the field is left out",
                    why + 2);
        remove_field(j, place->part);
    } else {
        import_lose(j, part->pairs[place->pair].line, import_name(j, place->part), "%s", why + 2);
        remove_pair(part, place->pair);
    }
    return 1;
}

/* Reads the text as a device file. Returns 1 if it is one; otherwise `wrong` has the reason. */
static int try_text(const char *text, size_t length, char wrong[YAML_FILE_WRONG_BYTES])
{
    const int fd = memfd_create("mbm", 0);
    device made;
    int code = CODE_SYSTEM;
    char path[40];

    snprintf(wrong, YAML_FILE_WRONG_BYTES, "%s", strerror(errno));
    if (fd >= 0 && write(fd, text, length) == (ssize_t)length) {
        snprintf(path, sizeof path, "/proc/self/fd/%d", fd);
        code = device_file_read(&made, path, wrong);
        if (code == CODE_DONE)
            device_free(&made);
    }
    if (fd >= 0)
        close(fd);
    return code == CODE_DONE;
}

int import_write(import *j)
{
    char wrong[YAML_FILE_WRONG_BYTES], *text;
    size_t length;
    draft d = {0};
    int code = CODE_DONE, is_right = 0;

    while (code == CODE_DONE && !is_right) {
        text = NULL;
        d.out = j->is_out_of_memory ? NULL : open_memstream(&text, &length);
        if (!d.out) {
            code = report(CODE_SYSTEM, REPORT_NO_MEMORY);
            break;
        }
        write_draft(j, &d);
        (void)fclose(d.out);
        if (j->field_count == 0)
            code = report(CODE_WRONG, "%s: there is no field that can be taken over", j->path);
        else if (try_text(text, length, wrong))
            is_right = 1;
        else if (!take_out(j, &d, wrong))
            code =
                report(CODE_WRONG, "%s: what was made of it is no device file: %s", j->path, wrong);
        if (is_right)
            code = report_write_file(j->output, text, length);
        free(text);
    }
    free(d.places);
    if (code == CODE_DONE && j->lost > 0)
        return report(CODE_WRONG, "%s: not taken over: %u. The device file has %u fields", j->path,
                      j->lost, j->field_count);
    return code;
}

void import_free(import *j)
{
    while (j->field_count > 0)
        free_part(&j->fields[--j->field_count]);
    free_part(&j->head);
    free(j->fields);
    free(j->line);
}
