/* Plays the boot ROM of the RP2040 for the emulator: the lookup of functions, and those that
 * programs call without being asked, by the tables of the RP2040's datasheet (2.8.3). The chip's
 * own ROM is not in this repository. */
#include <stdint.h>

typedef uintptr_t word;

static uint8_t *set_bytes(uint8_t *to, uint8_t byte, uint32_t n)
{
    while (n-- > 0)
        to[n] = byte;
    return to;
}

static uint8_t *copy_bytes(uint8_t *to, const uint8_t *from, uint32_t n)
{
    for (uint32_t i = 0; i < n; i++)
        to[i] = from[i];
    return to;
}

static uint32_t count_leading_zeros(uint32_t value)
{
    uint32_t n = 0;

    for (; n < 32 && !(value >> 31); n++)
        value <<= 1;
    return n;
}

static uint32_t count_trailing_zeros(uint32_t value)
{
    uint32_t n = 0;

    for (; n < 32 && !(value & 1); n++)
        value >>= 1;
    return n;
}

static uint32_t count_ones(uint32_t value)
{
    uint32_t n = 0;

    for (; value; value &= value - 1)
        n++;
    return n;
}

static uint32_t reverse(uint32_t value)
{
    uint32_t reversed = 0;

    for (int i = 0; i < 32; i++, value >>= 1)
        reversed = reversed << 1 | (value & 1);
    return reversed;
}

enum { MS, S4, MC, C4, L3, T3, P3, R3, COUNT };
static const uint16_t codes[COUNT] = {'M' | 'S' << 8, 'S' | '4' << 8, 'M' | 'C' << 8,
                                      'C' | '4' << 8, 'L' | '3' << 8, 'T' | '3' << 8,
                                      'P' | '3' << 8, 'R' | '3' << 8};
static const word functions[COUNT] = {(word)set_bytes,           (word)set_bytes,
                                      (word)copy_bytes,          (word)copy_bytes,
                                      (word)count_leading_zeros, (word)count_trailing_zeros,
                                      (word)count_ones,          (word)reverse};

/* The table has no content here: the lookup is a function of the ROM too. */
/* The first 32 bytes: stack, entry, and halfwords at 0x14 with the tables and the lookup. */
__attribute__((section(".head"), used, naked)) void head(void)
{
    __asm__(".word 0x20041f00, 1, 1, 1\n"
            ".byte 'M', 'u', 1, 3\n"
            ".hword table, table, find, 0\n"
            ".balign 4\ntable: .word 0\n"
            ".thumb_func\nfind: b lookup_code\n");
}

/* The table is empty: only this function looks into it. */
__attribute__((used)) word lookup_code(const void *table, uint32_t code)
{
    (void)table;
    for (unsigned i = 0; i < COUNT; i++)
        if (codes[i] == code)
            return functions[i];
    return 0;
}
