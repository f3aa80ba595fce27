/* The classes of the Ethernet library, 2.0.0 and later, as far as the examples use them. The
 * network of a simulated board is a UART, Serial: it carries the bytes of one
 * connection, with 115200 baud, and a test has sockets at its far end. */
#ifndef STANDIN_ETHERNET_H
#define STANDIN_ETHERNET_H

#include <Client.h>
#include <IPAddress.h>
#include <Server.h>

class EthernetClient : public Client {
public:
    EthernetClient() : socket(none) {}
    int connect(IPAddress ip, uint16_t port) override;
    int connect(const char *host, uint16_t port) override;
    size_t write(uint8_t value) override;
    size_t write(const uint8_t *bytes, size_t length) override;
    int available() override;
    int read() override;
    int read(uint8_t *bytes, size_t length) override;
    int peek() override;
    void flush() override;
    void stop() override;
    uint8_t connected() override;
    operator bool() override { return socket != none; }
    bool operator==(const EthernetClient &other) { return socket == other.socket; }

private:
    friend class EthernetServer;
    enum : uint8_t { none = 8 };
    uint8_t socket;
};

class EthernetServer : public Server {
public:
    explicit EthernetServer(uint16_t) {}
    void begin() override;
    EthernetClient accept();
    EthernetClient available() { return accept(); }
    size_t write(uint8_t value) override;
    using Print::write;
};

class EthernetClass {
public:
    void begin(uint8_t *, IPAddress) {}
};

extern EthernetClass Ethernet;

#endif
