/* The part of Arduino's IPAddress that the shim's network uses. */
#ifndef SHIM_IPADDRESS_H
#define SHIM_IPADDRESS_H

#include <stdint.h>

class IPAddress {
public:
    IPAddress() : bytes() {}
    IPAddress(uint8_t a, uint8_t b, uint8_t c, uint8_t d) : bytes{a, b, c, d} {}
    uint8_t operator[](int index) const { return bytes[index]; }

private:
    uint8_t bytes[4];
};

#endif
