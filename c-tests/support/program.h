/* Runs a program as a process: the one that was built in the same way as the test. */
#ifndef PROGRAM_H
#define PROGRAM_H

#include <stddef.h>
#include <sys/types.h>

typedef struct program {
    pid_t pid;
    int input;  /* a descriptor: what the test writes here, the program reads */
    int output; /* a descriptor: what the program prints, the test reads here */
} program;

/* Starts a program by its path in the folder of the test, for example "mbm" or "linux/basic". The
 * arguments end with NULL. */
void program_start(program *p, const char *name, const char *const *arguments);

/* The same with a limit of open descriptors. 0 means no limit. */
void program_start_limited(program *p, const char *name, const char *const *arguments,
                           unsigned descriptors);

/* Starts a program of the system, which is looked for in PATH. The arguments end with NULL. */
void program_start_other(program *p, const char *name, const char *const *arguments);

/* Looks at the program 50 times. Returns whether it was asleep each time. A program that
 * spins never is. One that sleeps may be seen awake, so call again. */
int program_sleeps(const program *p);

/* Reads the program's output up to the end of a line, or all of it. */
size_t program_line(const program *p, char *text, size_t capacity);
size_t program_rest(const program *p, char *text, size_t capacity);

/* Closes its input and waits for its end. Returns its exit code, or -1. */
int program_end(program *p);

#endif
