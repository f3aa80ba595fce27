/* The data that mbm serve serves: units whose cells come from a device file, vary at random, or
 * hold what is written. A cell is a register, a coil or a discrete input. */
#pragma once

#include "device.h"

enum served_kind { SERVED_DEVICE, SERVED_RANDOM, SERVED_ECHO };

/* A table of a unit. */
typedef struct served_cells {
    mbm_dataCallbacks callbacks;
    mbm_accessHooks hooks;
    enum served_kind kind;
    const struct served_units *owner;
    uint8_t unit, table;
    uint32_t seed, random;
    uint16_t *values;
    /* One bit for each address. Only cells of a device may be neither readable nor writable.
     * `written` are the random cells that hold what was written. */
    uint8_t *readable, *writable, *written;
    /* Of a device: the most cells of one request, 0 for as many as the standard says, and by which
     * function each cell is written. */
    uint16_t most_read, most_written;
    uint8_t *functions;
} served_cells;

/* Called for each request before it is served; returns an exception code, or 0. */
typedef struct served_hook {
    uint8_t (*before)(void *context, const mbm_request *request);
    void *context;
} served_hook;

typedef struct served_units {
    mbm_unit *units;
    uint8_t count;
    served_cells (*cells)[4]; /* the tables of each unit */
    const device *from;       /* NULL unless the units are those of a device */
    mbm_custom every_request;
    served_hook *hook;
    uint8_t asked; /* the place of the unit that the request names, 0 if it names none of them */
    mbm_serverIdentification identification;
    mbm_object objects[3];
} served_units;

/* Finds the units that the fields of a device have, in ascending order. Returns how many there are.
 */
enum { SERVED_IDS = 256 };
unsigned served_ids(const device *from, uint8_t ids[SERVED_IDS]);

/* Makes `count` units with these ids: those of a device, or others. `from` and `hook` must outlive
 * them. Returns 0, or -1 without memory. */
int served_make_device(served_units *units, const device *from, const uint8_t *ids, uint8_t count,
                       served_hook *hook);
int served_make_units(served_units *units, enum served_kind kind, const uint8_t *ids, uint8_t count,
                      served_hook *hook);
void served_free(served_units *units);

/* Returns the cells of the unit and table that a field of the device has. */
served_cells *served_cells_of(const served_units *units, const mbm_planField *planned);
