/* Xtensa's simulator calls. Licence: MIT OR Apache-2.0. */
#ifndef SIMCALL_H
#define SIMCALL_H

#include <stdint.h>

enum { SIMCALL_EXIT = 1, SIMCALL_READ = 3, SIMCALL_WRITE = 4, SIMCALL_OPEN = 5 };

/* One instruction; it stands with the start-up in assembly, since arguments and
 * result are just where a function has them. */
int32_t simcall(int32_t number, int32_t first, int32_t second, int32_t third);

#endif
