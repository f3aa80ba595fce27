/* What mbm_tcp.h takes from lwIP: its sockets, and smaller limits. Licence: MIT OR Apache-2.0. */
#ifndef MBM_LWIP_LIMITS_H
#define MBM_LWIP_LIMITS_H

#include "lwip/sockets.h"

/* lwIP finds one address of a name. A wait has 8 bytes of stack for each socket. */
#define MBM_TCP_ADDRESSES 1
#define MBM_TCP_WAITS (MEMP_NUM_NETCONN + 2)
#define MBM_TCP_HOST_BYTES 64
#define MBM_TCP_SERVICE_BYTES 8

#endif
