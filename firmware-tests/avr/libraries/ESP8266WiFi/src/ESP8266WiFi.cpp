#include "ESP8266WiFi.h"

/* The state of eight sockets, which nothing here opens. */
static volatile uint8_t open_sockets;
static volatile uint8_t wire;

WiFiClass WiFi;

void WiFiClass::begin(const char *name, const char *)
{
    wire = static_cast<uint8_t>(name[0]);
}

int WiFiClient::connect(IPAddress, uint16_t)
{
    return open_sockets & 1;
}
int WiFiClient::connect(const char *, uint16_t)
{
    return open_sockets & 1;
}
size_t WiFiClient::write(uint8_t value)
{
    return write(&value, 1);
}
size_t WiFiClient::write(const uint8_t *bytes, size_t length)
{
    for (size_t i = 0; i < length; i++)
        wire = bytes[i];
    return length;
}
int WiFiClient::available()
{
    return connected() ? wire : 0;
}
int WiFiClient::read()
{
    return connected() ? wire : -1;
}
int WiFiClient::read(uint8_t *bytes, size_t length)
{
    for (size_t i = 0; i < length; i++)
        bytes[i] = wire;
    return static_cast<int>(length);
}
int WiFiClient::peek()
{
    return read();
}
void WiFiClient::flush() {}
void WiFiClient::stop()
{
    socket = 8;
}
uint8_t WiFiClient::connected()
{
    return socket < 8 && (open_sockets >> socket & 1);
}

void WiFiServer::begin()
{
    wire = static_cast<uint8_t>(port);
}
WiFiClient WiFiServer::accept()
{
    WiFiClient client;
    if (open_sockets & 1)
        client.socket = 0;
    return client;
}
size_t WiFiServer::write(uint8_t value)
{
    wire = value;
    return 1;
}
