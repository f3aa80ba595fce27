/* The part of Arduino's Server that network libraries derive from. */
#ifndef SHIM_AVR_SERVER_H
#define SHIM_AVR_SERVER_H

#include "Arduino.h"

class Server : public Print {
public:
    virtual void begin() = 0;
};

#endif
