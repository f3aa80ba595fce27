/* The tasks of serve_sockets.c and client_sockets.c: give them to xTaskCreate once lwIP's
 * tcpip_init is done. Licence: MIT OR Apache-2.0. */
#ifndef SOCKETS_H
#define SOCKETS_H

#include <stdint.h>

enum { SERVED = 10 };

/* Serves holding registers from address 0 on as unit 1. Stack: 1500 bytes. */
void serve_sockets(void *none);
extern uint16_t served[SERVED];

/* Reads two holding registers of unit 1 at this device once a second. Stack: 1500 bytes. */
typedef struct device {
    const char *host, *service; /* for example "192.168.0.7" and "502" */
    uint16_t words[2];          /* what was read last */
    uint8_t status;             /* MBM_OK, or why the last read failed */
    uint32_t reads;             /* how many have ended */
} device;
void read_sockets(void *of_device);

#endif
