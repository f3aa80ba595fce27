/* The part of Arduino's Client that the headers use, for a check by avr-g++. */
#ifndef SHIM_AVR_CLIENT_H
#define SHIM_AVR_CLIENT_H

#include "Arduino.h"
#include "IPAddress.h"

class Client : public Stream {
public:
    using Stream::read;
    using Stream::write;
    virtual int connect(IPAddress ip, uint16_t port) = 0;
    virtual int connect(const char *host, uint16_t port) = 0;
    virtual int read(uint8_t *bytes, size_t length) = 0;
    virtual void stop() = 0;
    virtual uint8_t connected() = 0;
    virtual operator bool() = 0;
};

#endif
