/* The pins of the simulated board. The sketch drives them, and the test reads them. */
#ifndef SHIM_PINS_H
#define SHIM_PINS_H

#include <stdint.h>

#define LOW 0
#define HIGH 1
#define INPUT 0
#define OUTPUT 1
#define LED_BUILTIN 13
#define A0 14

struct Pins {
    uint8_t level[32] = {};
    uint8_t rises[32] = {}; /* how often each pin was set high */
    int voltage[32] = {};   /* what analogRead returns, 0 to 1023 */
};

inline Pins &pins()
{
    static Pins only;
    return only;
}

inline void pinMode(uint8_t, uint8_t) {}
inline void digitalWrite(uint8_t pin, uint8_t level)
{
    pins().rises[pin] = static_cast<uint8_t>(pins().rises[pin] + (level != LOW));
    pins().level[pin] = level != LOW;
}
inline int digitalRead(uint8_t pin)
{
    return pins().level[pin];
}
inline int analogRead(uint8_t pin)
{
    return pins().voltage[pin];
}

#endif
