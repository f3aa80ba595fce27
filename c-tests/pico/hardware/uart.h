/* What the port for the Pico uses of pico-sdk, played by pico_model.c. */
#ifndef PICO_MODEL_UART_H
#define PICO_MODEL_UART_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

typedef unsigned int uint;
typedef struct uart_inst uart_inst_t;
typedef enum { UART_PARITY_NONE, UART_PARITY_EVEN, UART_PARITY_ODD } uart_parity_t;
typedef struct uart_hw {
    volatile uint32_t fr, imsc, cr, lcr_h;
    volatile uint32_t data[1];
} uart_hw_t;
/* A read of the data register takes a character out of the FIFO. */
#define dr data[pico_take()]

#define UART_UARTFR_BUSY_BITS (1u << 3)
#define UART_UARTCR_UARTEN_BITS 1u
#define UART_UARTLCR_H_FEN_BITS (1u << 4)
#define UART_UARTDR_FE_BITS (1u << 8)
#define UART_UARTDR_PE_BITS (1u << 9)
#define UART_UARTDR_BE_BITS (1u << 10)
#define UART_UARTDR_OE_BITS (1u << 11)
#define UART_UARTIMSC_RXIM_BITS (1u << 4)
#define UART_UARTIMSC_TXIM_BITS (1u << 5)
#define UART_UARTIMSC_RTIM_BITS (1u << 6)
#define UART0_IRQ 20u
#define UART1_IRQ 21u
#define UART_FUNCSEL_NUM(uart, pin) 2u
#define UART_CLOCK_NUM(uart) 6u

extern uart_inst_t *const uart0;
extern uart_inst_t *const uart1;

uart_hw_t *uart_get_hw(uart_inst_t *uart);
uint uart_get_index(uart_inst_t *uart);
uint uart_init(uart_inst_t *uart, uint baud);
void uart_set_format(uart_inst_t *uart, uint bits, uint stop, uart_parity_t parity);
void uart_set_fifo_enabled(uart_inst_t *uart, bool enabled);
void uart_set_irqs_enabled(uart_inst_t *uart, bool receives, bool sends);
bool uart_is_readable(uart_inst_t *uart);
bool uart_is_writable(uart_inst_t *uart);
void uart_putc_raw(uart_inst_t *uart, char character);
void hw_set_bits(volatile uint32_t *where, uint32_t bits);
void hw_clear_bits(volatile uint32_t *where, uint32_t bits);
unsigned pico_take(void);

#endif
