/* The part of Arduino's Print that the library and its examples use. */
#ifndef SHIM_PRINT_H
#define SHIM_PRINT_H

#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>

#define DEC 10
#define HEX 16

/* On an AVR these texts stay in flash. */
class __FlashStringHelper;
#define F(text) (reinterpret_cast<const __FlashStringHelper *>(text))

class Print {
    int writeError = 0;

protected:
    void setWriteError(int error = 1) { writeError = error; }

public:
    virtual ~Print() = default;
    int getWriteError() { return writeError; }
    void clearWriteError() { setWriteError(0); }
    virtual size_t write(uint8_t value) = 0;
    virtual size_t write(const uint8_t *bytes, size_t length)
    {
        size_t count = 0;
        while (count < length && write(bytes[count]) == 1)
            count++;
        return count;
    }

    size_t print(const char *text)
    {
        return write(reinterpret_cast<const uint8_t *>(text), strlen(text));
    }
    size_t print(const __FlashStringHelper *text)
    {
        return print(reinterpret_cast<const char *>(text));
    }
    size_t print(char value) { return write(static_cast<uint8_t>(value)); }
    size_t print(unsigned long value, int base = DEC)
    {
        char text[24];
        snprintf(text, sizeof text, base == HEX ? "%lX" : "%lu", value);
        return print(text);
    }
    size_t print(long value, int base = DEC)
    {
        return base == DEC && value < 0 ? print('-') + print(0 - static_cast<unsigned long>(value))
                                        : print(static_cast<unsigned long>(value), base);
    }
    size_t print(int value, int base = DEC) { return print(long{value}, base); }
    size_t print(unsigned value, int base = DEC)
    {
        return print(static_cast<unsigned long>(value), base);
    }
    size_t print(unsigned char value, int base = DEC)
    {
        return print(static_cast<unsigned long>(value), base);
    }
    size_t print(double value, int digits = 2)
    {
        char text[64];
        snprintf(text, sizeof text, "%.*f", digits, value);
        return print(text);
    }
    size_t println() { return print("\r\n"); }
    template <typename Value> size_t println(Value value)
    {
        size_t count = print(value);
        return count + println();
    }
    template <typename Value> size_t println(Value value, int base)
    {
        size_t count = print(value, base);
        return count + println();
    }
};

#endif
