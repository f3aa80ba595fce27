#include "machine.h"

#include <stdlib.h>
#include <string.h>

enum { COMING = 8192 };

machine m;

static struct {
    uint64_t at; /* when its last bit arrives */
    unsigned errors;
    uint8_t byte;
} coming[COMING];
static unsigned first, last;
static int shifting; /* the character that leaves, or -1 */
static uint64_t shifted, heard;
static uint8_t isIdle, wasSending;

static void look_at_driver(void)
{
    uint8_t isDriving = chip_is_driving() != 0;

    if (isDriving == m.isDriving)
        return;
    m.isDriving = isDriving;
    m.driverChanges++;
    if (isDriving)
        m.driverOn = m.now;
    else
        m.driverOff = m.now;
}

static void interrupts(void)
{
    look_at_driver();
    if (!m.isMasked)
        chip_interrupts();
    look_at_driver();
}

static void load(void)
{
    if (shifting >= 0 || (shifting = chip_next()) < 0)
        return;
    shifted = m.now + m.character;
    wasSending = 1;
    interrupts();
}

void machine_start(uint8_t receivesByDma, uint8_t sendsByDma)
{
    memset(&m, 0, sizeof m);
    m.character = 95486;
    m.now = 1000000;
    first = last = 0;
    shifting = -1;
    wasSending = 0;
    isIdle = 1;
    chip_start(receivesByDma, sendsByDma);
    m.isDriving = chip_is_driving() != 0;
}

static void put(uint64_t at, uint8_t byte, unsigned errors)
{
    if (last == COMING)
        abort();
    coming[last].at = at;
    coming[last].byte = byte;
    coming[last].errors = errors;
    last++;
}

static uint64_t free_at(void)
{
    if (first == last)
        first = last = 0;
    return first < last && coming[last - 1].at > m.now ? coming[last - 1].at : m.now;
}

void machine_receive(const uint8_t *bytes, unsigned count, uint32_t silenceUs)
{
    uint64_t at = free_at() + 1000u * (uint64_t)silenceUs;

    while (count-- > 0)
        put(at += m.character, *bytes++, NONE);
}

void machine_receive_faulty(uint8_t byte, unsigned errors)
{
    put(free_at() + m.character, byte, errors);
}

unsigned machine_coming(void)
{
    return last - first;
}

static void arrive(void)
{
    uint8_t byte = coming[first].byte;
    unsigned errors = coming[first].errors;

    first++;
    heard = m.now;
    isIdle = 0;
    /* Both drive the wire, and the receiver is off. */
    if (m.isDriving && !m.isLooped) {
        m.collisions++;
        return;
    }
    chip_receive(byte, errors);
}

static void leave(void)
{
    if (m.sentCount == MACHINE_SENT)
        abort();
    m.undriven += !m.isDriving;
    m.sent[m.sentCount] = (uint8_t)shifting;
    m.sentAt[m.sentCount++] = m.now;
    if (m.isLooped) {
        heard = m.now;
        isIdle = 0;
        chip_receive((uint8_t)shifting, NONE);
    }
    shifting = -1;
    load();
    if (shifting < 0 && wasSending) {
        wasSending = 0;
        chip_sent();
    }
    interrupts();
    if (m.device)
        m.device();
}

void machine_run(uint32_t micros)
{
    uint64_t end = m.now + 1000u * (uint64_t)micros;

    interrupts();
    for (;;) {
        uint64_t next = end;

        load();
        if (shifting >= 0 && shifted < next)
            next = shifted;
        if (first < last && coming[first].at < next)
            next = coming[first].at;
        if (!isIdle && heard + m.character < next)
            next = heard + m.character;
        m.now = next;
        chip_clock();
        if (next == end)
            break;
        if (shifting >= 0 && shifted == next)
            leave();
        else if (first < last && coming[first].at == next)
            arrive();
        else if (!isIdle && heard + m.character == next) {
            isIdle = 1;
            chip_idle();
        }
        interrupts();
    }
    interrupts();
}
