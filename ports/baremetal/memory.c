/* The functions that compilers call by themselves, for programs without a C
 * library. Compile this file with -fno-tree-loop-distribute-patterns, or the compiler turns
 * the loops into calls of these same functions.
 * Licence: MIT OR Apache-2.0. */
#include <stddef.h>

void *memcpy(void *restrict to, const void *restrict from, size_t length);
void *memmove(void *to, const void *from, size_t length);
void *memset(void *to, int value, size_t length);
int memcmp(const void *left, const void *right, size_t length);

void *memcpy(void *restrict to, const void *restrict from, size_t length)
{
    unsigned char *out = to;
    const unsigned char *in = from;

    while (length-- > 0) {
        *out++ = *in++;
    }
    return to;
}

void *memmove(void *to, const void *from, size_t length)
{
    unsigned char *out = to;
    const unsigned char *in = from;

    if (out < in) {
        return memcpy(to, from, length);
    }
    while (length-- > 0) {
        out[length] = in[length];
    }
    return to;
}

void *memset(void *to, int value, size_t length)
{
    unsigned char *out = to;

    while (length-- > 0) {
        *out++ = (unsigned char)value;
    }
    return to;
}

int memcmp(const void *left, const void *right, size_t length)
{
    const unsigned char *a = left, *b = right;

    for (; length > 0u; length--, a++, b++) {
        if (*a != *b) {
            return *a - *b;
        }
    }
    return 0;
}

#if defined(__arm__)
/* Their names in Arm's run-time ABI. The digit is the alignment of both pointers. */
void __aeabi_memcpy(void *to, const void *from, size_t length);
void __aeabi_memcpy4(void *to, const void *from, size_t length);
void __aeabi_memcpy8(void *to, const void *from, size_t length);
void __aeabi_memmove(void *to, const void *from, size_t length);
void __aeabi_memmove4(void *to, const void *from, size_t length);
void __aeabi_memset(void *to, size_t length, int value);
void __aeabi_memset4(void *to, size_t length, int value);
void __aeabi_memclr(void *to, size_t length);
void __aeabi_memclr4(void *to, size_t length);
void __aeabi_memclr8(void *to, size_t length);

void __aeabi_memcpy(void *to, const void *from, size_t length)
{
    (void)memcpy(to, from, length);
}

void __aeabi_memcpy4(void *to, const void *from, size_t length)
{
    (void)memcpy(to, from, length);
}

void __aeabi_memcpy8(void *to, const void *from, size_t length)
{
    (void)memcpy(to, from, length);
}

void __aeabi_memmove(void *to, const void *from, size_t length)
{
    (void)memmove(to, from, length);
}

void __aeabi_memmove4(void *to, const void *from, size_t length)
{
    (void)memmove(to, from, length);
}

void __aeabi_memset(void *to, size_t length, int value)
{
    (void)memset(to, value, length);
}

void __aeabi_memset4(void *to, size_t length, int value)
{
    (void)memset(to, value, length);
}

void __aeabi_memclr(void *to, size_t length)
{
    (void)memset(to, 0, length);
}

void __aeabi_memclr4(void *to, size_t length)
{
    (void)memset(to, 0, length);
}

void __aeabi_memclr8(void *to, size_t length)
{
    (void)memset(to, 0, length);
}
#endif
