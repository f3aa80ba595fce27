/* The classes of the Ethernet library, 2.0.0 and later, over sockets of this machine. */
#ifndef SHIM_ETHERNET_H
#define SHIM_ETHERNET_H

#include "network.h"

class EthernetClient : public SocketClient {
public:
    EthernetClient() = default;
    explicit EthernetClient(int fd) : SocketClient(fd) {}
};

class EthernetServer : public SocketServer {
public:
    explicit EthernetServer(uint16_t port) : SocketServer(port) {}
    EthernetClient accept()
    {
        int fd = acceptFd();
        return fd >= 0 ? EthernetClient(fd) : EthernetClient();
    }
    EthernetClient available() { return withBytes(known); }

private:
    std::vector<EthernetClient> known;
};

class EthernetClass {
public:
    int begin(uint8_t *) { return 1; }
    void begin(uint8_t *, IPAddress) {}
    int maintain() { return 0; }
};

static EthernetClass Ethernet __attribute__((unused));

#endif
