/* Xtensa's simulator calls. Licence: MIT OR Apache-2.0. */
#ifndef SIMCALL_H
#define SIMCALL_H

#include <stdint.h>

enum { SIMCALL_EXIT = 1, SIMCALL_READ = 3, SIMCALL_WRITE = 4, SIMCALL_OPEN = 5 };

/* A function of one instruction. It is in the start-up assembly, since the arguments and
 * the result are already in the right registers. */
int32_t simcall(int32_t number, int32_t first, int32_t second, int32_t third);

#endif
