/* An example as a process: the one that was built as the test was. */
#ifndef PROGRAM_H
#define PROGRAM_H

#include <stddef.h>
#include <sys/types.h>

typedef struct program {
    pid_t pid;
    int input;  /* what it reads */
    int output; /* what it prints */
} program;

/* Starts linux/NAME beside the test; arguments end with NULL. */
void program_start(program *p, const char *name, const char *const *arguments);

/* The same with a limit of open descriptors; 0 is none. */
void program_start_limited(program *p, const char *name, const char *const *arguments,
                           unsigned descriptors);

/* Whether it was found asleep in each of 50 looks. One that spins never is; one that
 * sleeps may have to be looked at again. */
int program_sleeps(const program *p);

/* Reads what it prints up to the end of a line, or all of it. */
size_t program_line(const program *p, char *text, size_t room);
size_t program_rest(const program *p, char *text, size_t room);

/* Ends its input and waits for its end; its exit code, or -1. */
int program_end(program *p);

#endif
