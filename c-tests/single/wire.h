/* What the programs of scripts/check/single share: a line whose other end says known bytes, and
 * expects known bytes. */
#ifndef WIRE_H
#define WIRE_H

#include <stdint.h>

enum { UNIT = 17, FIRST = 107, COUNT = 2, FRAME_BYTES = 256 };

typedef struct {
    const uint8_t *bytes;
    uint8_t length;
} wire_frame;

/* Reads registers 107 and 108, which are 0x1234 and 0x5678. */
extern const wire_frame READ, READ_REPLY;
/* Writes 0x9ABC and 0xDEF0 to them. */
extern const wire_frame WRITE, WRITE_REPLY;

/* The other end says this now. */
void wire_say(const wire_frame *said);

/* The program must write these bytes; then the other end says `reply`, unless that is NULL. */
void wire_expect(const wire_frame *expected, const wire_frame *reply);

/* Returns whether all expected bytes were written, and no other, and all that was said was read. */
uint8_t wire_is_done(void);

int16_t wire_read(void *context, uint8_t *bytes, uint16_t capacity);
int16_t wire_write(void *context, const uint8_t *bytes, uint16_t length);

/* A clock that each look advances. */
uint32_t wire_micros(void *context);

/* The program: returns 0 if all is right, or else the number of the step that is not. */
uint8_t run(void);

#endif
