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

/* Reads what it prints up to the end of a line, or all of it. */
size_t program_line(const program *p, char *text, size_t room);
size_t program_rest(const program *p, char *text, size_t room);

/* Ends its input and waits for its end; its exit code, or -1. */
int program_end(program *p);

#endif
