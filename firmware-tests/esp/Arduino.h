/* What sketches for an ESP use of its Arduino core, as declarations:
 * firmware-tests/avr/check-sketches compiles sketches against it where their own core is not to be
 * had. Nothing links it. */
#ifndef ESP_ARDUINO_H
#define ESP_ARDUINO_H

#include <math.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <algorithm>
#include <functional>
#include <memory>

#define ARDUINO 10819
#define ESP32 1
#define ARDUINO_ARCH_ESP32 1

using std::isinf;
using std::isnan;
using std::max;
using std::min;

typedef uint8_t byte;
typedef bool boolean;
typedef unsigned int word;

enum { LOW, HIGH };
enum { INPUT = 1, OUTPUT = 3, INPUT_PULLUP = 5, INPUT_PULLDOWN = 9 };
enum { BIN = 2, OCT = 8, DEC = 10, HEX = 16 };
enum { D0 = 16, D1 = 5, D2 = 4, D3 = 0, D4 = 2, D5 = 14, D6 = 12, D7 = 13, D8 = 15, A0 = 17 };
enum { LED_BUILTIN = 2 };
#define SERIAL_8N1 0x800001c
#define SERIAL_8N2 0x800003c
#define SERIAL_8E1 0x800001e
#define SERIAL_8O1 0x800001f

#define lowByte(w) ((uint8_t)((w)&0xff))
#define highByte(w) ((uint8_t)((w) >> 8))
#define bitRead(value, bit) (((value) >> (bit)) & 0x01)
#define PROGMEM
#define IRAM_ATTR

unsigned long millis();
unsigned long micros();
void delay(uint32_t ms);
void delayMicroseconds(uint32_t us);
void yield();
void pinMode(uint8_t pin, uint8_t mode);
void digitalWrite(uint8_t pin, uint8_t level);
int digitalRead(uint8_t pin);
uint16_t analogRead(uint8_t pin);
long random(long from, long to);
char *dtostrf(double value, signed char width, unsigned char digits, char *text);

class __FlashStringHelper;
#define F(text) (reinterpret_cast<const __FlashStringHelper *>(text))

class String {
public:
    String(const char *text = "");
    String(const __FlashStringHelper *text);
    explicit String(char c, unsigned char base = 10);
    explicit String(unsigned char value, unsigned char base = 10);
    explicit String(int value, unsigned char base = 10);
    explicit String(unsigned int value, unsigned char base = 10);
    explicit String(long value, unsigned char base = 10);
    explicit String(unsigned long value, unsigned char base = 10);
    explicit String(float value, unsigned int digits = 2);
    explicit String(double value, unsigned int digits = 2);
    String &operator+=(const String &text);
    String &operator+=(const char *text);
    String &operator+=(char c);
    String &operator+=(int value);
    bool operator==(const String &text) const;
    bool operator==(const char *text) const;
    bool operator!=(const String &text) const;
    char operator[](unsigned int index) const;
    unsigned int length() const;
    const char *c_str() const;
    String substring(unsigned int from) const;
    String substring(unsigned int from, unsigned int to) const;
    void toCharArray(char *text, unsigned int size) const;
    long toInt() const;
    float toFloat() const;
    char charAt(unsigned int index) const;
    int indexOf(const String &text) const;
    void trim();
};
String operator+(const String &left, const String &right);
String operator+(const String &left, const char *right);
String operator+(const char *left, const String &right);
String operator+(const String &left, char right);
String operator+(const String &left, int right);

class IPAddress {
public:
    IPAddress(uint8_t a = 0, uint8_t b = 0, uint8_t c = 0, uint8_t d = 0);
    String toString() const;
};

class Print {
public:
    virtual ~Print() {}
    virtual size_t write(uint8_t value) = 0;
    virtual size_t write(const uint8_t *bytes, size_t length);
    size_t write(const char *text);
    int getWriteError();
    void clearWriteError();
    virtual int availableForWrite();
    size_t printf(const char *format, ...);
#define MBM_PRINT(name)                                                                            \
    size_t name(const __FlashStringHelper *text);                                                  \
    size_t name(const String &text);                                                               \
    size_t name(const char *text);                                                                 \
    size_t name(char c);                                                                           \
    size_t name(unsigned char value, int base = DEC);                                              \
    size_t name(int value, int base = DEC);                                                        \
    size_t name(unsigned int value, int base = DEC);                                               \
    size_t name(long value, int base = DEC);                                                       \
    size_t name(unsigned long value, int base = DEC);                                              \
    size_t name(double value, int digits = 2);                                                     \
    size_t name(const IPAddress &address);
    MBM_PRINT(print)
    MBM_PRINT(println)
    size_t println();
};

class Stream : public Print {
public:
    using Print::write;
    virtual int available() = 0;
    virtual int read() = 0;
    virtual int peek() = 0;
    virtual void flush() {}
    void setTimeout(unsigned long ms);
    size_t readBytes(char *bytes, size_t length);
    String readStringUntil(char end);
};

class HardwareSerial : public Stream {
public:
    HardwareSerial(int port);
    using Print::write;
    void begin(unsigned long baud, uint32_t config = SERIAL_8N1, int8_t rx = -1, int8_t tx = -1,
               bool invert = false, unsigned long timeout = 20000);
    void end();
    int available() override;
    int read() override;
    int peek() override;
    void flush() override;
    size_t write(uint8_t value) override;
    size_t write(unsigned long value) { return write((uint8_t)value); }
    size_t write(long value) { return write((uint8_t)value); }
    size_t write(unsigned int value) { return write((uint8_t)value); }
    size_t write(int value) { return write((uint8_t)value); }
    operator bool() const;
};
extern HardwareSerial Serial, Serial1, Serial2;

#endif
