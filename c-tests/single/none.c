/* What the other programs have beside the library: the line, and its hooks. */
#include "wire.h"

#include <stddef.h>

uint8_t run(void)
{
    uint8_t bytes[FRAME_BYTES];

    wire_expect(&READ, &READ_REPLY);
    (void)wire_write(NULL, READ.bytes, READ.length);
    (void)wire_read(NULL, bytes, sizeof bytes);
    wire_say(&WRITE);
    (void)wire_read(NULL, bytes, sizeof bytes);
    wire_expect(&WRITE_REPLY, NULL);
    (void)wire_write(NULL, WRITE_REPLY.bytes, WRITE_REPLY.length);
    return (uint8_t)(wire_micros(NULL) == 0 || !wire_is_done());
}
