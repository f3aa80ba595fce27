/* A raw pseudo-terminal pair: a serial line without a wire. */
#ifndef PTY_H
#define PTY_H

typedef struct pty {
    int ours;      /* the end that the test's master or responder uses */
    int theirs;    /* kept open, so that the line does not hang up */
    char path[64]; /* the name of the far end, for a peer to open */
} pty;

void pty_open(pty *line);
void pty_close(pty *line);

#endif
