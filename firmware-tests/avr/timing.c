/* Measures the speed and the RAM of sketches on an Uno, in cycles and bytes, which repeat
 * exactly, since the far end is a part of the simulation. Prints the rows of
 * docs/reports/timing.md. The rows of the comparison with ModbusMaster begin with "=".
 *
 *   timing [FOLDER]   FOLDER below build/avr has the sketches with ModbusMaster */
#include "timing.h"

#include <stdio.h>
#include <stdlib.h>

board *timed_board(const char *folder, const char *name)
{
    char path[200];

    snprintf(path, sizeof path, "build/avr/%s/%s.elf", folder, name);
    return board_new(path, "atmega328p");
}

/* --- rows of the tables --- */

static unsigned above;

void note(span *s, uint64_t value)
{
    if (s->count++ == 0 || value < s->least)
        s->least = value;
    if (value > s->most)
        s->most = value;
    s->sum += value;
}

unsigned long mean(const span *s)
{
    return s->count ? (unsigned long)(s->sum / s->count) : 0;
}

span joined(const span *one, const span *other)
{
    span both = *one;

    if (other->count && (both.count == 0 || other->least < both.least))
        both.least = other->least;
    if (other->most > both.most)
        both.most = other->most;
    both.sum += other->sum;
    both.count += other->count;
    return both;
}

static void print(const char *what, const char *unit, const char *figure, unsigned long most,
                  unsigned long limit)
{
    char bound[40] = "";

    if (limit) {
        snprintf(bound, sizeof bound, "%lu", limit);
        above += most > limit;
    }
    printf("| %s | %s | %s | %s | %s |\n", what, unit, figure, bound,
           !limit         ? ""
           : most > limit ? "**no**"
                          : "yes");
}

void row(const char *what, const char *unit, unsigned long least, unsigned long most,
         unsigned long limit)
{
    char range[50];

    if (least == most)
        snprintf(range, sizeof range, "%lu", most);
    else
        snprintf(range, sizeof range, "%lu to %lu", least, most);
    print(what, unit, range, most, limit);
}

void row_cycles(const char *what, const span *s, unsigned long limit)
{
    if (s->count == 0)
        give_up(what);
    row(what, "cycles", s->least, s->most, limit);
}

void row_mean(const char *what, const span *s, unsigned long limit)
{
    char range[100];

    if (s->count == 0)
        give_up(what);
    snprintf(range, sizeof range, "%lu to %lu, mean %lu", (unsigned long)s->least,
             (unsigned long)s->most, mean(s));
    print(what, "cycles", range, s->most, limit);
}

static void spanned(const span *s)
{
    if (s->count == 0)
        give_up("a row of the comparison has no value");
    printf(" %lu to %lu, mean %lu |", (unsigned long)s->least, (unsigned long)s->most, mean(s));
}

void row_beside(const char *what, const span *ours, const span *theirs)
{
    printf("= | %s | cycles |", what);
    spanned(ours);
    if (theirs)
        spanned(theirs);
    else
        printf(" |");
    printf("\n");
}

void row_beside_bytes(const char *what, unsigned long ours, const unsigned long *theirs)
{
    printf("= | %s | bytes | %lu |", what, ours);
    if (theirs)
        printf(" %lu |\n", *theirs);
    else
        printf(" |\n");
}

void row_beside_time(const char *what, uint64_t ours, uint64_t theirs)
{
    printf("= | %s | ms | %.2f |", what, (double)ours / MS);
    if (theirs)
        printf(" %.2f |\n", (double)theirs / MS);
    else
        printf(" |\n");
}

unsigned rows_above(void)
{
    return above;
}

_Noreturn void give_up(const char *why)
{
    fprintf(stderr, "timing: %s\n", why);
    exit(1);
}

/* --- the measurements --- */

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
