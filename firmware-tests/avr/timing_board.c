/* The simulated Uno whose sketches are timed. */
#include "timing.h"

#include <stdio.h>

board *timed_board(const char *folder, const char *name)
{
    char path[200];

    snprintf(path, sizeof path, "build/avr/%s/%s.elf", folder, name);
    return board_new(path, "atmega328p");
}
