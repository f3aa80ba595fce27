/* A raw pseudo-terminal pair, in place of a serial line. */
#ifndef PTY_H
#define PTY_H

typedef struct pty {
    int ours;      /* the descriptor that the test's master or responder uses */
    int theirs;    /* kept open, so that the line does not hang up */
    char path[64]; /* the name of the far end, which a peer opens */
} pty;

void pty_open(pty *line);
void pty_close(pty *line);

#endif
