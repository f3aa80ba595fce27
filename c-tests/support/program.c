#define _GNU_SOURCE
#include "program.h"
#include "must.h"

#include <fcntl.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

/* Replaces this process by the program. A path without a slash is looked for in PATH. A program for
 * another machine needs an emulator. */
static void run(const char *path, const char **argv, const char *emulator)
{
    const char *emulated[33] = {emulator, path};

    if (emulator) {
        memcpy(emulated + 2, argv + 1, 31 * sizeof *argv);
        path = emulator;
        argv = emulated;
    }
    execvp(path, (char *const *)argv);
    perror(path);
    _exit(127);
}

static void start(program *p, const char *path, const char *name, const char *const *arguments,
                  unsigned descriptors, const char *emulator)
{
    const struct rlimit limit = {descriptors, descriptors};
    const char *argv[32] = {name};
    int in[2], out[2];

    for (size_t i = 0; arguments[i]; i++) {
        must(i < 30, "too many arguments");
        argv[i + 1] = arguments[i];
    }
    must(pipe2(in, O_CLOEXEC) == 0 && pipe2(out, O_CLOEXEC) == 0, "pipe");
    p->pid = fork();
    must(p->pid >= 0, "fork");
    if (p->pid == 0) {
        /* The program must not survive the test, however the test ends. */
        prctl(PR_SET_PDEATHSIG, SIGKILL);
        dup2(in[0], STDIN_FILENO);
        dup2(out[1], STDOUT_FILENO);
        /* Lines and sockets of the test must hang up when the test closes them. */
        close_range(3, ~0u, 0);
        if (descriptors)
            must(setrlimit(RLIMIT_NOFILE, &limit) == 0, "setrlimit");
        run(path, argv, emulator);
    }
    close(in[0]);
    close(out[1]);
    p->input = in[1];
    p->output = out[0];
}

void program_start_limited(program *p, const char *name, const char *const *arguments,
                           unsigned descriptors)
{
    char path[4096];
    ssize_t length = readlink("/proc/self/exe", path, sizeof path - 64);

    must(length > 0, "/proc/self/exe");
    path[length] = 0;
    char *end = strrchr(path, '/');
    must(end != NULL && strlen(name) < 48, name);
    sprintf(end, "/%s", name);
    start(p, path, name, arguments, descriptors, getenv("MBM_EMULATOR"));
}

void program_start(program *p, const char *name, const char *const *arguments)
{
    program_start_limited(p, name, arguments, 0);
}

void program_start_other(program *p, const char *name, const char *const *arguments)
{
    start(p, name, name, arguments, 0, NULL);
}

size_t program_line(const program *p, char *text, size_t capacity)
{
    size_t length = 0;

    while (length + 1 < capacity && read(p->output, text + length, 1) == 1)
        if (text[length++] == '\n')
            break;
    text[length] = 0;
    return length;
}

size_t program_rest(const program *p, char *text, size_t capacity)
{
    size_t length = 0;
    ssize_t count;

    while (length + 1 < capacity &&
           (count = read(p->output, text + length, capacity - 1 - length)) > 0)
        length += (size_t)count;
    text[length] = 0;
    return length;
}

/* The state follows the name, which is in parentheses. */
static int is_asleep(const program *p)
{
    char path[64], text[512], *name;
    FILE *file;

    snprintf(path, sizeof path, "/proc/%d/stat", (int)p->pid);
    file = fopen(path, "r");
    must(file != NULL, path);
    size_t length = fread(text, 1, sizeof text - 1, file);
    (void)fclose(file);
    text[length] = 0;
    name = strrchr(text, ')');
    return name && name[1] == ' ' && name[2] == 'S';
}

int program_sleeps(const program *p)
{
    for (int looks = 0; looks < 50; looks++) {
        if (!is_asleep(p))
            return 0;
        usleep(1000);
    }
    return 1;
}

int program_end(program *p)
{
    int status;

    if (p->input >= 0)
        close(p->input);
    p->input = -1;
    must(waitpid(p->pid, &status, 0) == p->pid, "waitpid");
    close(p->output);
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}
