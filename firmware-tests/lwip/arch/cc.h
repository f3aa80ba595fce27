/* What lwIP asks of a compiler and a board. */
#ifndef CC_H
#define CC_H

void mps2_assert(const char *file, int line);
unsigned board_random(void);

#define LWIP_PLATFORM_DIAG(x)
#define LWIP_PLATFORM_ASSERT(x) mps2_assert(__FILE__, __LINE__)
#define LWIP_RAND() board_random()

#endif
