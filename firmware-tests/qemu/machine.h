/* The machines that QEMU plays, and one run of the firmware on one of them. */
#ifndef MACHINE_H
#define MACHINE_H

#include <stdio.h>
#include <sys/types.h>

typedef struct machine {
    const char *name;         /* also the folder of its image */
    const char *arguments[8]; /* the emulator and what it wants, up to NULL */
} machine;

extern const machine machines[];
extern const unsigned machine_count;

/* What came of a run. */
typedef struct run {
    int ended;          /* 0 if it had to be killed */
    int code;           /* what the firmware ended with */
    char console[4096]; /* what it printed, and what QEMU complained about */
} run;

/* Runs a machine's image `firmware` with its serial line on `line`, until it
 * ends or the time is over. QEMU is dead afterwards in any case. */
run machine_run(const machine *m, int line);

/* The two halves of it, for another image: a run that is under way, and its
 * end, for which machine_finish waits if `patient`. Once finished, a run stays
 * so. */
typedef struct running {
    FILE *console;
    pid_t child;
} running;

/* Waits until the console says something; 0 if the time is over. */
int machine_says(const running *r, const char *text);

running machine_start(const machine *m, const char *image, int line);
run machine_finish(running *r, int patient);

#endif
