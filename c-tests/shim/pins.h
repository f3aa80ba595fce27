/* The pins of the simulated board. The sketch drives them, and the test reads them. */
#ifndef SHIM_PINS_H
#define SHIM_PINS_H

#include "board.h"

#include <stdint.h>

#define LOW 0
#define HIGH 1
#define INPUT 0
#define OUTPUT 1
#define LED_BUILTIN 13
#define A0 14

struct Pins {
    bool areLogged = false; /* each level goes to the log of the board, such as "2=1" */
    uint8_t level[32] = {};
    uint8_t mode[32] = {};  /* INPUT or OUTPUT */
    uint8_t rises[32] = {}; /* how often each pin was set high */
    int voltage[32] = {};   /* what analogRead returns, 0 to 1023 */
};

inline Pins &pins()
{
    static Pins only;
    return only;
}

inline void pinMode(uint16_t pin, uint8_t mode)
{
    pins().mode[pin] = mode;
}
inline void digitalWrite(uint16_t pin, uint8_t level)
{
    pins().rises[pin] = static_cast<uint8_t>(pins().rises[pin] + (level != LOW));
    pins().level[pin] = level != LOW;
    if (pins().areLogged)
        board().logEvent((std::to_string(pin) + (level != LOW ? "=1" : "=0")).c_str());
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
