/* The state of tests of one mbm_tcp whose peer is a tcp_peer: their setup and teardown. */
#ifndef PORT_OF_PEER_H
#define PORT_OF_PEER_H

#include "mbm_tcp.h"
#include "tcp_peer.h"

#include <stdio.h>
#include <string.h>

static tcp_peer *peer;
static mbm_tcp tcp;
static mbm_tcp_addresses addresses;
static mbm_port port;
static char service[8];

static void begin(void)
{
    peer = tcp_peer_new();
    snprintf(service, sizeof service, "%u", tcp_peer_start(peer, 0));
    memset(&tcp, 0, sizeof tcp);
    port = mbm_tcp_port(&tcp);
}

static void end(void)
{
    mbm_tcp_close(&tcp);
    tcp_peer_stop(peer);
}

#endif
