#define _GNU_SOURCE
#include "pty.h"
#include "must.h"

#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <termios.h>
#include <unistd.h>

void pty_open(pty *line)
{
    struct termios raw;

    line->ours = posix_openpt(O_RDWR | O_NOCTTY);
    must(line->ours >= 0, "posix_openpt");
    must(grantpt(line->ours) == 0 && unlockpt(line->ours) == 0, "grantpt");
    must(ptsname_r(line->ours, line->path, sizeof line->path) == 0, "ptsname");
    line->theirs = open(line->path, O_RDWR | O_NOCTTY);
    must(line->theirs >= 0, line->path);
    must(tcgetattr(line->theirs, &raw) == 0, "tcgetattr");
    cfmakeraw(&raw);
    must(tcsetattr(line->theirs, TCSANOW, &raw) == 0, "tcsetattr");
}

void pty_close(pty *line)
{
    if (line->ours >= 0)
        close(line->ours);
    if (line->theirs >= 0)
        close(line->theirs);
    line->ours = line->theirs = -1;
}
