/* As much of Arduino as the headers name, for a check by avr-g++, which has no
 * standard library. Nothing here is ever linked. */
#ifndef SHIM_AVR_ARDUINO_H
#define SHIM_AVR_ARDUINO_H

#include <stddef.h>
#include <stdint.h>

#define ARDUINO 10819

class __FlashStringHelper;
#define F(text) (reinterpret_cast<const __FlashStringHelper *>(text))

unsigned long micros();
unsigned long millis();
void yield();

class Stream {
public:
    virtual int available() = 0;
    virtual int read() = 0;
    virtual size_t write(uint8_t value) = 0;
    int getWriteError();
    virtual size_t write(const uint8_t *bytes, size_t length) = 0;
    virtual void flush() = 0;
};

class HardwareSerial : public Stream {
public:
    void begin(unsigned long rate);
};

extern HardwareSerial &Serial;

#endif
