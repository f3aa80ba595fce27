#include "Ethernet.h"

/* The state of eight sockets, which nothing here opens. */
static volatile uint8_t open_sockets;
static volatile uint8_t wire;

EthernetClass Ethernet;

void EthernetClass::begin(uint8_t *mac, IPAddress)
{
    wire = mac[0];
}

int EthernetClient::connect(IPAddress, uint16_t)
{
    return open_sockets & 1;
}
int EthernetClient::connect(const char *, uint16_t)
{
    return open_sockets & 1;
}
size_t EthernetClient::write(uint8_t value)
{
    return write(&value, 1);
}
size_t EthernetClient::write(const uint8_t *bytes, size_t length)
{
    for (size_t i = 0; i < length; i++)
        wire = bytes[i];
    return length;
}
int EthernetClient::available()
{
    return connected() ? wire : 0;
}
int EthernetClient::read()
{
    return connected() ? wire : -1;
}
int EthernetClient::read(uint8_t *bytes, size_t length)
{
    for (size_t i = 0; i < length; i++)
        bytes[i] = wire;
    return static_cast<int>(length);
}
int EthernetClient::peek()
{
    return read();
}
void EthernetClient::flush() {}
void EthernetClient::stop()
{
    socket = 8;
}
uint8_t EthernetClient::connected()
{
    return socket < 8 && (open_sockets >> socket & 1);
}

void EthernetServer::begin()
{
    wire = static_cast<uint8_t>(port);
}
EthernetClient EthernetServer::accept()
{
    EthernetClient client;
    if (open_sockets & 1)
        client.socket = 0;
    return client;
}
size_t EthernetServer::write(uint8_t value)
{
    wire = value;
    return 1;
}
