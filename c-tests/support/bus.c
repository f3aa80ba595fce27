#include "bus.h"
#include "test.h"

static int16_t read_bytes(void *context, uint8_t *bytes, uint16_t capacity)
{
    bus_tap *tap = (bus_tap *)context;
    bus *b = tap->line;
    uint16_t count = 0;

    while (count < capacity && tap->next < b->count && b->bytes[tap->next].end <= b->now) {
        unsigned at = tap->next++;

        /* A tap does not receive its own bytes, as with a driver that turns the receiver off. */
        if (b->bytes[at].from != tap)
            bytes[count++] = b->bytes[at].garbled ? b->bytes[at].byte ^ 0x5A : b->bytes[at].byte;
    }
    return (int16_t)count;
}

static void put(bus_tap *tap, uint8_t byte)
{
    bus *b = tap->line;
    uint64_t begin = tap->free > b->now ? tap->free : b->now;
    uint64_t end = begin + BUS_CHARACTER;
    unsigned place;
    uint8_t garbled = 0;

    for (unsigned i = b->count; i > 0 && b->bytes[i - 1].end > begin; i--) {
        if (b->bytes[i - 1].from != tap && b->bytes[i - 1].end - BUS_CHARACTER < end) {
            b->collisions += !b->bytes[i - 1].garbled;
            b->bytes[i - 1].garbled = garbled = 1;
        }
    }
    b->collisions += garbled;
    assert_true(b->count < BUS_BYTES);
    /* Inserts the byte in the order of end times: after every byte that a tap has received. */
    for (place = b->count++; place > 0 && b->bytes[place - 1].end > end; place--)
        b->bytes[place] = b->bytes[place - 1];
    b->bytes[place].end = end;
    b->bytes[place].from = tap;
    b->bytes[place].byte = byte;
    b->bytes[place].garbled = garbled;
    tap->free = end;
}

static int16_t send(void *context, const uint8_t *bytes, uint16_t length)
{
    for (uint16_t i = 0; i < length; i++)
        put((bus_tap *)context, bytes[i]);
    return (int16_t)length;
}

static uint8_t flush(void *context)
{
    const bus_tap *tap = (const bus_tap *)context;

    return tap->line->now >= tap->free;
}

static uint32_t micros(void *context)
{
    const bus_tap *tap = (const bus_tap *)context;

    return (uint32_t)(tap->clock_start + tap->line->now);
}

void bus_start(bus *b)
{
    memset(b, 0, sizeof *b);
}

mbm_port bus_port(bus *b, uint32_t clock_start)
{
    bus_tap *tap = &b->taps[b->tap_count++];
    mbm_port port = {0};

    assert_true(b->tap_count <= BUS_TAPS);
    tap->line = b;
    tap->clock_start = clock_start;
    port.context = tap;
    port.read = read_bytes;
    port.write = send;
    port.micros = micros;
    port.flush = flush;
    return port;
}
