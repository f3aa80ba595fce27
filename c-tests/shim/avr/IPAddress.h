/* An IP address, for checks by compilers for firmware. */
#ifndef SHIM_AVR_IPADDRESS_H
#define SHIM_AVR_IPADDRESS_H

#include <stdint.h>

class IPAddress {
public:
    IPAddress(uint8_t a, uint8_t b, uint8_t c, uint8_t d);

private:
    uint8_t bytes[4];
};

#endif
