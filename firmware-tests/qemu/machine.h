/* The machines that QEMU plays, and one run of the firmware on one of them. */
#pragma once

#include <stdio.h>
#include <sys/types.h>

typedef struct machine {
    const char *name;         /* also the name of its image's folder */
    const char *arguments[8]; /* the emulator and its arguments, ending with NULL */
} machine;

extern const machine machines[];
extern const unsigned machine_count;

/* The result of a run. */
typedef struct run {
    int ended;          /* 0 if it had to be killed */
    int code;           /* the exit code of the firmware */
    char console[4096]; /* the firmware's output, and QEMU's error messages */
} run;

/* Runs a machine's image `firmware` with its serial line on `line`, until it ends or the
 * time is over. Afterwards QEMU has ended in any case. */
run machine_run(const machine *m, int line);

/* The two halves of machine_run, for another image: the start of a run and its end, for
 * which machine_finish waits if `patient`. A run can be finished more than once. */
typedef struct running {
    FILE *console;
    pid_t child;
} running;

/* Waits until the console shows a text. Returns 0 if the time is over. */
int machine_says(const running *r, const char *text);

running machine_start(const machine *m, const char *image, int line);
run machine_finish(running *r, int patient);

/* Calls `test` for each machine that the command line names, or for all. Returns the exit code of
 * the program: 0 if there is such a machine and each test returned 0. */
int machine_each(int argc, char **argv, int (*test)(const machine *m));
