/* The tables of the serving firmware: four tables at the same addresses.
 * Licence: MIT OR Apache-2.0. */
#ifndef SERVE_H
#define SERVE_H

enum {
    SERVE_UNIT = 17,
    SERVE_BASE = 100,   /* the address of the first register or bit of each table */
    SERVE_CELLS = 130,  /* the number of registers or bits of each table */
    SERVE_END = 229,    /* the coil that ends the program */
    SERVE_MOST = 60000, /* the highest value that holding registers accept */
    /* Microseconds of silence that end a request. A server on a wire lets
     * mbm_server_setBaudRate choose it. QEMU delivers bytes in lumps. */
    SERVE_SILENCE = 60000
};

#endif
