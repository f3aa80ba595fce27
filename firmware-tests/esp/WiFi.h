/* Wi-Fi and its TCP client, as declarations for firmware-tests/avr/check-sketches. */
#ifndef ESP_WIFI_H
#define ESP_WIFI_H

#include "Arduino.h"

enum { WL_CONNECTED = 3 };
enum { WIFI_STA = 1, WIFI_AP = 2 };

class WiFiClass {
public:
    int begin(const char *ssid, const char *password = nullptr);
    int status();
    IPAddress localIP();
    bool mode(int mode);
    int32_t RSSI();
};
extern WiFiClass WiFi;

class WiFiClient : public Stream {
public:
    using Print::write;
    int connect(const char *host, uint16_t port);
    uint8_t connected();
    void stop();
    int available() override;
    int read() override;
    int peek() override;
    size_t write(uint8_t value) override;
};

#endif
