/* How a device reads a request frame. The check is the tests' own, so that mbm is not
 * checked against itself. */
#ifndef REQUEST_H
#define REQUEST_H

#include <stddef.h>
#include <stdint.h>

typedef struct request {
    uint8_t unit, function;
    uint16_t address, quantity; /* what is read; the quantity of a single register or bit is 1 */
    uint16_t write_address, written; /* what is written */
    uint16_t value, or_mask;         /* 05, 06; 16: value is the AND mask */
    const uint8_t *data;
} request;

/* The length of the frame that begins with these bytes: 0 if more bytes are needed, -1 if
 * no request begins so. */
int request_size(const uint8_t *frame, size_t have);

/* Returns 1 if the frame is a complete request with a right CRC that the standard allows.
 * Then `r` has its fields. */
int request_parse(request *r, const uint8_t *frame, size_t length);

static inline uint16_t be16(const uint8_t *bytes)
{
    return (uint16_t)(bytes[0] << 8 | bytes[1]);
}

#endif
