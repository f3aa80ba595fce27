/* The test of a port: its order, its clock, its sentences. See mbm_porttest.h.
 * Licence: MIT OR Apache-2.0. */
#include "mbm_porttest_parts.h"

static uint16_t put_number(char *place, uint16_t space, uint32_t number)
{
    char digits[10];
    uint16_t count = 0, written = 0;

    do {
        digits[count++] = (char)('0' + number % 10);
        number /= 10;
    } while (number != 0);
    while (count > 0 && written < space)
        place[written++] = digits[--count];
    return written;
}

void mbm_portTest_say(mbm_portTest *test, mbm_portFinding kind, const char *words,
                      const uint32_t *numbers)
{
    const uint16_t most = sizeof test->sentence - 1;
    uint16_t length = 0;
    char character;

    while ((character = CHARACTER(words)) != '\0' && length < most) {
        words++;
        if (character == '%')
            length = (uint16_t)(length + put_number(test->sentence + length,
                                                    (uint16_t)(most - length), *numbers++));
        else
            test->sentence[length++] = character;
    }
    test->sentence[length] = '\0';
    if (kind == MBM_PORT_WRONG)
        test->wrong++;
    else if (kind == MBM_PORT_ADVICE)
        test->advice++;
    else if (kind == MBM_PORT_LEFT_OUT)
        test->leftOut++;
    if (test->say != NULL)
        test->say(test->context, kind, test->sentence);
}

const char *mbm_portFinding_name(mbm_portFinding kind)
{
    switch (kind) {
    case MBM_PORT_WRONG: return "wrong";
    case MBM_PORT_ADVICE: return "advice";
    case MBM_PORT_FACT: return "fact";
    default: return "left out";
    }
}

uint32_t mbm_portTest_now(const mbm_portTest *test)
{
    if (test->reference != NULL)
        return test->reference(test->context);
    return test->port->micros(test->port->context);
}

/* A clock that steps back is not a time of an hour. */
uint32_t mbm_portTest_since(const mbm_portTest *test, uint32_t then)
{
    const uint32_t us = mbm_portTest_now(test) - then;

    return us < UINT32_MAX / 2 ? us : 0;
}

uint32_t mbm_portTest_step(const mbm_portTest *test)
{
    return test->reference != NULL ? test->exactUs : test->stepUs;
}

/* For 5 s, and twice at least. */
uint8_t mbm_portTest_tries_again(const mbm_portTest *test, uint32_t began, uint8_t tries)
{
    return tries < 2 || (tries < TRIES && mbm_portTest_since(test, began) < 5000000u);
}

uint32_t mbm_portTest_away(const mbm_portTest *test)
{
    const uint32_t began = mbm_portTest_now(test), step = mbm_portTest_step(test);
    uint32_t before = began, longest = 0, now;

    do {
        now = mbm_portTest_now(test);
        if (now - before > longest && now - before < UINT32_MAX / 2)
            longest = now - before;
        before = now;
    } while (mbm_portTest_since(test, began) < 200000u);
    return longest > step ? longest - step : 0;
}

/* In eighths of a microsecond, so that no product is longer than 32 bits. */
uint32_t mbm_portTest_characters(const mbm_portTest *test, uint16_t count)
{
    const uint8_t bits = test->bits != 0 ? test->bits : 10;

    if (test->baud == 0)
        return 0;
    return (bits * 8000000u + test->baud / 2) / test->baud * count / 8;
}

uint8_t mbm_portTest_has_wire(const mbm_portTest *test)
{
    return test->isLooped || test->other != NULL;
}

void mbm_portTest_yield(mbm_portTest *test)
{
    uint32_t before, took;

    if (test->yield == NULL)
        return;
    before = mbm_portTest_now(test);
    test->yield(test->context);
    took = mbm_portTest_since(test, before);
    if (took > test->yieldUs)
        test->yieldUs = took;
}

/* Returns 0 if a hook is missing without which nothing can be tested. */
static uint8_t check_hooks(mbm_portTest *test)
{
    const mbm_port *port = test->port;

    test->checks++;
    if (port->read == NULL)
        SAY(test, MBM_PORT_WRONG,
            "The port has no `read`: set it to a function that returns 0 until bytes have come.");
    if (port->write == NULL)
        SAY(test, MBM_PORT_WRONG,
            "The port has no `write`: set it to a function that takes bytes and does not wait.");
    if (port->micros == NULL)
        SAY(test, MBM_PORT_WRONG,
            "The port has no `micros`: set it to a clock; a millisecond tick times 1000 will do.");
    if (port->preTransmission != NULL && port->postTransmission == NULL)
        SAY(test, MBM_PORT_WRONG,
            "The port has `preTransmission` and no `postTransmission`: the driver stays on after the first "
            "frame. Set both.");
    if (port->preTransmission == NULL && port->postTransmission != NULL)
        SAY(test, MBM_PORT_WRONG,
            "The port has `postTransmission` and no `preTransmission`: the driver never goes on. Set both.");
    return port->read != NULL && port->write != NULL && port->micros != NULL;
}

static void clear(mbm_portTest *test)
{
    test->wrong = test->advice = test->checks = test->leftOut = 0;
    test->longestBlock = 0;
    test->longestPauseUs = 0;
    test->stepUs = test->exactUs = test->yieldUs = 0;
    test->isOver = test->startsOn = 0;
}

uint16_t mbm_portTest_run(mbm_portTest *test)
{
    static void (*const checks[])(mbm_portTest *) = {
        mbm_portTest_checkRead,      mbm_portTest_checkWrite, mbm_portTest_checkFlush,
        mbm_portTest_checkWire,      mbm_portTest_checkIdle,  mbm_portTest_checkBegin,
        mbm_portTest_checkDisturbed, mbm_portTest_checkHangUp};
    uint8_t i;

    if (test == NULL || test->port == NULL)
        return 1;
    clear(test);
    if (!check_hooks(test))
        return test->wrong;
    if (test->driver != NULL)
        test->startsOn = test->driver(test->context);
    mbm_portTest_checkClock(test, 100);
    for (i = 0; i < sizeof checks / sizeof *checks && !test->isOver; i++)
        checks[i](test);
    if (i < sizeof checks / sizeof *checks)
        SAY(test, MBM_PORT_LEFT_OUT, "The checks that follow were not made.");
    return test->wrong;
}

uint16_t mbm_portTest_watchClock(mbm_portTest *test, uint32_t millis)
{
    if (test == NULL || test->port == NULL)
        return 1;
    clear(test);
    if (test->port->micros == NULL)
        return (void)check_hooks(test), test->wrong;
    mbm_portTest_checkClock(test, millis);
    return test->wrong;
}
