/* Arduino's Client: the base of every network library's connection. */
#ifndef SHIM_CLIENT_H
#define SHIM_CLIENT_H

#include "Arduino.h"
#include "IPAddress.h"

class Client : public Stream {
public:
    using Stream::write;
    virtual int connect(IPAddress ip, uint16_t port) = 0;
    virtual int connect(const char *host, uint16_t port) = 0;
    size_t write(uint8_t value) override = 0;
    size_t write(const uint8_t *bytes, size_t length) override = 0;
    int available() override = 0;
    int read() override = 0;
    virtual int read(uint8_t *bytes, size_t length) = 0;
    int peek() override = 0;
    void flush() override = 0;
    virtual void stop() = 0;
    virtual uint8_t connected() = 0;
    virtual operator bool() = 0;
};

#endif
