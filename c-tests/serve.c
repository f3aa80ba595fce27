/* Serves everything that support/served.h has, to Modbus programs of other projects:
 *
 *     serve rtu | ascii | tcp | rtu-over-tcp
 *
 * Prints `ready PATH` or `ready PORT`, and serves until its input ends. For each line of
 * its input it prints how many frames unit 17 has received. So a test that sends a request
 * without a response can check that the request arrived. */
#include "served.h"

#include <signal.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

static served device;

int main(int argc, char **argv)
{
    static const char *const names[] = {"rtu", "ascii", "tcp", "rtu-over-tcp"};
    static const int framings[] = {MBM_FRAMING_RTU, MBM_FRAMING_ASCII, MBM_FRAMING_TCP,
                                   MBM_FRAMING_RTU_OVER_TCP};
    unsigned i = 0;
    char byte;

    while (argc == 2 && i < 4 && strcmp(argv[1], names[i]) != 0)
        i++;
    if (argc != 2 || i == 4) {
        fprintf(stderr, "usage: %s rtu | ascii | tcp | rtu-over-tcp\n", argv[0]);
        return 2;
    }
    /* A client may close its connection before it has read the response. */
    (void)signal(SIGPIPE, SIG_IGN);
    served_prepare(&device);
    if (i < 2) {
        served_on_line(&device, framings[i]);
        printf("ready %s\n", device.line.path);
    } else {
        served_on_tcp(&device, framings[i]);
        printf("ready %d\n", device.port);
    }
    fflush(stdout);
    while (read(STDIN_FILENO, &byte, 1) > 0) {
        if (byte == '\n') {
            printf("%u\n", device.diagnostics.busMessages);
            fflush(stdout);
        }
    }
    served_stop(&device);
    return 0;
}
