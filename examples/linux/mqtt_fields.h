/* The file of fields of mqtt_bridge. Each line is one field:
 *
 *     # name   unit table    address type   interval  options
 *     voltage  17   holding  0       uint16 1000      scale=0.1
 *     relay    17   coil     3       bit    1000      write
 *
 * name: the last part of the topic. table: coil, discrete, holding or input. address: as on the
 * wire, decimal or 0x and hexadecimal. type: bit, uint16, int16, uint32, int32, uint64, int64,
 * float, double or text. interval: milliseconds.
 *
 * options: scale=NUMBER (the value is the register's number times this decimal number), order=ABCD,
 * CDAB, BADC or DCBA (ABCD if left out), count=NUMBER (values, or characters of a text), write
 * (MQTT may write the field).
 *
 * Licence: MIT OR Apache-2.0. */
#ifndef MQTT_FIELDS_H
#define MQTT_FIELDS_H

#include "mbm.h"

/* The factor of an option scale=NUMBER: (-)digits * 10^exponent, exactly; 1 without the option. */
typedef struct mqtt_scale {
    uint64_t digits;
    long exponent;
    double value; /* the same, rounded */
    uint8_t is_negative;
} mqtt_scale;

/* The most levels of a field's name: a/b/c has three. And the most bytes of it. */
enum { MQTT_LEVELS = 8, MQTT_LONGEST_NAME = 200 };

typedef struct mqtt_field {
    char *name;
    mqtt_scale scale;
    uint8_t is_scaled;
    uint8_t is_writable;
} mqtt_field;

typedef struct mqtt_fields {
    uint16_t count;
    mqtt_field *fields;     /* an array of `count` elements */
    mbm_planField *planned; /* the same fields for mbm_plan_begin */
    int *lines;             /* the number of each field's line in the file */
} mqtt_fields;

/* Reads a file. Returns 0, or -1 after printing the line and the reason to stderr. */
int mqtt_fields_read(mqtt_fields *fields, const char *path);

/* Returns the index of the field with this name, or -1. */
int mqtt_fields_find(const mqtt_fields *fields, const char *name);

/* Frees what mqtt_fields_read allocated. */
void mqtt_fields_free(mqtt_fields *fields);

#endif
