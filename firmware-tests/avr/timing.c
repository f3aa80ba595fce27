/* Measures the speed and the RAM of sketches on an Uno, in cycles and bytes, which repeat
 * exactly, since the far end is a part of the simulation. Prints the rows of
 * docs/reports/timing.md. The rows of the comparison with ModbusMaster begin with "=".
 *
 *   timing [FOLDER]   FOLDER below build/avr has the sketches with ModbusMaster */
#include "timing.h"
#include "rows.h"

#include <stdio.h>

board *timed_board(const char *folder, const char *name)
{
    char path[200];

    snprintf(path, sizeof path, "build/avr/%s/%s.elf", folder, name);
    return board_new(path, "atmega328p");
}

int main(int count, char **arguments)
{
    time_master(count > 1 ? arguments[1] : NULL);
    time_unchanged(count > 1 ? arguments[1] : NULL);
    time_default_gap();
    time_master_flood();
    time_server();
    time_server_flood();
    fprintf(stderr, "timing: %u rows above their limits\n", rows_above());
    return 0;
}
