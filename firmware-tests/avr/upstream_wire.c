/* Compares what an example of ModbusMaster puts on the wire with that library and with mbm:
 *
 *     upstream_wire EXAMPLE UNIT     a row of docs/reports/timing.md for each board
 *
 * It fails if a byte differs. The times are those of the simulated board. */
#include "sketch.h"
#include "test.h"
#include "upstream_device.h"

/* The program compares 26 frames, or those that the board sends in three seconds. What a sketch
 * prints is a frame too. */
enum { MOST = 26, SECONDS = 3 };

typedef struct traffic {
    uint8_t bytes[MOST][FRAME];
    size_t lengths[MOST];
    uint64_t started[MOST]; /* in cycles */
    unsigned count;
} traffic;

static void record(upstream_device *d, const wire *w, const uint8_t *bytes, size_t length)
{
    traffic *t = d->context;

    if (t->count == MOST)
        return;
    memcpy(t->bytes[t->count], bytes, length);
    t->lengths[t->count] = length;
    t->started[t->count++] = w->first_started;
}

static void run(const kind *k, const char *sketch, int unit, traffic *t)
{
    board *b = kind_start(k, sketch);
    upstream_device d;
    unsigned i;

    memset(t, 0, sizeof *t);
    upstream_device_start(&d, unit);
    d.heard = record;
    d.context = t;
    board_uart(b, '0', upstream_hear, &d);
    for (i = 0; i < SECONDS * 1000 && t->count < MOST; i++)
        if (!board_run(b, MS)) {
            fprintf(stderr, "upstream_wire: the board %s stopped\n", k->name);
            exit(1);
        }
    server_stop(&d.peer);
    board_free(b);
}

/* Milliseconds from the beginning of a frame to that of the next one, the mean of the first
 * `count`. */
static double period(const traffic *t, unsigned count)
{
    return (double)(t->started[count - 1] - t->started[0]) / (count - 1) / MS;
}

static void compare(const char *example, int unit, const kind *ours, const kind *theirs)
{
    static traffic mbm, original;
    size_t bytes = 0;
    unsigned i, count;
    char sketch[100];

    snprintf(sketch, sizeof sketch, "upstream-%s", example);
    run(ours, sketch, unit, &mbm);
    run(theirs, sketch, unit, &original);
    count = mbm.count < original.count ? mbm.count : original.count;
    for (i = 0; i < count; i++) {
        if (mbm.lengths[i] != original.lengths[i] ||
            memcmp(mbm.bytes[i], original.bytes[i], mbm.lengths[i]) != 0) {
            fprintf(stderr, "upstream_wire: %s, %s: frame %u differs\n", example, ours->name, i);
            exit(1);
        }
        bytes += mbm.lengths[i];
    }
    if (count < 4) {
        fprintf(stderr, "upstream_wire: %s, %s: only %u frames\n", example, ours->name, count);
        exit(1);
    }
    printf("| %s | %s | %u | %zu | %.2f | %.2f |\n", example, ours->name, count, bytes,
           period(&mbm, count), period(&original, count));
}

int main(int argc, char **argv)
{
    if (argc != 3) {
        fprintf(stderr, "usage: upstream_wire EXAMPLE UNIT\n");
        return 2;
    }
    compare(argv[1], atoi(argv[2]), &uno, &uno_peer);
    compare(argv[1], atoi(argv[2]), &mega, &mega_peer);
    return 0;
}
