#define _GNU_SOURCE
#include "machine.h"

#include <errno.h>
#include <signal.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

/* A run takes one second. The host of the test may be busy. */
enum { PATIENCE = 120 /* s */ };

#define ARM(board)                                                                                 \
    {                                                                                              \
        "qemu-system-arm", "-M", board, "-kernel", NULL                                            \
    }

const machine machines[] = {
    {"lm3s6965evb", ARM("lm3s6965evb")},
    {"lm3s6965evb-client", ARM("lm3s6965evb")},
    {"microbit", ARM("microbit")},
    {"virt", {"qemu-system-riscv32", "-M", "virt", "-bios", "none", "-kernel", NULL}},
    {"netduinoplus2", ARM("netduinoplus2")},
    {"mps2-an500", ARM("mps2-an500")},
    {"mps2-an505", ARM("mps2-an505")},
    /* With -kernel these would not start at the image's entry. */
    {"lx106", {"qemu-system-xtensa", "-M", "sim", "-cpu", "lx106", "-device", NULL}},
    {"dc233c", {"qemu-system-xtensa", "-M", "sim", "-cpu", "dc233c", "-device", NULL}},
};
const unsigned machine_count = sizeof machines / sizeof machines[0];

static void become_qemu(const machine *m, const char *name, int line, int console)
{
    const char *folder = getenv("MBM_FIRMWARE");
    char image[512], set[64];
    const char *arguments[32];
    unsigned n = 0;

    /* QEMU must not survive the test, however the test ends. */
    prctl(PR_SET_PDEATHSIG, SIGKILL);
    dup2(console, 1);
    dup2(console, 2);
    while (m->arguments[n]) {
        arguments[n] = m->arguments[n];
        n++;
    }
    snprintf(image, sizeof image, "%s%s/%s/%s.elf",
             strcmp(arguments[n - 1], "-device") ? "" : "loader,cpu-num=0,file=",
             folder ? folder : "build/baremetal", m->name, name);
    arguments[n++] = image;
    /* QEMU gets the descriptor itself, not its name: it need not wait for the other end,
     * and no byte is lost before that is open. */
    snprintf(set, sizeof set, "fd=%d,set=1", line);
    arguments[n++] = "-add-fd";
    arguments[n++] = set;
    arguments[n++] = "-chardev";
    arguments[n++] = "serial,id=line,path=/dev/fdset/1";
    arguments[n++] = "-serial";
    arguments[n++] = "chardev:line";
    arguments[n++] = "-semihosting-config";
    arguments[n++] = "enable=on,target=native";
    arguments[n++] = "-display";
    arguments[n++] = "none";
    arguments[n++] = "-monitor";
    arguments[n++] = "none";
    arguments[n++] = "-no-reboot";
    arguments[n] = NULL;
    execvp(arguments[0], (char **)(uintptr_t)arguments);
    perror(arguments[0]);
    _exit(127);
}

/* Waits with a time limit. Returns 0 if the time is over. */
static int wait_for(pid_t child, int *status)
{
    unsigned naps;

    for (naps = 0; naps < 100 * PATIENCE; naps++) {
        if (waitpid(child, status, WNOHANG) == child)
            return 1;
        usleep(10000);
    }
    return 0;
}

running machine_start(const machine *m, const char *image, int line)
{
    running r = {tmpfile(), -1};

    if (!r.console || (r.child = fork()) < 0) {
        perror("machine_start");
        abort();
    }
    if (r.child == 0)
        become_qemu(m, image, line, fileno(r.console));
    return r;
}

int machine_says(const running *r, const char *text)
{
    char console[4096];
    unsigned naps;

    for (naps = 0; naps < 100 * PATIENCE; naps++) {
        /* Reads at a position of its own, since the writer of the console uses the position
         * of the file. */
        ssize_t length = pread(fileno(r->console), console, sizeof console - 1, 0);

        console[length < 0 ? 0 : length] = '\0';
        if (strstr(console, text))
            return 1;
        usleep(10000);
    }
    return 0;
}

run machine_finish(running *r, int patient)
{
    run result = {0, -1, ""};
    int status = 0;
    size_t length;

    if (!r->console)
        return result;
    result.ended = patient && wait_for(r->child, &status);
    if (!result.ended) {
        kill(r->child, SIGKILL);
        waitpid(r->child, &status, 0);
    } else if (WIFEXITED(status)) {
        result.code = WEXITSTATUS(status);
    }
    rewind(r->console);
    length = fread(result.console, 1, sizeof result.console - 1, r->console);
    result.console[length] = '\0';
    (void)fclose(r->console);
    r->console = NULL;
    return result;
}

run machine_run(const machine *m, int line)
{
    running r = machine_start(m, "firmware", line);

    return machine_finish(&r, 1);
}

int machine_each(int argc, char **argv, int (*test)(const machine *m))
{
    int failed = 0, asked = 0, a;
    unsigned m;

    for (m = 0; m < machine_count; m++) {
        int wanted = argc == 1;

        for (a = 1; a < argc; a++)
            wanted |= strcmp(argv[a], machines[m].name) == 0;
        if (wanted) {
            failed += test(&machines[m]);
            asked++;
        }
    }
    if (asked == 0)
        fprintf(stderr, "%s: no such machine\n", argv[0]);
    return failed != 0 || asked == 0;
}
