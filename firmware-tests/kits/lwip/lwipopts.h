/* lwIP in a main loop with little memory, for four connections. Licence: MIT OR Apache-2.0. */
#ifndef LWIPOPTS_H
#define LWIPOPTS_H

#define NO_SYS 1
#define SYS_LIGHTWEIGHT_PROT 0
#define LWIP_SOCKET 0
#define LWIP_NETCONN 0
#define LWIP_UDP 0
#define LWIP_DNS 0
#define LWIP_STATS 0
#define LWIP_TCP_KEEPALIVE 1
#define LWIP_SINGLE_NETIF 1
#ifndef MEM_ALIGNMENT
#define MEM_ALIGNMENT 4
#endif
#define PBUF_POOL_SIZE 12
#define PBUF_POOL_BUFSIZE 600
#define TCP_MSS 536
#define TCP_WND (4 * TCP_MSS)
#define TCP_SND_BUF (4 * TCP_MSS)
/* The tests have both ends of each connection, and so twice as much. */
#ifdef BOTH_ENDS
#define MEM_SIZE 32768
#define MEMP_NUM_TCP_PCB 10
#define MEMP_NUM_TCP_SEG 96
#define MEMP_NUM_PBUF 64
#else
#define MEM_SIZE 6000
#define MEMP_NUM_TCP_PCB 6
#define MEMP_NUM_TCP_SEG 24
#define MEMP_NUM_PBUF 8
#endif
#define MEMP_NUM_TCP_PCB_LISTEN 2

#endif
