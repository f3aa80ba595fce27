/* A device of the tests' own: how it reads a request frame, its three units with memory, and their
 * responses. The check of requests is the tests' own, so that mbm is not checked against itself. */
#ifndef MODEL_H
#define MODEL_H

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

enum { MODEL_UNITS = 3, MODEL_CELLS = 2048, MODEL_FIRST_UNIT = 17 };

typedef struct model {
    uint8_t coils[MODEL_UNITS][MODEL_CELLS], inputs[MODEL_UNITS][MODEL_CELLS];
    uint16_t holding[MODEL_UNITS][MODEL_CELLS], readings[MODEL_UNITS][MODEL_CELLS];
} model;

/* Fills the memory so that each register and bit differs from its neighbours. */
void model_start(model *m);

/* Carries the request out. Returns the length of the reply frame. */
size_t model_answer(model *m, const request *r, uint8_t *reply);

#endif
