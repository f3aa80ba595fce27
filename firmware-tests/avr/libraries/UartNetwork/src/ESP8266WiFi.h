/* Stands in for the WiFi library of the ESP8266. Its network is Serial1: see UartNetwork.h. */
#ifndef STANDIN_ESP8266WIFI_H
#define STANDIN_ESP8266WIFI_H

#include <UartNetwork.h>

class WiFiClass {
public:
    void begin(const char *, const char *) {}
    static HardwareSerial &uart();
};

typedef UartClient<WiFiClass> WiFiClient;
typedef UartServer<WiFiClass> WiFiServer;

static WiFiClass WiFi __attribute__((unused));

#endif
