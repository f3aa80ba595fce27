/* The classes of the ESP8266's WiFi library, over sockets of this machine. */
#ifndef SHIM_ESP8266WIFI_H
#define SHIM_ESP8266WIFI_H

#include "network.h"

enum wl_status_t { WL_IDLE_STATUS = 0, WL_CONNECTED = 3, WL_DISCONNECTED = 6 };

class WiFiClient : public SocketClient {
public:
    WiFiClient() = default;
    explicit WiFiClient(int fd) : SocketClient(fd) {}
};

class WiFiServer : public SocketServer {
public:
    explicit WiFiServer(uint16_t port) : SocketServer(port) {}
    WiFiClient accept()
    {
        int fd = acceptFd();
        return fd >= 0 ? WiFiClient(fd) : WiFiClient();
    }
    // As the real one: it is the old name of accept.
    __attribute__((deprecated)) WiFiClient available() { return accept(); }
};

class WiFiClass {
public:
    void begin(const char *, const char *) {}
    wl_status_t status() { return WL_CONNECTED; }
};

static WiFiClass WiFi __attribute__((unused));

#endif
