/* Reads --fault, and chooses the faults of each request. */
#include "fault.h"

#include "numbers.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* How the value of a fault is written. */
enum { NOTHING, TIME, NUMBER, FUNCTION, RANGE, TRANSACTION };
enum {
    ON_LINES = 1 << PLACE_RTU | 1 << PLACE_ASCII | 1 << PLACE_PTY,
    ON_STREAMS = 1 << PLACE_TCP | 1 << PLACE_RTU_OVER_TCP | 1 << PLACE_TLS,
    ON_BYTES = ON_LINES | ON_STREAMS,
    ON_ALL = ON_BYTES | 1 << PLACE_UDP,
    ON_NUMBERED = 1 << PLACE_TCP | 1 << PLACE_UDP | 1 << PLACE_TLS
};
enum { HALF_MINUTE = 30000, TEN_MINUTES = 600000 };
enum { LISTED_BYTES = 400 };

static const struct {
    const char *name;
    int value, places;
    uint32_t least, most;
    uint8_t is_lasting; /* it is there for the whole run, and has no @ */
    const char *example;
} KINDS[FAULT_KINDS] = {
    [FAULT_LATE] = {"late", TIME, ON_ALL, 1, TEN_MINUTES, 0, "late=750ms"},
    [FAULT_DEAF] = {"deaf", NOTHING, ON_ALL, 0, 0, 0, ""},
    [FAULT_SLOW] = {"slow", TIME, ON_BYTES, 1, 10000, 0, "slow=5ms"},
    [FAULT_DAMAGED] = {"damaged", NOTHING, ON_BYTES, 0, 0, 0, ""},
    [FAULT_CUT] = {"cut", NUMBER, ON_BYTES, 1, 512, 0, "cut=3"},
    [FAULT_NOISE] = {"noise", NUMBER, ON_BYTES, 1, 256, 0, "noise=4"},
    [FAULT_TWICE] = {"twice", NOTHING, ON_ALL, 0, 0, 0, ""},
    [FAULT_EXCEPTION] = {"exception", NUMBER, ON_ALL, 1, 127, 0, "exception=6"},
    [FAULT_FOREIGN] = {"foreign", NOTHING, ON_ALL, 0, 0, 0, ""},
    [FAULT_WRONG_LENGTH] = {"wrong-length", NOTHING, ON_BYTES, 0, 0, 0, ""},
    [FAULT_CLOSE] = {"close", NOTHING, ON_STREAMS, 0, 0, 0, ""},
    [FAULT_BLOCKS] = {"blocks", NUMBER, ON_BYTES, 1, 512, 0, "blocks=22"},
    [FAULT_BLOCKS_EVERY] = {"blocks-every", TIME, ON_BYTES, 1, 1000, 0, "blocks-every=16ms"},
    [FAULT_UNIT] = {"unit", NUMBER, ON_ALL, 0, 255, 0, "unit=0"},
    [FAULT_TRANSACTION] = {"transaction", TRANSACTION, ON_NUMBERED, 0, 65535, 0, "transaction=0"},
    [FAULT_ONLY_FUNCTION] = {"only-function", FUNCTION, ON_ALL, 1, 127, 0, "only-function=16"},
    [FAULT_NO_FUNCTION] = {"no-function", FUNCTION, ON_ALL, 1, 127, 0, "no-function=6"},
    [FAULT_MOST_REGISTERS] = {"most-registers", NUMBER, ON_ALL, 1, 125, 0, "most-registers=80"},
    [FAULT_MOST_BITS] = {"most-bits", NUMBER, ON_ALL, 1, 2000, 0, "most-bits=64"},
    [FAULT_HOLE] = {"hole", RANGE, ON_ALL, 0, 65535, 0, "hole=100-109"},
    [FAULT_REFUSED_WITH] = {"refused-with", NUMBER, ON_ALL, 1, 127, 0, "refused-with=3"},
    [FAULT_NEEDS_DELAY] = {"needs-delay", TIME, ON_STREAMS, 1, TEN_MINUTES, 0, "needs-delay=1s"},
    [FAULT_NEEDS_MESSAGE_WAIT] = {"needs-message-wait", TIME, ON_ALL, 1, HALF_MINUTE, 0,
                                  "needs-message-wait=50ms"},
    [FAULT_ONE_REQUEST] = {"one-request", NOTHING, ON_BYTES, 0, 0, 1, ""},
    [FAULT_BUSY] = {"busy", NOTHING, ON_ALL, 0, 0, 1, ""},
    [FAULT_CLOSE_IDLE] = {"close-idle", TIME, ON_STREAMS, 1, TEN_MINUTES, 1, "close-idle=2s"},
    [FAULT_CLOSE_AFTER] = {"close-after", NUMBER, ON_STREAMS, 1, 1000000, 1, "close-after=1"},
    [FAULT_DEAF_AFTER] = {"deaf-after", NUMBER, ON_STREAMS, 1, 1000000, 1, "deaf-after=3"},
    [FAULT_CONNECTIONS] = {"connections", NUMBER, ON_STREAMS, 1, 32, 1, "connections=1"},
};

/* Lists the faults that a line can have. */
static const char *listed(enum place_kind line, char text[LISTED_BYTES])
{
    size_t length = 0;
    int kind;

    for (kind = 0; kind < FAULT_KINDS; kind++)
        if (KINDS[kind].places >> line & 1)
            length += (size_t)snprintf(text + length, LISTED_BYTES - length, "%s%s",
                                       length ? ", " : "", KINDS[kind].name);
    return text;
}

/* Reads a number, of a function also in hexadecimal as manuals have it: 16 or 0x10. */
static const char *read_number(const char *text, const fault *one, uint32_t *number)
{
    const uint32_t least = KINDS[one->kind].least, most = KINDS[one->kind].most;
    int64_t found = 0;
    const char *wrong = NULL;
    char *end = NULL;

    if (KINDS[one->kind].value == FUNCTION && strncmp(text, "0x", 2) == 0) {
        found = strtol(text, &end, 16);
        if (text[2] == '\0' || *end != '\0' || found < (int64_t)least || found > (int64_t)most)
            wrong = say("\"%s\" is not a function code: from 0x%02X to 0x%02X is allowed", text,
                        (unsigned)least, (unsigned)most);
    } else {
        wrong = number_read(text, least, most, &found);
    }
    *number = (uint32_t)found;
    return wrong;
}

/* Reads A or A-B. */
static const char *read_range(char *text, fault *one)
{
    char *minus = strchr(text, '-');
    const char *wrong;

    if (minus)
        *minus = '\0';
    wrong = read_number(text, one, &one->value);
    one->last = one->value;
    if (!wrong && minus)
        wrong = read_number(minus + 1, one, &one->last);
    if (!wrong && one->last < one->value)
        wrong = say("the range ends before it begins");
    return wrong;
}

/* Reads the value of a fault, which is NULL if there is none. */
static const char *read_value(char *value, const char *text, fault *one)
{
    const int wanted = KINDS[one->kind].value;
    const char *wrong = NULL;

    if (wanted == NOTHING)
        return value ? say("\"%s\": %s has no value", text, KINDS[one->kind].name) : NULL;
    if (!value)
        return say("\"%s\": the value is missing, such as %s", text, KINDS[one->kind].example);
    if (wanted == TIME)
        wrong = number_time(value, KINDS[one->kind].least, KINDS[one->kind].most, &one->value);
    else if (wanted == RANGE)
        wrong = read_range(value, one);
    else if (wanted == TRANSACTION && strcmp(value, "count") == 0)
        one->value = FAULT_OWN_COUNT;
    else if (wanted == TRANSACTION && strcmp(value, "before") == 0)
        one->value = FAULT_NUMBER_BEFORE;
    else
        wrong = read_number(value, one, &one->value);
    return wrong ? say("\"%s\": %s", text, wrong) : NULL;
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
    char copy[80], names[LISTED_BYTES], *when, *value;
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
    if (!wrong && when && KINDS[kind].is_lasting)
        wrong = say("\"%s\": %s is there for the whole run, and has no @", text, copy);
    else if (!wrong && when)
        wrong = read_when(when, text, one);
    if (!wrong)
        list->count++;
    return wrong;
}

static int has(const fault_list *list, enum fault_kind kind)
{
    uint32_t i;

    for (i = 0; i < list->count; i++)
        if (list->faults[i].kind == kind)
            return 1;
    return 0;
}

const char *fault_check(const fault_list *list)
{
    if (has(list, FAULT_BUSY) && !has(list, FAULT_NEEDS_DELAY) &&
        !has(list, FAULT_NEEDS_MESSAGE_WAIT) && !has(list, FAULT_ONE_REQUEST))
        return say("\"busy\": it goes with needs-delay, needs-message-wait or one-request");
    if (has(list, FAULT_REFUSED_WITH) && !has(list, FAULT_MOST_REGISTERS) &&
        !has(list, FAULT_MOST_BITS) && !has(list, FAULT_HOLE))
        return say("\"refused-with\": it goes with most-registers, most-bits or hole");
    return NULL;
}

uint32_t fault_value(const fault_list *list, enum fault_kind kind)
{
    uint32_t i, value = 0;

    for (i = 0; i < list->count; i++)
        if (list->faults[i].kind == kind)
            value = KINDS[kind].value == NOTHING ? 1 : list->faults[i].value;
    return value;
}

int fault_is_due(const fault_list *list, const fault *one)
{
    const uint32_t number = list->requests;

    return number == one->first ||
           (one->every != 0 && number > one->first && (number - one->first) % one->every == 0);
}

void fault_choose(const fault_list *list, fault_choice *choice)
{
    uint32_t i;

    memset(choice, 0, sizeof *choice);
    for (i = 0; i < list->count; i++) {
        const fault *one = &list->faults[i];

        if (!fault_is_due(list, one))
            continue;
        choice->has[one->kind] = 1;
        choice->value[one->kind] = one->value;
    }
}
