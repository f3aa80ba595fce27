/* Stands in for the Ethernet library, 2.0.0 and later. Its network is Serial: see UartNetwork.h. */
#ifndef STANDIN_ETHERNET_H
#define STANDIN_ETHERNET_H

#include <UartNetwork.h>

class EthernetClass {
public:
    void begin(uint8_t *, IPAddress) {}
    /* On a Leonardo, Serial has another class. */
    static decltype((Serial)) uart() { return Serial; }
};

typedef UartClient<EthernetClass> EthernetClient;
typedef UartServer<EthernetClass> EthernetServer;

static EthernetClass Ethernet __attribute__((unused));

#endif
