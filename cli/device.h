/* A device: its fields and what each of them is, as a device file says. */
#pragma once

#include "conversion.h"
#include "reach.h"
#include "value.h"
#include "yaml_file.h"

/* What a field allows. */
enum { DEVICE_READ = 1, DEVICE_WRITE = 2 };

/* By which function a field is written: 05 or 06 if one request of these can do it, else 0F or 10;
 * always 05 or 06; always 0F or 10. */
enum { DEVICE_BY_SIZE, DEVICE_SINGLE, DEVICE_MULTIPLE };
/* The words for the last two. NULL ends them. */
extern const char *const device_functions[];

/* How the file writes addresses: as on the wire, from 1 on, or as 40101. */
enum { DEVICE_ON_WIRE, DEVICE_ONE_BASED, DEVICE_MODICON };

/* What one request may do, and which addresses none may read. */
typedef struct device_limits {
    uint16_t read_registers, read_bits, write_registers, write_bits; /* 0: as the standard says */
    uint16_t register_gap, bit_gap;
    mbm_planExcludedRange *excluded;
    uint8_t excluded_count;
} device_limits;

/* Bytes of the longest name; the greatest power of ten that a device has for a number. */
enum { DEVICE_NAME_BYTES = 200, DEVICE_POWER = 10 };

/* A number of an enumeration and its name. */
typedef struct device_label {
    char *name;
    char *number;                /* as in the file */
    uint16_t words[VALUE_WORDS]; /* as in the registers; of bits the number */
    int line;                    /* of the file */
} device_label;

typedef struct device_field {
    char *name;
    char *topic, *identifier;  /* what the name becomes elsewhere: see names.h */
    char *unit_of_measurement; /* NULL if the file gives none */
    char *description;         /* NULL if the file gives none */
    char *layout;              /* of a date; NULL without one. `form` has it too */
    value_form form;
    uint8_t access;         /* DEVICE_READ, DEVICE_WRITE or both */
    uint8_t write_function; /* DEVICE_BY_SIZE, DEVICE_SINGLE or DEVICE_MULTIPLE */
    uint16_t *words;        /* its value: as many as device_size; NULL if the file gives none */
    device_label *labels;
    uint16_t label_count;
    /* For Home Assistant; see home.h. */
    const char *device_class; /* NULL: that of the unit of measurement; "none" for none */
    uint8_t has_state_class, state_class;
    char *press;          /* what a button writes; NULL: it is none */
    int line, scale_line; /* of the file */
    /* What its numbers mean beyond the scale; NULL for nothing. `form` has it too. */
    conversion *conversion;
    /* The name and the index of the field that has its power of ten; NULL and -1 without one. The
     * scale of `form` is then the power that the file gives that field. */
    char *power_name, *power_plain; /* as in the file; in a repetition without its number too */
    int power_field;
    uint8_t is_power;       /* it is the power of ten of another field */
    const void *late_value; /* for device_file.c */
} device_field;

typedef struct device {
    char *name; /* NULL if the file gives none */
    /* The fields that can be read come first; the order of the file is kept otherwise. */
    uint16_t count, readable;
    uint8_t writes_masks; /* the device has function 22, by which bits of a register are written */
    device_field *fields;
    mbm_planField *planned; /* the same fields for mbm_plan_begin */
    device_limits limits;
    uint8_t notation; /* DEVICE_ON_WIRE, DEVICE_ONE_BASED or DEVICE_MODICON */
    reach reach;      /* what the device needs */
} device;

/* Reads a device file, of which docs/device-file.md describes every key. Returns CODE_DONE;
 * device_free frees the device. Otherwise returns CODE_SYSTEM or CODE_WRONG, and sets `wrong` to a
 * sentence without its full stop: "meter.yaml:12: ...". */
int device_file_read(device *into, const char *path, char wrong[YAML_FILE_WRONG_BYTES]);

/* Frees all that a device has. */
void device_free(device *into);

/* Returns the index of the field with this topic, or -1. */
int device_find(const device *from, const char *topic);

/* Returns the name that an enumeration has for a value of a field, or NULL. `words` are those of
 * the registers; the value of bits is their number. */
const char *device_label_of(const device *from, uint16_t field, const uint16_t *words);

/* Whether a table has bits, and not registers. */
int device_is_of_bits(uint8_t table);

/* Returns how many registers or bits a field has. */
uint32_t device_size(const mbm_planField *planned);

/* Returns how many values a field has: several numbers in a row or bits of a table; otherwise 1. */
uint16_t device_values_in(const mbm_planField *planned);

/* Returns whether a field is bits of one register, or of several; and which bits of its nth
 * register a field has: only such a field has not all. */
int device_is_part(const mbm_planField *planned);
int device_is_wide_part(const mbm_planField *planned);
uint16_t device_mask(const mbm_planField *planned, uint32_t nth);

/* Returns the field of the plan that reads a field of a device: registers as they are, if the plan
 * does not know its type or order. */
mbm_planField device_read_as(const mbm_planField *planned);

/* Returns the word of a register that has this number in the bits of a field. */
uint16_t device_part(const mbm_planField *planned, uint16_t bits);

/* Returns the form of bits as one number, whose conversion is that of the form of their field: a
 * bit, or a whole number if they are several bits of a register. */
value_form device_bits_form(const mbm_planField *planned, const value_form *own);

/* Reads the power of ten that the field `power` has in registers, and sets the scale to it. Returns
 * 0 if it has none, or one beyond DEVICE_POWER; `scale` stays then. */
int device_scale(const device *of, uint16_t power, const mbm_registers *registers,
                 value_scale *scale);

/* Returns an address as the file writes addresses, in a buffer that the fourth next call of `say`
 * overwrites. */
const char *device_address_text(const device *of, uint8_t table, uint32_t address);

/* Returns the most registers or bits of a table that one request writes. */
uint16_t device_most_written(const device *of, uint8_t table);
