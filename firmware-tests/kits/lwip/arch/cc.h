/* The compiler, for lwIP: gcc. Licence: MIT OR Apache-2.0. */
#ifndef ARCH_CC_H
#define ARCH_CC_H

#include <stdlib.h>

#define LWIP_PLATFORM_DIAG(x) ((void)0)
/* A firmware would reset; the tests fail. */
#define LWIP_PLATFORM_ASSERT(x) abort()
#define LWIP_RAND() ((u32_t)rand())
/* The C library of this machine has these, so lwIP leaves them out. */
#ifdef __linux__
#define LWIP_TIMEVAL_PRIVATE 0
#include <limits.h>
#include <sys/time.h>
#endif

#endif
