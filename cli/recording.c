#define _GNU_SOURCE
#include "recording.h"

#include <ctype.h>
#include <stdlib.h>
#include <string.h>

/* Thirty years in microseconds. */
#define LAST_TIME 9.5e14

/* Converts hexadecimal digits to bytes. Returns NULL, or what is wrong with them. */
static const char *read_bytes(const char *text, recording *into)
{
    into->length = 0;
    for (; *text; text++) {
        char pair[3] = {text[0], text[1], 0};

        if (isspace((unsigned char)*text))
            continue;
        if (!isxdigit((unsigned char)pair[0]) || !isxdigit((unsigned char)pair[1]))
            return "bytes are pairs of hexadecimal digits, such as 11 03 00 6B";
        if (into->length == RECORDING_BYTES)
            return "a line has at most 2700 bytes";
        into->bytes[into->length++] = (uint8_t)strtoul(pair, NULL, 16);
        text++;
    }
    return NULL;
}

/* Reads a line. Returns NULL, or what is wrong with it. */
static const char *read_line(char *text, recording *into)
{
    char *hex = strchr(text, ':'), *tail = hex;
    const double time = hex ? strtod(text, &tail) * 1000.0 : (double)(into->time + RECORDING_STEP);

    if (tail != hex)
        return "before the colon stands a time in milliseconds";
    if (!(time >= (double)into->time && time < LAST_TIME))
        return "the time is not between that of the line before and 30 years";
    into->time = (uint64_t)time;
    return read_bytes(hex ? hex + 1 : text, into);
}

int recording_next(recording *from, const char **wrong)
{
    char text[3 * RECORDING_BYTES + 64];

    do {
        if (!fgets(text, sizeof text, from->file))
            return 0;
        from->line++;
    } while (text[0] == '#');
    *wrong = read_line(text, from);
    return *wrong ? -1 : 1;
}
