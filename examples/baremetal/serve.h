/* What the serving firmware has: four tables of cells at the same addresses.
 * Licence: MIT OR Apache-2.0. */
#ifndef SERVE_H
#define SERVE_H

enum {
    SERVE_UNIT = 17,
    SERVE_BASE = 100,   /* the address of the first cell, in each table */
    SERVE_CELLS = 130,  /* how many there are */
    SERVE_END = 229,    /* the coil that ends the program */
    SERVE_MOST = 60000, /* the highest value that holding registers take */
    /* Microseconds of silence that end a request. On a wire it would be what
     * mbm_server_setBaudRate makes of the rate; QEMU's bytes come in lumps. */
    SERVE_SILENCE = 60000
};

#endif
