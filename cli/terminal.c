/* Opens terminals, and finds in /proc which program has one open. */
#include "terminal.h"

#include "numbers.h"
#include "report.h"

#include <dirent.h>
#include <errno.h>
#include <limits.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/ioctl.h>
#include <unistd.h>

enum { PROCESS_PATH_BYTES = 48 };

/* A program that has a terminal open. */
typedef struct holder {
    int pid;
    char name[32];
} holder;

/* --- who has it, as Linux shows it in /proc --- */

/* Whether a process has a file open, by its name in /proc. Sets `has_other_end` if it has one end
 * of any pseudo terminal that nobody else can open. */
static int has_open(const char *process, const char *real, int *has_other_end)
{
    char path[PROCESS_PATH_BYTES], leads_to[PATH_MAX];
    const struct dirent *entry;
    int has = 0;
    DIR *files;

    snprintf(path, sizeof path, "/proc/%.20s/fd", process);
    files = opendir(path);
    if (!files)
        return 0;
    while ((entry = readdir(files)) != NULL) {
        const ssize_t length =
            readlinkat(dirfd(files), entry->d_name, leads_to, sizeof leads_to - 1);

        if (length <= 0)
            continue;
        leads_to[length] = '\0';
        has |= strcmp(leads_to, real) == 0;
        *has_other_end |=
            strcmp(leads_to, "/dev/ptmx") == 0 || strcmp(leads_to, "/dev/pts/ptmx") == 0;
    }
    closedir(files);
    return has;
}

static void read_name(const char *process, holder *found)
{
    char path[PROCESS_PATH_BYTES];
    FILE *file;

    found->pid = atoi(process);
    snprintf(found->name, sizeof found->name, "a program");
    snprintf(path, sizeof path, "/proc/%.20s/comm", process);
    file = fopen(path, "re");
    if (!file)
        return;
    if (fgets(path, sizeof found->name, file)) {
        path[strcspn(path, "\n")] = '\0';
        snprintf(found->name, sizeof found->name, "%.31s", path);
    }
    (void)fclose(file);
}

/* Finds another program that has the terminal of a path open, among those whose descriptors this
 * one may see: root sees all, a user those of the same user. A program that has the other end of a
 * pseudo terminal is no other user of it. Returns 0 if there is none. */
static int find_holder(const char *path, holder *found)
{
    char real[PATH_MAX], self[24];
    const struct dirent *entry;
    int is_found = 0;
    DIR *processes;

    snprintf(self, sizeof self, "%ld", (long)getpid());
    if (!realpath(path, real))
        return 0;
    processes = opendir("/proc");
    if (!processes)
        return 0;
    while (!is_found && (entry = readdir(processes)) != NULL) {
        const char *name = entry->d_name;
        int has_other_end = 0;

        if (*name < '1' || *name > '9' || strcmp(name, self) == 0)
            continue;
        is_found = has_open(name, real, &has_other_end) && !has_other_end;
        if (is_found)
            read_name(name, found);
    }
    closedir(processes);
    return is_found;
}

/* Whether this program has the terminal of a path open. */
static int is_own(const char *path)
{
    char real[PATH_MAX];
    int has_other_end = 0;

    return realpath(path, real) && has_open("self", real, &has_other_end);
}

/* --- opening --- */

static int is_taken(const place *where)
{
    holder other;

    return where->tty.exclusive && find_holder(where->path, &other);
}

int terminal_open(mbm_tty *tty, const place *where)
{
    if (mbm_tty_openWith(tty, where->path, &where->tty) != 0)
        return -1;
    if (!is_taken(where))
        return 0;
    mbm_tty_close(tty);
    errno = EBUSY;
    return -1;
}

uint8_t terminal_connect(mbm_tty *tty, const place *where)
{
    const uint8_t status = mbm_tty_connect(tty);

    if (status != MBM_OK || !is_taken(where))
        return status;
    mbm_tty_disconnect(tty);
    tty->error = EBUSY;
    return MBM_LINK_LOST;
}

void terminal_free(int fd)
{
    int is_exclusive = 0;

    if (ioctl(fd, TIOCGEXCL, &is_exclusive) != 0 || !is_exclusive)
        return;
    /* A program that has it exclusively takes its lock before, and frees it after. */
    if (flock(fd, LOCK_EX | LOCK_NB) != 0)
        return;
    (void)ioctl(fd, TIOCNXCL);
    (void)flock(fd, LOCK_UN);
}

const char *terminal_error_text(const place *where, int error)
{
    holder other;

    if (error != EBUSY || !place_is_serial(where))
        return report_error_text(error);
    if (find_holder(where->path, &other))
        return say("%s (process %d) has it open", other.name, other.pid);
    return is_own(where->path) ? "this program has it open already, under another name"
                               : "another program has it open";
}
