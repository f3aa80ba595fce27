/* The MQTT client PubSubClient, as declarations for firmware-tests/avr/check-sketches. */
#ifndef ESP_PUB_SUB_CLIENT_H
#define ESP_PUB_SUB_CLIENT_H

#include "WiFi.h"

class PubSubClient {
public:
    PubSubClient(WiFiClient &client);
    PubSubClient &setServer(const char *host, uint16_t port);
    bool connect(const char *id);
    bool connected();
    bool publish(const char *topic, const char *text);
    bool loop();
    int state();
};

#endif
