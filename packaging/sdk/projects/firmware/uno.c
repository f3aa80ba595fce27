/* The board's functions for an ATmega328P at 16 MHz, as on an Arduino Uno.
 * Licence: MIT OR Apache-2.0. */
#include "board.h"

#include <avr/io.h>

enum { CPU_MHZ = 16, PRESCALER = 64 };

void uart_start(void)
{
    UBRR0 = (uint16_t)(CPU_MHZ * 1000000UL / 16 / BAUD - 1);
    UCSR0B = (1 << RXEN0) | (1 << TXEN0);
}

int16_t uart_read(void *context, uint8_t *bytes, uint16_t capacity)
{
    int16_t count = 0;

    (void)context;
    while (count < (int16_t)capacity && (UCSR0A & (1 << RXC0)))
        bytes[count++] = UDR0;
    return count;
}

int16_t uart_write(void *context, const uint8_t *bytes, uint16_t length)
{
    int16_t count = 0;

    (void)context;
    while (count < (int16_t)length && (UCSR0A & (1 << UDRE0))) {
        UCSR0A |= 1 << TXC0; /* a 1 clears the mark of the last bit */
        UDR0 = bytes[count++];
    }
    return count;
}

uint8_t uart_flush(void *context)
{
    (void)context;
    return (UCSR0A & (1 << TXC0)) != 0;
}

/* Timer 1 counts every 4 us, and wraps after 262 ms. */
void clock_start(void)
{
    TCCR1B = (1 << CS11) | (1 << CS10);
}

uint32_t clock_micros(void *context)
{
    static uint16_t seen;
    static uint32_t micros;
    uint16_t now = TCNT1;

    (void)context;
    micros += (uint32_t)(uint16_t)(now - seen) * (PRESCALER / CPU_MHZ);
    seen = now;
    return micros;
}

/* The board has no console: the LED says that the read succeeded. */
void console_print(const char *text)
{
    (void)text;
}

_Noreturn void console_exit(uint8_t code)
{
    DDRB |= 1 << DDB5;
    if (code == 0)
        PORTB |= 1 << PORTB5;
    for (;;) {
    }
}
