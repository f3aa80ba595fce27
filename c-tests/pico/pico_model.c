#include "pico_model.h"

#include "hardware/clocks.h"
#include "hardware/gpio.h"
#include "hardware/irq.h"
#include "pico/time.h"
#include "tusb.h"

#include <string.h>

pico chip;
struct uart_inst {
    uart_hw_t hw;
    uint32_t received[PICO_FIFO];
    uint8_t toSend[PICO_FIFO];
    unsigned receivedCount, toSendCount;
    bool hasOverrun, isOn;
    void (*handler)(void);
};
static struct uart_inst uarts[2];
uart_inst_t *const uart0 = &uarts[0];
uart_inst_t *const uart1 = &uarts[1];
static uint8_t fromHost[PICO_USB_BUFFER], waiting[CFG_TUD_CDC_TX_BUFSIZE], packet[PICO_PACKET];
static unsigned fromHostLength, waitingLength;
/* What is in the endpoint, from which nothing can be taken back. */
static unsigned packetLength;

void pico_reset(void)
{
    memset(&chip, 0, sizeof chip);
    memset(uarts, 0, sizeof uarts);
    chip.isUp = chip.isOpen = chip.reads = true;
    fromHostLength = waitingLength = packetLength = 0;
}

/* --- UART 1 */

static void call(uint32_t cause)
{
    if (!uart1->isOn || !(uart1->hw.imsc & cause))
        return;
    chip.interrupts++;
    uart1->handler();
}

void pico_receive(uint32_t character)
{
    if (uart1->receivedCount == PICO_FIFO) {
        uart1->hasOverrun = true;
        return;
    }
    /* The flag comes with the next character that finds a place. */
    if (uart1->hasOverrun)
        character |= UART_UARTDR_OE_BITS;
    uart1->hasOverrun = false;
    uart1->received[uart1->receivedCount++] = character;
    if (uart1->receivedCount >= 4)
        call(UART_UARTIMSC_RXIM_BITS);
}

void pico_idle(void)
{
    if (uart1->receivedCount > 0)
        call(UART_UARTIMSC_RTIM_BITS);
}

unsigned pico_take(void)
{
    uart1->hw.data[0] = uart1->received[0];
    uart1->receivedCount--;
    memmove(uart1->received, uart1->received + 1, uart1->receivedCount * sizeof uart1->received[0]);
    return 0;
}

bool pico_send(void)
{
    if (uart1->toSendCount == 0 || uart1->hw.cr != UART_UARTCR_UARTEN_BITS)
        return false;
    chip.line[chip.sent++] = uart1->toSend[0];
    uart1->toSendCount--;
    memmove(uart1->toSend, uart1->toSend + 1, uart1->toSendCount);
    if (uart1->toSendCount == 0)
        uart1->hw.fr &= ~UART_UARTFR_BUSY_BITS;
    /* Only when the FIFO falls to its level, half full. */
    if (uart1->toSendCount == 16)
        call(UART_UARTIMSC_TXIM_BITS);
    return true;
}

uart_hw_t *uart_get_hw(uart_inst_t *uart)
{
    return &uart->hw;
}

uint uart_get_index(uart_inst_t *uart)
{
    return uart == uart1;
}

uint uart_init(uart_inst_t *uart, uint baud)
{
    uart->receivedCount = uart->toSendCount = 0;
    uart->hw = (uart_hw_t){.cr = UART_UARTCR_UARTEN_BITS};
    return chip.baud = baud;
}

void uart_set_format(uart_inst_t *uart, uint bits, uint stop, uart_parity_t parity)
{
    (void)uart;
    (void)bits;
    (void)parity;
    chip.stop = stop;
}

void uart_set_fifo_enabled(uart_inst_t *uart, bool enabled)
{
    uart->hw.lcr_h = enabled ? UART_UARTLCR_H_FEN_BITS : 0;
}

void uart_set_irqs_enabled(uart_inst_t *uart, bool receives, bool sends)
{
    uart->hw.imsc = (receives ? UART_UARTIMSC_RXIM_BITS | UART_UARTIMSC_RTIM_BITS : 0) |
                    (sends ? UART_UARTIMSC_TXIM_BITS : 0);
}

bool uart_is_readable(uart_inst_t *uart)
{
    return uart->receivedCount > 0;
}

bool uart_is_writable(uart_inst_t *uart)
{
    return uart->toSendCount < PICO_FIFO;
}

void uart_putc_raw(uart_inst_t *uart, char character)
{
    if (chip.putting != NULL)
        chip.putting();
    uart->toSend[uart->toSendCount++] = (uint8_t)character;
    uart->hw.fr |= UART_UARTFR_BUSY_BITS;
}

void hw_set_bits(volatile uint32_t *where, uint32_t bits)
{
    *where |= bits;
}

void hw_clear_bits(volatile uint32_t *where, uint32_t bits)
{
    *where &= ~bits;
    /* The UART must be off when its FIFOs are switched off, which empties them. */
    for (uart_inst_t *uart = uarts; uart < uarts + 2; uart++)
        if (where == &uart->hw.lcr_h && (bits & UART_UARTLCR_H_FEN_BITS) &&
            !(uart->hw.cr & UART_UARTCR_UARTEN_BITS)) {
            uart->receivedCount = uart->toSendCount = 0;
            uart->hw.fr &= ~UART_UARTFR_BUSY_BITS;
        }
}

void irq_set_exclusive_handler(uint number, void (*handler)(void))
{
    uarts[number - UART0_IRQ].handler = handler;
}

void irq_set_enabled(uint number, bool enabled)
{
    uarts[number - UART0_IRQ].isOn = enabled;
}

/* --- pins and clocks */

uint32_t clock_get_hz(uint clock)
{
    (void)clock;
    return chip.hasNoClock ? 0 : PICO_CLOCK;
}

void gpio_init(uint pin)
{
    chip.pins[pin] = false;
}

void gpio_put(uint pin, bool level)
{
    chip.pins[pin] = level;
}

void gpio_set_dir(uint pin, bool isOutput)
{
    (void)pin;
    (void)isOutput;
}

void gpio_set_function(uint pin, uint function)
{
    (void)pin;
    (void)function;
}

void gpio_pull_up(uint pin)
{
    (void)pin;
}

uint32_t time_us_32(void)
{
    return chip.now;
}

absolute_time_t make_timeout_time_us(uint64_t us)
{
    return chip.now + us;
}

bool best_effort_wfe_or_timeout(absolute_time_t end)
{
    const unsigned before = chip.interrupts;

    while (chip.pass != NULL && chip.interrupts == before && chip.now < end)
        chip.pass();
    if (chip.interrupts == before)
        chip.now = (uint32_t)end;
    return true;
}

/* --- USB */

unsigned pico_from_host(const uint8_t *bytes, unsigned length)
{
    /* A full buffer of the device holds the host back. */
    if (length > PICO_USB_BUFFER - fromHostLength)
        length = PICO_USB_BUFFER - fromHostLength;
    memcpy(fromHost + fromHostLength, bytes, length);
    fromHostLength += length;
    return length;
}

void tud_task_ext(uint32_t most, bool inInterrupt)
{
    (void)most;
    (void)inInterrupt;
    chip.tasks++;
    if (!chip.isUp)
        fromHostLength = waitingLength = packetLength = 0;
    if (chip.reads) {
        memcpy(chip.toHost + chip.toHostLength, packet, packetLength);
        chip.toHostLength += packetLength;
        packetLength = 0;
        tud_cdc_n_write_flush(0);
    }
}

bool tud_ready(void)
{
    return chip.isUp;
}

bool tud_cdc_n_connected(uint8_t number)
{
    (void)number;
    return chip.isUp && chip.isOpen;
}

uint32_t tud_cdc_n_read(uint8_t number, void *bytes, uint32_t capacity)
{
    uint32_t length = fromHostLength < capacity ? fromHostLength : capacity;

    (void)number;
    memcpy(bytes, fromHost, length);
    fromHostLength -= length;
    memmove(fromHost, fromHost + length, fromHostLength);
    return length;
}

void tud_cdc_n_read_flush(uint8_t number)
{
    (void)number;
    fromHostLength = 0;
}

uint32_t tud_cdc_n_write(uint8_t number, const void *bytes, uint32_t length)
{
    (void)number;
    memcpy(waiting + waitingLength, bytes, length);
    waitingLength += length;
    return length;
}

uint32_t tud_cdc_n_write_available(uint8_t number)
{
    (void)number;
    return CFG_TUD_CDC_TX_BUFSIZE - waitingLength;
}

uint32_t tud_cdc_n_write_flush(uint8_t number)
{
    (void)number;
    if (packetLength > 0)
        return 0;
    packetLength = waitingLength < PICO_PACKET ? waitingLength : PICO_PACKET;
    memcpy(packet, waiting, packetLength);
    waitingLength -= packetLength;
    memmove(waiting, waiting + packetLength, waitingLength);
    return packetLength;
}

bool tud_cdc_n_write_clear(uint8_t number)
{
    (void)number;
    waitingLength = 0;
    return true;
}
