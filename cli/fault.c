#define _GNU_SOURCE
#include "fault.h"

#include "numbers.h"

#include <stdio.h>
#include <string.h>

enum { VALUE_NONE, VALUE_TIME, VALUE_NUMBER };
enum {
    ON_LINES = 1 << PLACE_RTU | 1 << PLACE_ASCII | 1 << PLACE_PTY,
    ON_STREAMS = 1 << PLACE_TCP | 1 << PLACE_RTU_OVER_TCP | 1 << PLACE_TLS,
    ON_DATAGRAMS = 1 << PLACE_UDP,
    ON_BYTES = ON_LINES | ON_STREAMS,
    ON_ALL = ON_BYTES | ON_DATAGRAMS
};

static const struct {
    const char *name;
    int value, places;
    uint32_t most;
    const char *example;
} KINDS[FAULT_KINDS] = {
    [FAULT_LATE] = {"late", VALUE_TIME, ON_ALL, 600000, "late=750ms"},
    [FAULT_DEAF] = {"deaf", VALUE_NONE, ON_ALL, 0, ""},
    [FAULT_SLOW] = {"slow", VALUE_TIME, ON_BYTES, 10000, "slow=5ms"},
    [FAULT_DAMAGED] = {"damaged", VALUE_NONE, ON_BYTES, 0, ""},
    [FAULT_CUT] = {"cut", VALUE_NUMBER, ON_BYTES, 512, "cut=3"},
    [FAULT_NOISE] = {"noise", VALUE_NUMBER, ON_BYTES, 256, "noise=4"},
    [FAULT_TWICE] = {"twice", VALUE_NONE, ON_ALL, 0, ""},
    [FAULT_EXCEPTION] = {"exception", VALUE_NUMBER, ON_ALL, 127, "exception=6"},
    [FAULT_FOREIGN] = {"foreign", VALUE_NONE, ON_ALL, 0, ""},
    [FAULT_WRONG_LENGTH] = {"wrong-length", VALUE_NONE, ON_BYTES, 0, ""},
    [FAULT_CLOSE] = {"close", VALUE_NONE, ON_STREAMS, 0, ""},
};

/* Lists the faults that a line can have. */
static const char *listed(enum place_kind line, char text[200])
{
    size_t length = 0;
    int kind;

    for (kind = 0; kind < FAULT_KINDS; kind++)
        if (KINDS[kind].places >> line & 1)
            length += (size_t)snprintf(text + length, 200 - length, "%s%s", length ? ", " : "",
                                       KINDS[kind].name);
    return text;
}

/* Reads the value of a fault, which is NULL if there is none. */
static const char *read_value(const char *value, const char *text, fault *one)
{
    const int wanted = KINDS[one->kind].value;
    const char *wrong = NULL;
    int64_t number = 0;

    if (wanted == VALUE_NONE)
        return value ? say("\"%s\": %s has no value", text, KINDS[one->kind].name) : NULL;
    if (!value)
        return say("\"%s\": the value is missing, such as %s", text, KINDS[one->kind].example);
    if (wanted == VALUE_TIME)
        wrong = number_time(value, 1, KINDS[one->kind].most, &one->value);
    else
        wrong = number_read(value, 1, KINDS[one->kind].most, &number);
    if (wrong)
        return say("\"%s\": %s", text, wrong);
    if (wanted == VALUE_NUMBER)
        one->value = (uint32_t)number;
    return NULL;
}

/* Reads N, N- or N/M. */
static const char *read_when(char *when, const char *text, fault *one)
{
    char *slash = strchr(when, '/');
    const size_t length = strlen(when);
    int64_t first, every = 0;
    const char *wrong;

    if (slash)
        *slash = '\0';
    else if (length > 1 && when[length - 1] == '-') {
        when[length - 1] = '\0';
        every = 1;
    }
    wrong = number_read(when, 1, UINT32_MAX, &first);
    if (!wrong && slash)
        wrong = number_read(slash + 1, 1, UINT32_MAX, &every);
    if (wrong)
        return say("\"%s\": after @ stand N, N- or N/M, such as @3, @3- or @3/10; %s", text, wrong);
    one->first = (uint32_t)first;
    one->every = (uint32_t)every;
    return NULL;
}

const char *fault_read(fault_list *list, const char *text, enum place_kind line)
{
    fault *one = &list->faults[list->count];
    char copy[80], names[200], *when, *value;
    const char *wrong;
    int kind = 0;

    if (list->count == FAULT_MOST)
        return say("there are more than %d faults", FAULT_MOST);
    if ((size_t)snprintf(copy, sizeof copy, "%s", text) >= sizeof copy)
        return say("a fault is too long");
    when = strchr(copy, '@');
    if (when)
        *when++ = '\0';
    value = strchr(copy, '=');
    if (value)
        *value++ = '\0';
    while (kind < FAULT_KINDS && strcmp(KINDS[kind].name, copy) != 0)
        kind++;
    if (kind == FAULT_KINDS)
        return say("\"%s\" is no fault: on this line they are %s", copy, listed(line, names));
    if (!(KINDS[kind].places >> line & 1))
        return say("\"%s\": this line cannot have it: it can have %s", copy, listed(line, names));
    *one = (fault){.kind = (enum fault_kind)kind, .first = 1, .every = 1};
    wrong = read_value(value, text, one);
    if (!wrong && when)
        wrong = read_when(when, text, one);
    if (!wrong)
        list->count++;
    return wrong;
}

void fault_choose(fault_list *list, fault_choice *choice)
{
    const uint32_t number = ++list->requests;
    uint32_t i, chosen = 0;

    memset(choice, 0, sizeof *choice);
    for (i = 0; i < list->count; i++) {
        const fault *one = &list->faults[i];

        if (number != one->first &&
            (one->every == 0 || number < one->first || (number - one->first) % one->every != 0))
            continue;
        choice->has[one->kind] = 1;
        choice->value[one->kind] = one->value;
        chosen = 1;
    }
    list->hit += chosen;
}
