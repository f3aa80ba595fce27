#include "ESP8266WiFi.h"

#include <Arduino.h>

#define NETWORK Serial1
static bool is_waiting; /* a client that the listener has not handed over */
static bool is_open;

WiFiClass WiFi;

int WiFiClient::connect(IPAddress, uint16_t)
{
    return connect("", 0);
}
int WiFiClient::connect(const char *, uint16_t)
{
    NETWORK.begin(115200);
    is_open = true;
    socket = 0;
    return 1;
}
size_t WiFiClient::write(uint8_t value)
{
    return write(&value, 1);
}
size_t WiFiClient::write(const uint8_t *bytes, size_t length)
{
    return connected() ? NETWORK.write(bytes, length) : 0;
}
int WiFiClient::available()
{
    return connected() ? NETWORK.available() : 0;
}
int WiFiClient::read()
{
    return connected() ? NETWORK.read() : -1;
}
int WiFiClient::read(uint8_t *bytes, size_t length)
{
    size_t count = 0;
    while (count < length && available() > 0)
        bytes[count++] = static_cast<uint8_t>(read());
    return count > 0 ? static_cast<int>(count) : -1;
}
int WiFiClient::peek()
{
    return connected() ? NETWORK.peek() : -1;
}
void WiFiClient::flush() {}
void WiFiClient::stop()
{
    if (connected())
        is_open = false;
    socket = none;
}
uint8_t WiFiClient::connected()
{
    return socket != none && is_open;
}

void WiFiServer::begin()
{
    NETWORK.begin(115200);
    is_waiting = true;
}
WiFiClient WiFiServer::accept()
{
    WiFiClient client;
    if (is_waiting) {
        is_waiting = false;
        is_open = true;
        client.socket = 0;
    }
    return client;
}
size_t WiFiServer::write(uint8_t value)
{
    return NETWORK.write(value);
}
