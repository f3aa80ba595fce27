/* The silence that a UART of an AVR asks for, computed from registers of the test. The sketches
 * Rates and Silences of firmware-tests show it on the wire. */
#define __AVR__ // NOLINT(bugprone-reserved-identifier): as a compiler for AVRs does
#define F_CPU 16000000UL
#define HardwareSerial_h
#define UBRR0H
#include "Arduino.h"
#include "ModbusMasterUart.h"

extern "C" {
#include "test.h"
}

struct Registers {
    uint8_t high, low, mode;
};

/* A port as the core for AVRs has it. */
class Uart {
public:
    explicit Uart(Registers &r) : _ubrrh(&r.high), _ubrrl(&r.low), _ucsra(&r.mode) {}

protected:
    volatile uint8_t *const _ubrrh;
    volatile uint8_t *const _ubrrl;
    volatile uint8_t *const _ucsra;
};

/* A port of a core that keeps its registers to itself. */
class OtherUart {
public:
    explicit OtherUart(Registers &r) : _ubrrh(&r.high) {}
    bool isSlow() const { return *_ubrrh > 0; }

private:
    volatile uint8_t *const _ubrrh;
};

enum { DOUBLES = 2, OTHER_BITS = 0x61 };

/* Sets the registers as HardwareSerial::begin does. Returns cycles of a bit. */
static unsigned set_rate(Registers &r, unsigned long rate, bool doubles)
{
    const unsigned cycles = doubles ? 8 : 16;
    const unsigned divider = static_cast<unsigned>((F_CPU / (cycles / 2) / rate + 1) / 2);

    r.high = static_cast<uint8_t>((divider - 1) >> 8);
    r.low = static_cast<uint8_t>(divider - 1);
    r.mode = static_cast<uint8_t>(OTHER_BITS | (doubles ? DOUBLES : 0));
    return divider * cycles;
}

TEST(the_silence_is_at_least_t3_5_and_at_most_4_percent_more)
{
    Registers r = {0, 0, 0};
    const Uart uart(r);

    for (unsigned long rate : {488UL, 600UL, 1200UL, 2400UL, 4800UL, 9600UL, 14400UL, 19200UL}) {
        for (bool doubles : {false, true}) {
            const unsigned bit = set_rate(r, rate, doubles);
            const unsigned kept = ModbusMasterUart<Uart>::silenceOf(uart) * 4u * 16u;

            assert_in_range(kept, bit * 385 / 10, bit * 385 / 10 * 104 / 100);
        }
    }
    set_rate(r, 300, false);
    assert_in_range(ModbusMasterUart<Uart>::silenceOf(uart) * 4u, 128333, 133500);
}

TEST(above_19200_baud_the_silence_is_1750_us)
{
    Registers r = {0, 0, 0};
    const Uart uart(r);

    for (unsigned long rate : {38400UL, 57600UL, 115200UL, 250000UL, 1000000UL}) {
        for (bool doubles : {false, true}) {
            set_rate(r, rate, doubles);
            assert_in_range(ModbusMasterUart<Uart>::silenceOf(uart) * 4u, 1750, 1753);
        }
    }
}

TEST(the_silence_of_the_slowest_divider_does_not_overflow)
{
    Registers r = {0x0F, 0xFF, 0};
    const Uart uart(r);

    assert_in_range(ModbusMasterUart<Uart>::silenceOf(uart) * 4u, 157000, 164000);
}

TEST(a_core_that_hides_its_registers_gets_the_default_silence)
{
    Registers r = {0, 16, DOUBLES};
    const OtherUart uart(r);

    assert_false(uart.isSlow());
    assert_int_equal(ModbusMasterUart<OtherUart>::silenceOf(uart) * 4u, 4000);
}
