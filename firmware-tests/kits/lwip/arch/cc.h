/* The compiler, for lwIP: gcc. Licence: MIT OR Apache-2.0. */
#ifndef ARCH_CC_H
#define ARCH_CC_H

#include <stdlib.h>

#define LWIP_PLATFORM_DIAG(x) ((void)0)
/* A firmware would reset; the tests fail. */
#define LWIP_PLATFORM_ASSERT(x) abort()
#define LWIP_RAND() ((u32_t)rand())
#endif
