#include "model_uart.h"

#include <string.h>

static uint64_t character_ns(const model_uart *m)
{
    return m->baud == 0 ? 15625u : 10u * 1000000000ull / m->baud;
}

void model_begin(model_uart *m)
{
    m->next = m->now;
    m->first = m->leavingCount = m->pendingCount = m->heldCount = 0;
    m->isDeaf = m->fault == DEAF;
    m->isClosed = 0;
    m->isOn = m->fault == DRIVER_INVERTED;
    if (m->wire == NULL)
        m->wire = m;
}

/* --- the wire */

static void hold(model_uart *m)
{
    const uint16_t most = m->fault == HOLDS_LESS ? 100 : m->ring;

    for (uint16_t i = 0; i < m->pendingCount; i++) {
        if (m->heldCount < most) {
            m->held[m->heldCount++] = m->pending[i];
            continue;
        }
        if (m->fault != OVERRUN_UNCOUNTED)
            m->lost++;
        if (m->fault == OVERRUN_DEAF)
            m->isDeaf = 1;
    }
    m->pendingCount = 0;
}

static void arrive(model_uart *m, uint8_t byte, uint64_t at)
{
    const int hundredth = ++m->characters % 100 == 0;

    if (m->isDeaf || (m->fault == LOSES && hundredth) || (m->fault == SWALLOWS_XON && byte == 0x11))
        return;
    if (m->fault == SEVEN_BITS)
        byte &= 0x7F;
    if (m->fault == TRANSLATES && byte == '\r')
        byte = '\n';
    m->pending[m->pendingCount++] = byte;
    if (m->fault == TWICE && hundredth)
        m->pending[m->pendingCount++] = byte;
    m->arrivedAt = at;
    if (m->pendingCount >= m->block)
        hold(m);
}

/* Lets the characters leave whose time is over. */
static void work(model_uart *m)
{
    const uint64_t one = character_ns(m);

    while (m->leavingCount > 0 && m->next <= m->now) {
        if (m->holdsBack && m->wire->heldCount + m->wire->pendingCount >= m->wire->ring) {
            m->next = m->now;
            break;
        }
        const uint16_t at = m->first;

        arrive(m->wire, m->fault == WRITE_KEEPS ? *m->kept[at] : m->leaving[at], m->next);
        m->first = (uint16_t)((at + 1) % MODEL_TX);
        m->leavingCount--;
        if (m->leavingCount > 0)
            m->next += one;
        if (m->ownDriver && m->leavingCount == (m->fault == DRIVER_EARLY ? 1 : 0))
            m->isOn = 0;
    }
    if (m->pendingCount > 0 && m->fault != FULL_BLOCKS &&
        m->now - m->arrivedAt >= m->idleChars * one)
        hold(m);
}

static model_uart *called(void *context)
{
    model_uart *m = context;

    m->calls++;
    m->now += m->callNs;
    if (m->awayCalls > 0 && m->calls % m->awayCalls == 0)
        m->now += m->awayNs;
    /* One clock for both ends. */
    if (m->wire != m) {
        m->wire->now = m->now;
        work(m->wire);
    }
    work(m);
    if (m->wire != m)
        work(m->wire);
    return m;
}

static void pass_time(model_uart *m, uint64_t ns)
{
    const uint64_t until = m->now + ns;

    while (m->now < until)
        (void)called(m);
}

/* --- the port */

static int16_t port_read(void *context, uint8_t *bytes, uint16_t capacity)
{
    model_uart *m = called(context);
    uint16_t count = m->heldCount < capacity ? m->heldCount : capacity;

    if (m->isBroken && m->fault == ERROR_NEGATIVE) {
        m->isBroken = 0;
        return -1;
    }
    if (m->isClosed && m->heldCount == 0)
        return (int16_t)(m->fault == CLOSED_SILENT ? 0 : -1);
    if (m->fault == READ_OVERFLOWS && m->heldCount < 60)
        count = m->heldCount;
    if (m->heldCount == 0) {
        if (m->fault == READ_WAITS)
            pass_time(m, 1000000);
        if (m->fault == READ_ENDLESS)
            bytes[0] = m->last;
        return m->fault == READ_MINUS_ONE ? -1 : m->fault == READ_ENDLESS ? 1 : 0;
    }
    memcpy(bytes, m->held, count);
    m->last = bytes[count - 1];
    memmove(m->held, m->held + count, (size_t)(m->heldCount - count));
    m->heldCount = (uint16_t)(m->heldCount - count);
    return (int16_t)count;
}

static int16_t port_write(void *context, const uint8_t *bytes, uint16_t length)
{
    model_uart *m = called(context);
    const uint16_t space =
        (uint16_t)(m->txBuffer > m->leavingCount ? m->txBuffer - m->leavingCount : 0);
    uint16_t count = length < space ? length : space;

    if (m->fault == WRITE_LOST)
        return -1;
    if ((m->fault == WRITE_ONCE && m->isUsed && m->leavingCount == 0) ||
        (m->fault == WRITE_ALL_OR_NONE && length > 64))
        return 0;
    if (count > 0 && m->leavingCount == 0)
        m->next = m->now + character_ns(m);
    if (m->fault == WRITE_CLAIMS && count > 64)
        count = 64;
    for (uint16_t i = 0; i < count; i++) {
        const uint16_t at = (uint16_t)((m->first + m->leavingCount++) % MODEL_TX);

        m->leaving[at] = bytes[i];
        m->kept[at] = bytes + i;
    }
    m->isUsed = m->isUsed || count > 0;
    if (m->ownDriver && count > 0)
        m->isOn = 1;
    if (m->fault == WRITE_WAITS)
        pass_time(m, (m->leavingCount - 1u) * character_ns(m));
    return (int16_t)(m->fault == WRITE_CLAIMS ? length : count);
}

static uint32_t port_micros(void *context)
{
    model_uart *m = called(context);
    uint64_t us = m->now / 1000;

    if (m->fault == CLOCK_STANDS)
        return 0;
    if (m->fault == CLOCK_IN_MILLIS)
        return (uint32_t)(us / 1000);
    if (m->fault == CLOCK_WRAPS)
        return (uint32_t)(us * 72) / 72;
    if (m->fault == CLOCK_TEARS && m->calls % 1000 == 0 && us > 1000)
        us -= 1000;
    return (uint32_t)(us - us % m->stepUs);
}

static uint8_t port_flush(void *context)
{
    model_uart *m = called(context);

    if (m->flushWaits && m->leavingCount > 0) {
        while (m->leavingCount > 0)
            (void)called(m);
        m->now += m->wakesNs;
    }
    if (m->fault == FLUSH_NEVER)
        return 0;
    if (m->fault == FLUSH_AT_ONCE)
        return 1;
    if (m->fault == FLUSH_LATE)
        return m->leavingCount == 0 && m->now - m->next >= 10000000;
    return m->leavingCount == 0 || (m->fault == FLUSH_EARLY && m->leavingCount == 1);
}

static void switch_driver(void *context, uint8_t on)
{
    model_uart *m = called(context);

    if (m->fault == DRIVER_DEAD || (m->fault == DRIVER_STAYS && !on))
        return;
    m->isOn = m->fault == DRIVER_INVERTED ? !on : on;
    if (m->fault == DRIVER_WAITS)
        pass_time(m, 2000000);
}

static void driver_on(void *context)
{
    switch_driver(context, 1);
}

static void driver_off(void *context)
{
    switch_driver(context, 0);
}

static void port_idle(void *context, mbm_node *node)
{
    model_uart *m = called(context);
    const uint64_t until =
        m->now + (m->fault == IDLE_TOO_LONG ? 10000000u : 1000ull * mbm_node_pollDelay(node));

    while (m->now + m->callNs <= until && (m->heldCount == 0 || m->fault == IDLE_DEAF))
        (void)called(m);
    m->now += m->wakesNs;
}

mbm_port model_port(model_uart *m, int driver)
{
    mbm_port port = {.context = m,
                     .read = port_read,
                     .write = port_write,
                     .micros = port_micros,
                     .flush = m->isSocket || m->fault == NO_FLUSH ? NULL : port_flush,
                     .idle = port_idle};

    if (driver) {
        port.preTransmission = driver_on;
        port.postTransmission = driver_off;
    }
    return port;
}

/* --- functions for the test */

uint32_t model_lost(void *context)
{
    return called(context)->lost;
}

uint8_t model_driver(void *context)
{
    return called(context)->isOn;
}

uint8_t model_again(void *context)
{
    model_uart *m = called(context);

    if (m->fault == BEGIN_FAILS || (m->isClosed && m->fault == CLOSED_FOR_EVER))
        return 1;
    model_begin(m);
    if (m->fault == BEGIN_DEAF)
        m->isDeaf = 1;
    return 0;
}

/* A break: a zero with a framing error. */
void model_disturb(void *context)
{
    model_uart *m = called(context);

    arrive(m, 0, m->now);
    m->isBroken = 1;
    if (m->fault == ERROR_DEAF)
        m->isDeaf = 1;
}

void model_hangUp(void *context)
{
    called(context)->isClosed = 1;
}

uint32_t model_reference(void *context)
{
    return (uint32_t)(called(context)->now / 1000);
}
