/* The classes of the ESP8266's WiFi library, as far as the examples use them. The
 * network of a simulated board is a UART, Serial1: it carries the bytes of one
 * connection, with 115200 baud, and a test has sockets at its far end. */
#ifndef STANDIN_ESP8266WIFI_H
#define STANDIN_ESP8266WIFI_H

#include <Client.h>
#include <IPAddress.h>
#include <Server.h>

class WiFiClient : public Client {
public:
    WiFiClient() : socket(none) {}
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
    bool operator==(const WiFiClient &other) { return socket == other.socket; }

private:
    friend class WiFiServer;
    enum : uint8_t { none = 8 };
    uint8_t socket;
};

class WiFiServer : public Server {
public:
    explicit WiFiServer(uint16_t) {}
    void begin() override;
    WiFiClient accept();
    WiFiClient available() { return accept(); }
    size_t write(uint8_t value) override;
    using Print::write;
};

class WiFiClass {
public:
    void begin(const char *, const char *) {}
};

extern WiFiClass WiFi;

#endif
