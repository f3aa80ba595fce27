/* Refuses and drops requests as devices of the field do.
 *
 * Licence: MIT OR Apache-2.0. */
#include "fault_device.h"

#include "clock.h"

/* Addresses that a request reads or writes. */
typedef struct block {
    uint16_t address, quantity;
    uint8_t is_bits;
} block;

static uint16_t word_at(const mbm_request *request, uint16_t at)
{
    return at + 2 <= request->length ? (uint16_t)(request->data[at] << 8 | request->data[at + 1])
                                     : 0;
}

/* Finds the blocks of a request, at most two. Returns how many there are. */
static int find_blocks(const mbm_request *request, block blocks[2])
{
    const uint16_t first = word_at(request, 0), second = word_at(request, 2);

    switch (request->function) {
    case 1:
    case 2:
    case 15: blocks[0] = (block){first, second, 1}; return 1;
    case 3:
    case 4:
    case 16: blocks[0] = (block){first, second, 0}; return 1;
    case 5: blocks[0] = (block){first, 1, 1}; return 1;
    case 6:
    case 22: blocks[0] = (block){first, 1, 0}; return 1;
    case 23:
        blocks[0] = (block){first, second, 0};
        blocks[1] = (block){word_at(request, 4), word_at(request, 6), 0};
        return 2;
    default: return 0;
    }
}

/* Whether a fault of the device refuses a block. */
static int refuses_block(const fault *one, const block *of)
{
    switch (one->kind) {
    case FAULT_MOST_REGISTERS: return !of->is_bits && of->quantity > one->value;
    case FAULT_MOST_BITS: return of->is_bits && of->quantity > one->value;
    case FAULT_HOLE:
        return of->address <= one->last && (uint32_t)of->address + of->quantity > one->value;
    default: return 0;
    }
}

/* Returns the exception of a request for a function that the device does not have, or for a block
 * that it refuses; else 0. */
static uint8_t refusal_of(const fault_device *device, const fault_choice *chosen,
                          const mbm_request *request)
{
    const fault_list *list = &device->list;
    int is_missing = 0, is_allowed = !chosen->has[FAULT_ONLY_FUNCTION], is_refused = 0, j;
    block blocks[2];
    const int count = find_blocks(request, blocks);
    uint32_t i;

    for (i = 0; i < list->count; i++) {
        const fault *one = &list->faults[i];
        const int is_of_function = one->value == request->function;

        if (!fault_is_due(list, one))
            continue;
        is_allowed |= one->kind == FAULT_ONLY_FUNCTION && is_of_function;
        is_missing |= one->kind == FAULT_NO_FUNCTION && is_of_function;
        for (j = 0; j < count; j++)
            is_refused |= refuses_block(one, &blocks[j]);
    }
    if (is_missing || !is_allowed)
        return MBM_ILLEGAL_FUNCTION;
    if (is_refused)
        return chosen->has[FAULT_REFUSED_WITH] ? (uint8_t)chosen->value[FAULT_REFUSED_WITH]
                                               : MBM_ILLEGAL_DATA_ADDRESS;
    return 0;
}

/* Whether the request came too early: after the connection was made, or after the last bytes. */
static int is_early(const fault_device *device, const fault_port *port, int64_t began)
{
    const int64_t delay = (int64_t)port->chosen.value[FAULT_NEEDS_DELAY] * 1000,
                  wait = (int64_t)port->chosen.value[FAULT_NEEDS_MESSAGE_WAIT] * 1000;

    return (delay && began - port->openedUs < delay) || (wait && began - device->quietUs < wait);
}

static int is_answering_another(const fault_device *device, const fault_port *port)
{
    return device->answering && device->answering != port &&
           fault_port_is_waiting(device->answering) &&
           fault_value(&device->list, FAULT_ONE_REQUEST);
}

/* Whether a fault was chosen that changes any answer: those up to FAULT_TRANSACTION do. */
static int is_hit(const fault_choice *chosen)
{
    int kind;

    for (kind = FAULT_LATE; kind <= FAULT_TRANSACTION; kind++)
        if (chosen->has[kind])
            return 1;
    return 0;
}

uint8_t fault_device_take(fault_device *device, const mbm_request *request)
{
    fault_port *port = (fault_port *)request->connection;
    const int64_t now = (int64_t)clock_micros(CLOCK_MONOTONIC);
    const int64_t began = port->beganUs ? port->beganUs : port->activeUs;
    const uint32_t deaf_after = fault_value(&device->list, FAULT_DEAF_AFTER);
    const int is_deaf = deaf_after && port->answers >= deaf_after;
    uint8_t exception;
    int drops;

    device->list.requests++;
    fault_choose(&device->list, &port->chosen);
    drops = is_deaf || is_early(device, port, began) || is_answering_another(device, port);
    port->beganUs = 0;
    device->quietUs = now;
    exception = (uint8_t)port->chosen.value[FAULT_EXCEPTION];
    if (drops) {
        exception = MBM_SERVER_DEVICE_BUSY;
        port->chosen.has[FAULT_DEAF] |= is_deaf || !fault_value(&device->list, FAULT_BUSY);
    } else if (exception == 0) {
        exception = refusal_of(device, &port->chosen, request);
    }
    device->list.hit += drops || exception || is_hit(&port->chosen);
    return exception;
}
