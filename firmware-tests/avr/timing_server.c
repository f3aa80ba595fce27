/* The response time of a server. */
#include "crc.h"
#include "peer.h"
#include "rows.h"
#include "timing.h"

#include <stdio.h>
#include <string.h>

typedef struct asker {
    board *on;
    wire *bus;
    span gap[3]; /* from the last byte of a request to the first byte of its response */
    unsigned wrong;
} asker;

/* Reads ten registers, writes ten and reads 64 in turn, each time at another moment of the
 * sketch's loop. */
static void send_next(asker *a)
{
    static const uint8_t requests[3][7] = {
        {1, 3, 0, 0, 0, 10}, {1, 16, 0, 0, 0, 10, 20}, {1, 3, 0, 0, 0, 64}};
    uint8_t frame[FRAME] = {0};
    unsigned n = a->bus->frames;

    memcpy(frame, requests[n % 3], sizeof requests[0]);
    wire_play(a->bus, 10 * MS + n * 977, frame, seal(frame, n % 3 == 1 ? 27 : 6));
}

static void answered(wire *w, const uint8_t *frame, size_t length)
{
    asker *a = w->context;

    static const size_t lengths[3] = {25, 8, 133};
    unsigned which = (w->frames - 1) % 3; /* the first frame is number 1 */

    a->wrong += length != lengths[which] || crc16(frame, length) != 0;
    if (w->frames > SKIP)
        note(&a->gap[which], w->first_started - w->received);
    send_next(a);
}

static asker serve(const char *name)
{
    static asker a;

    memset(&a, 0, sizeof a);
    a.on = timed_board("uno", name);
    a.bus = board_uart(a.on, '0', answered, &a);
    if (!board_run(a.on, 10 * MS))
        give_up("a sketch crashed");
    send_next(&a);
    while (a.bus->frames < SKIP + 3 * COUNTED)
        if (!board_run(a.on, MS))
            give_up("a sketch crashed");
    board_free(a.on);
    if (a.wrong)
        give_up("a server answers wrongly");
    return a;
}

static void responses(const char *name, unsigned baud, unsigned long gap)
{
    asker a = serve(name), again = serve(name);
    static const char *const requests[3] = {"FC03 of 10 registers", "FC10 of 10", "FC03 of 64"};
    char what[120];
    unsigned i;

    if (memcmp(a.gap, again.gap, sizeof a.gap) != 0)
        give_up("two runs differ");
    for (i = 0; i < 3; i++) {
        snprintf(what, sizeof what, "a server's response, %u baud, t3.5 = %lu cycles: to %s", baud,
                 gap, requests[i]);
        row_cycles(what, &a.gap[i], gap + gap / 20);
    }
}

void time_server(void)
{
    responses("TimeServe", 19200, 32096);
    responses("TimeServeFast", 115200, 28000);
}
