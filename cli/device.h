/* The device file: the fields of a device, as mbm poll, mbm serve, mbm bridge and mbm header read
 * them.
 *
 *     device: SDM120
 *     unit: 1
 *     fields:
 *       - name: voltage
 *         table: input
 *         address: 0
 *         type: float
 *
 * docs/serve.md describes every key.
 *
 * Licence: MIT OR Apache-2.0. */
#ifndef DEVICE_H
#define DEVICE_H

#include "value.h"

/* What a field allows. */
enum { DEVICE_READ = 1, DEVICE_WRITE = 2 };

/* Bytes of the longest name of a field, and of the longest reason why a file is refused. */
enum { DEVICE_NAME_BYTES = 200, DEVICE_WRONG_BYTES = 600 };

/* A number of an enumeration and its name. */
typedef struct device_label {
    char *name;
    char *number;                /* as in the file */
    uint16_t words[VALUE_WORDS]; /* as in the registers; of bits the number */
    int line;                    /* of the file */
} device_label;

typedef struct device_field {
    char *name;
    char *unit_of_measurement; /* NULL if the file gives none */
    char *description;         /* NULL if the file gives none */
    value_form form;
    uint8_t access;  /* DEVICE_READ, DEVICE_WRITE or both */
    uint16_t *words; /* its value: as many as device_size; NULL if the file gives none */
    device_label *labels;
    uint16_t label_count;
    int line, scale_line; /* of the file */
} device_field;

typedef struct device {
    char *name; /* NULL if the file gives none */
    /* The fields that can be read come first; the order of the file is kept otherwise. */
    uint16_t count, readable;
    uint8_t writes_masks; /* the device has function 22, by which bits of a register are written */
    device_field *fields;
    mbm_planField *planned; /* the same fields for mbm_plan_begin */
    char wrong[DEVICE_WRONG_BYTES];
} device;

/* Reads a file. Returns CODE_DONE; or CODE_SYSTEM or CODE_WRONG with the reason in `wrong`, a
 * sentence without its full stop: "meter.yaml:12: ...". Then nothing is to be freed. */
int device_read(device *into, const char *path);

/* Frees what device_read allocated. */
void device_free(device *into);

/* Returns the index of the field with this name, or -1. */
int device_find(const device *from, const char *name);

/* Returns the name that an enumeration has for a value of a field: its words as in the registers,
 * of bits the number. NULL if there is none. */
const char *device_label_of(const device *from, uint16_t field, const uint16_t *words);

/* Returns how many registers or bits a field has. */
uint32_t device_size(const mbm_planField *planned);

/* Returns whether a field is bits of one register, and which bits of its words a field has: all but
 * of such a field. */
int device_is_part(const mbm_planField *planned);
uint16_t device_mask(const mbm_planField *planned);

/* Returns the word of a register in which the bits of a field are this number. */
uint16_t device_part(const mbm_planField *planned, uint16_t bits);

#endif
