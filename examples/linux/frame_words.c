/* An RTU frame in words. Licence: MIT OR Apache-2.0. */
#include "frame_words.h"

#include "mbm.h"

#include <stdarg.h>
#include <stdio.h>

/* A line that grows; what does not fit is left out. */
typedef struct line {
    char *text;
    size_t size;
    size_t used;
} line;

#ifdef __GNUC__
__attribute__((format(printf, 2, 3)))
#endif
static void say(line *l, const char *format, ...)
{
    va_list arguments;
    int more;

    va_start(arguments, format);
    more = vsnprintf(l->text + l->used, l->size - l->used, format, arguments);
    va_end(arguments);
    if (more > 0)
        l->used += (size_t)more;
    if (l->used >= l->size)
        l->used = l->size - 1;
}

static const char *function_name(uint8_t function)
{
    switch (function) {
    case 0x01: return "read coils";
    case 0x02: return "read discrete inputs";
    case 0x03: return "read holding registers";
    case 0x04: return "read input registers";
    case 0x05: return "write single coil";
    case 0x06: return "write single register";
    case 0x0F: return "write multiple coils";
    case 0x10: return "write multiple registers";
    case 0x16: return "mask write register";
    case 0x17: return "read/write multiple registers";
    default: return "unknown function";
    }
}

static unsigned word_at(const uint8_t *bytes)
{
    return (unsigned)bytes[0] << 8 | bytes[1];
}

static void say_registers(line *l, const uint8_t *data, size_t bytes)
{
    size_t i;

    for (i = 0; i + 1 < bytes; i += 2)
        say(l, " %04X", word_at(data + i));
}

static void say_bits(line *l, const uint8_t *data, size_t bytes)
{
    size_t i;

    for (i = 0; i < bytes; i++)
        say(l, " %02X", data[i]);
}

/* What stands behind unit and function; the first two words are there. */
static void say_request(line *l, uint8_t function, const uint8_t *body, size_t length)
{
    say(l, " at %u", word_at(body));
    switch (function) {
    case 0x05:
        say(l, ": %s", word_at(body + 2) == 0xFF00 ? "on" : "off");
        break;
    case 0x06:
        say(l, ": %04X", word_at(body + 2));
        break;
    case 0x0F:
        say(l, ", quantity %u:", word_at(body + 2));
        say_bits(l, body + 5, length > 5 ? length - 5 : 0);
        break;
    case 0x10:
        say(l, ", quantity %u:", word_at(body + 2));
        say_registers(l, body + 5, length > 5 ? length - 5 : 0);
        break;
    case 0x16:
        say(l, ": AND %04X, OR %04X", word_at(body + 2), length > 5 ? word_at(body + 4) : 0);
        break;
    case 0x17:
        say(l, ", quantity %u", word_at(body + 2));
        if (length > 9) {
            say(l, "; write at %u, quantity %u:", word_at(body + 4), word_at(body + 6));
            say_registers(l, body + 9, length - 9);
        }
        break;
    default:
        say(l, ", quantity %u", word_at(body + 2));
    }
}

static void say_reply(line *l, uint8_t function, const uint8_t *body, size_t length)
{
    switch (function) {
    case 0x01:
    case 0x02:
        say(l, ":");
        say_bits(l, body + 1, length - 1);
        break;
    case 0x03:
    case 0x04:
    case 0x17:
        say(l, ":");
        say_registers(l, body + 1, length - 1);
        break;
    case 0x0F:
    case 0x10:
        if (length >= 4)
            say(l, " at %u, quantity %u", word_at(body), word_at(body + 2));
        break;
    default:
        if (length >= 4)
            say_request(l, function, body, length);
    }
}

/* The CRC-16 of serial line guide V1.02, 6.2.2; 0 over a frame and its CRC. */
static uint16_t crc16(const uint8_t *bytes, size_t length)
{
    uint16_t crc = 0xFFFF;
    size_t i;
    int bit;

    for (i = 0; i < length; i++) {
        crc ^= bytes[i];
        for (bit = 0; bit < 8; bit++)
            crc = (uint16_t)(crc & 1 ? crc >> 1 ^ 0xA001 : crc >> 1);
    }
    return crc;
}

void frame_words(char *text, size_t size, frame_direction direction, const uint8_t *frame,
                 size_t length)
{
    line l = {text, size, 0};
    const uint8_t *body;
    size_t body_length;

    if (length < 5) {
        say(&l, "too short for a frame");
        return;
    }
    body = frame + 2;
    body_length = length - 4;
    say(&l, "unit %u, %s", frame[0], function_name(frame[1] & 0x7F));
    if (frame[1] & 0x80)
        say(&l, ", %s", mbm_statusText(body[0]));
    else if (direction == FRAME_REPLY)
        say_reply(&l, frame[1], body, body_length);
    else if (body_length >= 4)
        say_request(&l, frame[1], body, body_length);
    say(&l, "; CRC %s", crc16(frame, length) == 0 ? "right" : "wrong");
}
