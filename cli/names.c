/* Turns names into topics and identifiers. */
#include "names.h"

#include <ctype.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

unsigned names_levels(const char *name)
{
    unsigned levels = 1;

    for (; *name; name++)
        levels += *name == '/';
    return levels;
}

/* --- topics --- */

/* Whether the bridge has a topic of its own there: NAME/set, NAME/result, status, unit/N/status. */
static int is_taken(const char *topic)
{
    const char *last = strrchr(topic, '/');

    last = last ? last + 1 : topic;
    return strcmp(last, "set") == 0 || strcmp(last, "result") == 0 ||
           strcmp(topic, "status") == 0 ||
           (names_levels(topic) == 3 && strncmp(topic, "unit/", 5) == 0 &&
            strcmp(last, "status") == 0);
}

char *names_topic(const char *name)
{
    char *topic = (char *)malloc(strlen(name) + 2);
    size_t length = 0, from;

    for (from = 0; topic && name[from]; from++) {
        const int is_sign = strchr(" +#", name[from]) || (name[from] == '/' && from == 0);

        if (!is_sign)
            topic[length++] = name[from];
        else if (from == 0 || !strchr(" +#", name[from - 1]))
            topic[length++] = '_';
    }
    if (!topic)
        return NULL;
    topic[length] = '\0';
    if (is_taken(topic))
        strcpy(topic + length, "_");
    return topic;
}

/* --- identifiers --- */

/* The letters U+00C0 to U+017F without their accents; those of × and ÷ are signs. */
static const char LATIN[] = "aaaaaaaceeeeiiiidnooooo_ouuuuyts"
                            "aaaaaaaceeeeiiiidnooooo_ouuuuyty"
                            "aaaaaaccccccccddddeeeeeeeeeegggggggghhhhiiiiiiiiiiiijjkkklllllll"
                            "lllnnnnnnnnnoooooooorrrrrrssssssssttttttuuuuuuuuuuuuwwyyyzzzzzzs";

/* Reads a character of UTF-8. Returns what follows it. */
static const char *read_character(const char *text, uint32_t *character)
{
    const uint8_t first = (uint8_t)*text++;

    *character = first < 0x80   ? first
                 : first < 0xE0 ? first & 0x1Fu
                 : first < 0xF0 ? first & 0x0Fu
                                : first & 0x07u;
    while (((uint8_t)*text & 0xC0) == 0x80)
        *character = *character << 6 | ((uint8_t)*text++ & 0x3Fu);
    return text;
}

/* Writes a character as part of an identifier: up to 7 letters and digits; "_" for a sign, nothing
 * for an accent that follows its letter. */
static void write_character(uint32_t character, char part[8])
{
    part[0] = '_';
    part[1] = '\0';
    if (character < 0x80) {
        if (isalnum((int)character))
            part[0] = (char)tolower((int)character);
    } else if (character >= 0xC0 && character < 0x180)
        part[0] = LATIN[character - 0xC0];
    else if (character >= 0x300 && character < 0x370)
        part[0] = '\0';
    else if (character >= 0xC0 && (character < 0x2000 || character >= 0x2C00))
        snprintf(part, 8, "u%x", (unsigned)character & 0x1FFFFFu);
}

char *names_identifier(const char *name)
{
    /* A character of n bytes of UTF-8 takes at most 2n + 1 bytes. */
    char *identifier = (char *)malloc(3 * strlen(name) + 1), part[8];
    size_t length = 0;
    uint32_t character;

    if (!identifier)
        return NULL;
    while (*name) {
        name = read_character(name, &character);
        write_character(character, part);
        if (strcmp(part, "_") != 0) {
            strcpy(identifier + length, part);
            length += strlen(part);
        } else if (length > 0 && identifier[length - 1] != '_') {
            identifier[length++] = '_';
        }
    }
    if (length > 0 && identifier[length - 1] == '_')
        length--;
    identifier[length] = '\0';
    return identifier;
}
