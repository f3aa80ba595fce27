/* Parses the payloads of writes: numbers, truth values, texts, and JSON with these. */
#include "payload.h"

#include "conversion.h"
#include "numbers.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* --- JSON (RFC 8259). Each function returns 0 if the next bytes are not what it skips. --- */

static int skip_value(cursor *in);

static int is_space(char one)
{
    return one == ' ' || one == '\t' || one == '\r' || one == '\n';
}

static void skip_space(cursor *in)
{
    while (in->at < in->end && is_space(*in->at))
        in->at++;
}

static int skip_word(cursor *in, const char *word)
{
    const size_t length = strlen(word);

    if ((size_t)(in->end - in->at) < length || memcmp(in->at, word, length) != 0)
        return 0;
    in->at += length;
    return 1;
}

static int skip_escape(cursor *in)
{
    int left = 4;

    if (in->at == in->end || !strchr("\"\\/bfnrtu", *in->at) || !*in->at)
        return 0;
    if (*in->at++ != 'u')
        return 1;
    while (left > 0 && in->at < in->end && *in->at && strchr("0123456789abcdefABCDEF", *in->at)) {
        in->at++;
        left--;
    }
    return left == 0;
}

static int skip_string(cursor *in)
{
    if (!cursor_skip_char(in, '"'))
        return 0;
    while (in->at < in->end && *in->at != '"') {
        const unsigned char one = (unsigned char)*in->at++;

        if (one < ' ' || (one == '\\' && !skip_escape(in)))
            return 0;
    }
    return cursor_skip_char(in, '"');
}

/* After a bracket: skips the items or members up to the bracket that closes them. If `value` is not
 * NULL, it gets the member of that name, and each name must be plain and "value" be there once. */
static int skip_rest(cursor *in, char closing, cursor *value)
{
    skip_space(in);
    if (cursor_skip_char(in, closing))
        return 1;
    for (;;) {
        cursor name, found;
        int is_value;

        skip_space(in);
        name.at = in->at;
        if (closing == '}') {
            if (!skip_string(in))
                return 0;
            name.end = in->at;
            skip_space(in);
            if (!cursor_skip_char(in, ':'))
                return 0;
            skip_space(in);
        }
        found.at = in->at;
        if (!skip_value(in))
            return 0;
        found.end = in->at;
        if (value) {
            /* An escape could spell "value" in another way. */
            if (memchr(name.at, '\\', (size_t)(name.end - name.at)))
                return 0;
            is_value = skip_word(&name, "\"value\"");
            if (is_value && value->at)
                return 0;
            if (is_value)
                *value = found;
        }
        skip_space(in);
        if (cursor_skip_char(in, closing))
            return 1;
        if (!cursor_skip_char(in, ','))
            return 0;
    }
}

/* The depth of its calls is limited by the length of the payload. */
static int skip_value(cursor *in)
{
    if (cursor_skip_char(in, '{'))
        return skip_rest(in, '}', NULL);
    if (cursor_skip_char(in, '['))
        return skip_rest(in, ']', NULL);
    if (in->at < in->end && *in->at == '"')
        return skip_string(in);
    return skip_word(in, "true") || skip_word(in, "false") || skip_word(in, "null") ||
           cursor_skip_number(in);
}

/* --- payloads --- */

/* Returns the value in a payload: all of it without the space around it, or the member "value".
 * Without one, the result is empty. */
static cursor find_value(const char *payload, size_t length)
{
    cursor in = {payload, payload + length}, value = {NULL, NULL};

    skip_space(&in);
    while (in.at < in.end && is_space(in.end[-1]))
        in.end--;
    if (!cursor_skip_char(&in, '{'))
        return in;
    if (!skip_rest(&in, '}', &value) || in.at != in.end)
        value.at = value.end = NULL;
    return value;
}

/* Returns 0 or 1, or -1 if the value is no truth value. */
static int read_truth(cursor value)
{
    static const char *const WORDS[] = {"false", "true", "off", "on", "OFF", "ON"};
    int at;

    for (at = 0; value.at && at < 6; at++) {
        cursor in = value;

        if (skip_word(&in, WORDS[at]) && in.at == in.end)
            return at & 1;
    }
    return -1;
}

/* A date, which may be a JSON string. */
static cursor without_quotes(cursor value)
{
    if (value.at && value.end - value.at > 1 && *value.at == '"' && value.end[-1] == '"') {
        value.at++;
        value.end--;
    }
    return value;
}

uint16_t payload_parse(const value_form *form, const char *payload, size_t length,
                       uint16_t words[VALUE_WORDS], const char **wrong)
{
    static char reason[160];
    cursor value, in;
    uint16_t count = 0;

    *wrong = length > PAYLOAD_BYTES ? "the payload is too long" : NULL;
    if (*wrong)
        return 0;
    in = value = find_value(payload, length);
    if (form->type == MBM_TYPE_BIT && read_truth(value) >= 0) {
        words[0] = (uint16_t)read_truth(value);
        return 1;
    }
    if (value_is_date(form->type)) {
        value = without_quotes(value);
    } else if (!value.at || !cursor_skip_number(&in) || in.at != value.end) {
        *wrong = "the payload is no number";
        return 0;
    }
    *wrong = value.at ? conversion_check(form, value.at, (size_t)(value.end - value.at)) : NULL;
    if (!*wrong && value.at)
        count = conversion_read(form, value.at, (size_t)(value.end - value.at), words, wrong);
    if (count == 0) {
        snprintf(reason, sizeof reason, "the %s %s", value_is_date(form->type) ? "date" : "number",
                 *wrong ? *wrong : "is missing");
        *wrong = reason;
    }
    return count;
}

/* --- texts --- */

/* The number of four hexadecimal digits, which skip_escape has checked. */
static unsigned long read_hex(const char *at)
{
    char digits[5] = "";

    memcpy(digits, at, 4);
    return strtoul(digits, NULL, 16);
}

/* Takes an escape of a JSON string. Returns the character. */
static unsigned long read_escape(cursor *in)
{
    static const char LETTERS[] = "bfnrt", CONTROLS[] = "\b\f\n\r\t";
    const char letter = *in->at++;
    const char *found = strchr(LETTERS, letter);

    if (letter == 'u') {
        in->at += 4;
        return read_hex(in->at - 4);
    }
    return (unsigned char)(found ? CONTROLS[found - LETTERS] : letter);
}

/* Takes a character of UTF-8. Returns it, or a number that Latin-1 does not have. */
static unsigned long read_utf8(cursor *in)
{
    const unsigned char first = (unsigned char)*in->at++;

    if (first < 0x80)
        return first;
    if ((first != 0xC2 && first != 0xC3) || in->at == in->end ||
        ((unsigned char)*in->at & 0xC0) != 0x80)
        return 0x100;
    return (unsigned long)(first & 3) << 6 | ((unsigned char)*in->at++ & 0x3F);
}

/* Writes a text to words. A JSON string may have escapes. */
static const char *write_text(const value_form *form, uint16_t count, cursor in, int is_string,
                              uint16_t *words)
{
    static char reason[120];
    char latin[VALUE_LONGEST_TEXT + 1];
    mbm_registers registers;
    uint16_t length = 0;
    const char *wrong;

    while (in.at < in.end) {
        unsigned long one;

        if (is_string && *in.at == '\\') {
            in.at++;
            one = read_escape(&in);
        } else {
            one = read_utf8(&in);
        }
        if (one == 0)
            return "the text has a NUL, which ends a text";
        if (one > 0xFF)
            return "the text has a character that is not in Latin-1";
        if (length == count)
            return "the text is longer than the field";
        latin[length++] = (char)one;
    }
    latin[length] = '\0';
    (void)mbm_registers_intoWords(&registers, words, value_registers(form->type, count), 0);
    wrong = value_set_text(form, &registers, 0, count, latin);
    if (wrong)
        snprintf(reason, sizeof reason, "the text %s", wrong);
    return wrong ? reason : NULL;
}

static const char *read_text(const value_form *form, uint16_t count, const char *payload,
                             size_t length, uint16_t *words)
{
    cursor value = {payload, payload + length}, in;

    if (*payload == '{')
        value = find_value(payload, length);
    in = value;
    if (*payload != '{' && *payload != '"')
        return write_text(form, count, value, 0, words);
    if (!value.at || !skip_string(&in) || in.at != value.end)
        return "the payload is no text";
    value.at++;
    value.end--;
    return write_text(form, count, value, 1, words);
}

/* --- several values --- */

static const char *read_values(const value_form *form, uint16_t count, const char *payload,
                               size_t length, uint16_t *words)
{
    static char reason[200];
    cursor in = find_value(payload, length);
    const char *wrong = NULL;
    uint16_t at;

    if (in.at && cursor_skip_char(&in, '[')) {
        if (in.at < in.end && in.end[-1] == ']')
            in.end--;
        else
            in.at = NULL;
    }
    for (at = 0; in.at && at < count; at++) {
        const char *start, *end;
        uint16_t used;

        skip_space(&in);
        start = in.at;
        while (in.at < in.end && *in.at != ',')
            in.at++;
        end = in.at;
        if (start == end || *start == '{' || (in.at < in.end) != (at + 1 < count))
            break;
        used = payload_parse(form, start, (size_t)(end - start), words, &wrong);
        if (used == 0) {
            snprintf(reason, sizeof reason, "value %u: %s", at + 1, wrong);
            return reason;
        }
        words += used;
        if (at + 1 < count)
            in.at++;
    }
    if (at == count)
        return NULL;
    snprintf(reason, sizeof reason, "the payload is no list of %u values", count);
    return reason;
}

uint16_t payload_parse_all(const value_form *form, uint16_t count, const char *payload,
                           size_t length, uint16_t words[PAYLOAD_WORDS], const char **wrong)
{
    const uint16_t size = value_registers(form->type, count);

    if (count == 1 && !value_is_text(form->type))
        return payload_parse(form, payload, length, words, wrong);
    *wrong = length > PAYLOAD_LONGEST    ? "the payload is too long"
             : length == 0               ? "the payload is empty"
             : value_is_text(form->type) ? read_text(form, count, payload, length, words)
                                         : read_values(form, count, payload, length, words);
    if (*wrong)
        return 0;
    return value_is_text(form->type) ? size : (uint16_t)(size * count);
}
