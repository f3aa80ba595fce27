#include "Ethernet.h"

#include <Arduino.h>

#define NETWORK Serial
static bool is_waiting; /* a client that the listener has not handed over */
static bool is_open;

EthernetClass Ethernet;

int EthernetClient::connect(IPAddress, uint16_t)
{
    return connect("", 0);
}
int EthernetClient::connect(const char *, uint16_t)
{
    NETWORK.begin(115200);
    is_open = true;
    socket = 0;
    return 1;
}
size_t EthernetClient::write(uint8_t value)
{
    return write(&value, 1);
}
size_t EthernetClient::write(const uint8_t *bytes, size_t length)
{
    return connected() ? NETWORK.write(bytes, length) : 0;
}
int EthernetClient::available()
{
    return connected() ? NETWORK.available() : 0;
}
int EthernetClient::read()
{
    return connected() ? NETWORK.read() : -1;
}
int EthernetClient::read(uint8_t *bytes, size_t length)
{
    size_t count = 0;
    while (count < length && available() > 0)
        bytes[count++] = static_cast<uint8_t>(read());
    return count > 0 ? static_cast<int>(count) : -1;
}
int EthernetClient::peek()
{
    return connected() ? NETWORK.peek() : -1;
}
void EthernetClient::flush() {}
void EthernetClient::stop()
{
    if (connected())
        is_open = false;
    socket = none;
}
uint8_t EthernetClient::connected()
{
    return socket != none && is_open;
}

void EthernetServer::begin()
{
    NETWORK.begin(115200);
    is_waiting = true;
}
EthernetClient EthernetServer::accept()
{
    EthernetClient client;
    if (is_waiting) {
        is_waiting = false;
        is_open = true;
        client.socket = 0;
    }
    return client;
}
size_t EthernetServer::write(uint8_t value)
{
    return NETWORK.write(value);
}
