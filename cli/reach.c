/* Reads what a device needs to be reached, and sets client and link so. */
#include "reach.h"

#include "numbers.h"

#include <stdio.h>
#include <string.h>

enum { LONGEST_TIME = 65535, LONGEST_TIMEOUT = 1000000, MOST_RETRIES = 254, LONGEST_WORDS = 60 };

const char *const reach_names[] = {REACH_NAMES, NULL};

/* Words of a list: each has the number that its place says. */
static const char *const ACCEPTS[] = {"unit", "transaction", NULL};
static const char *const CLOSES[] = {"never", "round", "error", NULL};

/* --- values --- */

/* Reads words with commas between them as the sum of 1 << place. */
static const char *read_words(const char *text, const char *const *words, uint8_t *sum)
{
    char copy[LONGEST_WORDS + 1], *rest = NULL, *word;
    const char *wrong;
    int index;

    *sum = 0;
    /* The sentence has the words. */
    if ((size_t)snprintf(copy, sizeof copy, "%s", text) >= sizeof copy || !*text ||
        text[strlen(text) - 1] == ',')
        return number_word(text, words, &index);
    for (word = strtok_r(copy, ",", &rest); word; word = strtok_r(NULL, ",", &rest)) {
        wrong = number_word(word, words, &index);
        if (wrong)
            return wrong;
        if (*sum & 1 << index)
            return say("\"%s\" is there twice", word);
        *sum = (uint8_t)(*sum | 1 << index);
    }
    return NULL;
}

static const char *read_accept(reach *into, const char *text)
{
    /* The places are MBM_ACCEPT_. */
    return read_words(text, ACCEPTS, &into->accept);
}

static const char *read_close(reach *into, const char *text)
{
    uint8_t sum;
    const char *wrong = read_words(text, CLOSES, &sum);

    if (!wrong && sum & 1 && sum > 1)
        return "never goes with no other word";
    /* After never, the places are MBM_LINK_CLOSE_. */
    into->close = sum >> 1;
    return wrong;
}

static const char *read_count(const char *text, uint8_t *count)
{
    int64_t number = 0;
    const char *wrong = number_read(text, 0, MOST_RETRIES, &number);

    *count = (uint8_t)number;
    return wrong;
}

static const char *read_value(reach *into, int key, const char *text)
{
    switch (key) {
    case REACH_ACCEPT: return read_accept(into, text);
    case REACH_LENIENT: return number_answer(text, &into->is_lenient);
    case REACH_DELAY: return number_time(text, 0, LONGEST_TIME, &into->delayMs);
    case REACH_MESSAGE_WAIT: return number_time(text, 0, LONGEST_TIME, &into->message_waitMs);
    case REACH_CLOSE: return read_close(into, text);
    case REACH_RETRIES: return read_count(text, &into->retries);
    case REACH_BUSY_RETRIES: return read_count(text, &into->busy_retries);
    case REACH_TIMEOUT: return number_time(text, 1, LONGEST_TIMEOUT, &into->timeoutMs);
    default: return number_time(text, 0, LONGEST_TIME, &into->busy_waitMs);
    }
}

const char *reach_read(reach *into, int key, const char *text)
{
    const char *wrong = read_value(into, key, text);

    if (!wrong)
        into->given = (uint16_t)(into->given | 1u << key);
    return wrong;
}

/* The words of a list as the name of a line has them. Returns 0 after a refusal. */
static int join(yaml_file *file, const yaml_node_t *list, int key, char text[LONGEST_WORDS + 1])
{
    const size_t count = yaml_file_items(file, reach_names[key], list, 2);
    size_t at, length = 0;

    for (at = 0; at < count; at++) {
        const char *word =
            yaml_file_text(file, reach_names[key], yaml_file_item(file, list, at), 20);

        if (!word)
            return 0;
        length += (size_t)snprintf(text + length, LONGEST_WORDS + 1 - length, "%s%s",
                                   at > 0 ? "," : "", word);
    }
    return count > 0;
}

static int read_node(yaml_file *file, const yaml_node_t *node, int key, reach *into)
{
    char joined[LONGEST_WORDS + 1];
    const char *text = joined, *wrong;

    if (!node)
        return 1;
    if (node->type == YAML_SEQUENCE_NODE && (key == REACH_ACCEPT || key == REACH_CLOSE)) {
        if (!join(file, node, key, joined))
            return 0;
    } else {
        text = yaml_file_text(file, reach_names[key], node, LONGEST_WORDS);
        if (!text)
            return 0;
    }
    wrong = reach_read(into, key, text);
    return wrong ? yaml_file_refuse(file, node, "%s: %s", reach_names[key], wrong) : 1;
}

int reach_read_nodes(yaml_file *file, const yaml_node_t *const *values, reach *into)
{
    const yaml_node_t *number = values[REACH_MILLISECONDS];
    int key;

    for (key = 0; key < REACH_KEYS; key++)
        if (!read_node(file, values[key], key, into))
            return 0;
    if (values[REACH_BUSY_WAIT] && !values[REACH_BUSY_RETRIES])
        return yaml_file_refuse(file, values[REACH_BUSY_WAIT], "busy_wait needs busy_retries");
    if (!number)
        return 1;
    if (values[REACH_MESSAGE_WAIT])
        return yaml_file_refuse(file, number,
                                "message_wait_milliseconds and message_wait are both there");
    into->given |= 1u << REACH_MESSAGE_WAIT;
    return yaml_file_number(file, "message_wait_milliseconds", number, 0, LONGEST_TIME,
                            &into->message_waitMs);
}

/* --- what is said in several places --- */

static void take(reach *into, const reach *from, int key)
{
    switch (key) {
    case REACH_ACCEPT: into->accept = from->accept; break;
    case REACH_LENIENT: into->is_lenient = from->is_lenient; break;
    case REACH_DELAY: into->delayMs = from->delayMs; break;
    case REACH_MESSAGE_WAIT: into->message_waitMs = from->message_waitMs; break;
    case REACH_CLOSE: into->close = from->close; break;
    case REACH_RETRIES: into->retries = from->retries; break;
    case REACH_BUSY_RETRIES: into->busy_retries = from->busy_retries; break;
    case REACH_TIMEOUT: into->timeoutMs = from->timeoutMs; break;
    default: into->busy_waitMs = from->busy_waitMs; break;
    }
}

void reach_fill(reach *into, const reach *from)
{
    int key;

    for (key = 0; key < REACH_KEYS; key++)
        if (from->given & ~into->given & 1u << key)
            take(into, from, key);
    into->given |= from->given;
}

/* --- what a line can have --- */

int reach_has(const reach *of, int key)
{
    return of->given >> key & 1;
}

const char *reach_check(const reach *of, const reach_line *line, const char *dash)
{
    const char *const wait = *dash ? "--message-wait" : "message_wait";
    const char *const in_flight = *dash ? "--in-flight" : "in_flight";

    if (reach_has(of, REACH_ACCEPT) && line->framing != MBM_FRAMING_TCP)
        return say(
            "%saccept is for tcp://, tls:// and udp://: in other frames nothing but the unit "
            "tells whose a reply is",
            dash);
    if (of->is_lenient && line->framing == MBM_FRAMING_ASCII)
        return say("%slenient is not for ascii:", dash);
    if ((reach_has(of, REACH_DELAY) || reach_has(of, REACH_CLOSE)) && !line->has_link)
        return say("%s%s is not for udp://, which has no connection", dash,
                   reach_has(of, REACH_DELAY) ? "delay" : "close");
    if (of->accept & MBM_ACCEPT_TRANSACTION && line->in_flight > 1)
        return say("%saccept transaction needs one request in flight: %s is %u", dash, in_flight,
                   (unsigned)line->in_flight);
    if (of->message_waitMs > 0 && line->in_flight > 1)
        return say("%s needs one request in flight: %s is %u", wait, in_flight,
                   (unsigned)line->in_flight);
    if (reach_has(of, REACH_BUSY_WAIT) && !reach_has(of, REACH_BUSY_RETRIES))
        return *dash ? "--busy-wait needs --busy-retries" : "busy_wait needs busy_retries";
    return NULL;
}

static void forget(reach *of, int key)
{
    static const reach nothing;

    take(of, &nothing, key);
    of->given = (uint16_t)(of->given & ~(1u << key));
}

const char *reach_fit(reach *of, const reach_line *line)
{
    const char *lost = NULL;

    if (!line->has_link) {
        if (of->delayMs > 0 || of->close)
            lost = say("%s has no effect on udp://, which has no connection",
                       of->delayMs > 0 ? "delay" : "close");
        forget(of, REACH_DELAY);
        forget(of, REACH_CLOSE);
    }
    if (line->framing == MBM_FRAMING_ASCII) {
        if (of->is_lenient)
            lost = "lenient has no effect in ASCII frames";
        forget(of, REACH_LENIENT);
    }
    if (line->framing != MBM_FRAMING_TCP) {
        if (of->accept)
            lost = "accept has no effect here: it is for frames of Modbus TCP, in others nothing "
                   "but the unit tells whose a reply is";
        forget(of, REACH_ACCEPT);
    }
    return lost;
}

/* A reply with another transaction number may be a late one, unless the connection is a new one. */
uint8_t reach_closes(const reach *of)
{
    if (!reach_has(of, REACH_CLOSE) && of->accept & MBM_ACCEPT_TRANSACTION)
        return MBM_LINK_CLOSE_AFTER_FAILURE;
    return of->close;
}

uint32_t reach_busy_wait(const reach *of)
{
    return reach_has(of, REACH_BUSY_WAIT) ? of->busy_waitMs : REACH_BUSY_WAIT_MS;
}

uint32_t reach_timeout(const reach *of)
{
    return reach_has(of, REACH_TIMEOUT) ? of->timeoutMs : REACH_TIMEOUT_MS;
}

void reach_set(const reach *of, mbm_client *client, mbm_link *link, const reach_line *line,
               uint32_t gapUs)
{
    (void)mbm_client_setResponseTimeout(client, reach_timeout(of));
    (void)mbm_client_setRetries(client, of->retries);
    (void)mbm_client_setBusyRetries(client, of->busy_retries, reach_busy_wait(of));
    (void)mbm_client_setAccept(client, line->framing == MBM_FRAMING_TCP ? of->accept : 0);
    (void)mbm_client_setLenient(client, of->is_lenient);
    (void)mbm_client_setMessageWait(client, of->message_waitMs);
    if (gapUs > of->message_waitMs * 1000)
        (void)mbm_client_setGap(client, gapUs);
    if (!link)
        return;
    (void)mbm_link_setDelayAfterConnect(link, of->delayMs);
    (void)mbm_link_setClose(link, reach_closes(of));
}
