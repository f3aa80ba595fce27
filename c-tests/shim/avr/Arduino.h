/* The part of Arduino that the headers and the gateway example use, for checks by
 * compilers for firmware. They have no standard library, and nothing is linked. */
#ifndef SHIM_AVR_ARDUINO_H
#define SHIM_AVR_ARDUINO_H

#include <stddef.h>
#include <stdint.h>

#define ARDUINO 10819

class __FlashStringHelper;
#define F(text) (reinterpret_cast<const __FlashStringHelper *>(text))

#define LOW 0
#define HIGH 1
#define OUTPUT 1

unsigned long micros();
unsigned long millis();
void yield();
void pinMode(uint8_t pin, uint8_t mode);
void digitalWrite(uint8_t pin, uint8_t level);

#define DEC 10
#define HEX 16

class Print {
public:
    int getWriteError();
    virtual size_t write(uint8_t value) = 0;
    virtual size_t write(const uint8_t *bytes, size_t length);
    size_t print(const __FlashStringHelper *text);
    size_t print(char value);
    size_t print(unsigned char value, int base = DEC);
    size_t print(int value, int base = DEC);
    size_t print(unsigned value, int base = DEC);
    size_t print(unsigned long value, int base = DEC);
    size_t println();
};

class Stream : public Print {
public:
    virtual int available() = 0;
    virtual int read() = 0;
    virtual int peek() = 0;
    virtual void flush() = 0;
};

class HardwareSerial : public Stream {
public:
    void begin(unsigned long rate);
};

extern HardwareSerial &Serial;

#endif
