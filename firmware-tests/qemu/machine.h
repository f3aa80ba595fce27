/* The machines that QEMU plays, and one run of the firmware on one of them. */
#ifndef MACHINE_H
#define MACHINE_H

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

/* Runs a machine's image with its serial line on `line`, until it ends or the
 * time is over. QEMU is dead afterwards in any case. */
run machine_run(const machine *m, int line);

#endif
