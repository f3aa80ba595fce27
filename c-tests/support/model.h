/* A device of the tests' own: three units with memory, and their responses. */
#ifndef MODEL_H
#define MODEL_H

#include "request.h"

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
