/* The classes of the ESP8266's WiFi library, as far as the examples use them: a simulated
 * board has no network. */
#ifndef STANDIN_ESP8266WIFI_H
#define STANDIN_ESP8266WIFI_H

#include <Client.h>
#include <IPAddress.h>
#include <Server.h>

class WiFiClient : public Client {
public:
    WiFiClient() : socket(8) {}
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
    operator bool() override { return socket < 8; }

private:
    friend class WiFiServer;
    uint8_t socket;
};

class WiFiServer : public Server {
public:
    explicit WiFiServer(uint16_t number) : port(number) {}
    void begin() override;
    WiFiClient accept();
    WiFiClient available() { return accept(); }
    size_t write(uint8_t value) override;
    using Print::write;

private:
    uint16_t port;
};

class WiFiClass {
public:
    void begin(const char *name, const char *password);
};

extern WiFiClass WiFi;

#endif
