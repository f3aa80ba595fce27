/* Runs a sketch on a simulated Uno, with a Modbus device on its UART:
 *
 *     run_uno SKETCH.elf
 *
 * The sketch is ReadRegisters.ino. The device is unit 17. It damages its first reply, and answers
 * the next request rightly with 900 in register 2. So the sketch must set the PWM of pin 9 to 225
 * after the second reply, and not before.
 *
 * Licence: MIT OR Apache-2.0. */
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <simavr/avr_uart.h>
#include <simavr/sim_avr.h>
#include <simavr/sim_elf.h>

enum { CLOCK = 16000000, UNIT = 17, FIRST = 2, COUNT = 6, VALUE = 900, SECONDS = 5 };
/* Pin 9 is output A of timer 1, whose compare register is here. */
enum { OCR1AL = 0x88 };
/* The simulator takes 11 bits for a byte. */
enum { BYTE_CYCLES = CLOCK / 19200 * 11 };

static avr_irq_t *receiver;
static uint8_t request[8], reply[5 + 2 * COUNT];
static unsigned got, sent, length, requests;

static uint16_t crc(const uint8_t *bytes, unsigned count)
{
    uint16_t sum = 0xFFFF;

    while (count--) {
        sum ^= *bytes++;
        for (int i = 0; i < 8; i++)
            sum = sum & 1 ? (uint16_t)(sum >> 1) ^ 0xA001 : sum >> 1;
    }
    return sum;
}

static void fail(const char *why)
{
    fprintf(stderr, "run_uno: %s\n", why);
    exit(1);
}

static uint8_t pin9(const avr_t *avr)
{
    return avr->data[OCR1AL];
}

static avr_cycle_count_t send(avr_t *avr, avr_cycle_count_t when, void *context)
{
    (void)context;
    (void)avr;
    avr_raise_irq(receiver, reply[sent++]);
    return sent < length ? when + BYTE_CYCLES : 0;
}

static void answer(avr_t *avr)
{
    const uint8_t wanted[6] = {UNIT, 3, 0, FIRST, 0, COUNT};
    uint16_t sum = crc(request, 6);

    if (memcmp(request, wanted, sizeof wanted) || request[6] != (sum & 0xFF) ||
        request[7] != sum >> 8)
        fail("the sketch sends a wrong request");
    if (pin9(avr) != 0 && requests < 2)
        fail("the sketch takes a value from a damaged reply");
    memset(reply, 0, sizeof reply);
    reply[0] = UNIT;
    reply[1] = 3;
    reply[2] = 2 * COUNT;
    reply[3] = VALUE >> 8;
    reply[4] = VALUE & 0xFF;
    length = sizeof reply;
    sum = crc(reply, length - 2);
    reply[length - 2] = (uint8_t)sum;
    reply[length - 1] = (uint8_t)(sum >> 8);
    if (requests++ == 0)
        reply[4] ^= 1;
    sent = 0;
    avr_cycle_timer_register(avr, 4 * BYTE_CYCLES, send, NULL);
}

static void from_sketch(struct avr_irq_t *irq, uint32_t value, void *context)
{
    (void)irq;
    request[got++] = (uint8_t)value;
    if (got == sizeof request) {
        got = 0;
        answer(context);
    }
}

static void only_errors(avr_t *avr, const int level, const char *format, va_list arguments)
{
    (void)avr;
    if (level == LOG_ERROR)
        vfprintf(stderr, format, arguments);
}

int main(int argc, char **argv)
{
    elf_firmware_t firmware = {0};
    avr_t *avr = avr_make_mcu_by_name("atmega328p");
    uint32_t flags = 0, uart = (uint32_t)AVR_IOCTL_UART_GETIRQ('0');

    avr_global_logger_set(only_errors);
    if (argc != 2 || elf_read_firmware(argv[1], &firmware) || !avr)
        fail("usage: run_uno SKETCH.elf");
    avr_init(avr);
    firmware.frequency = CLOCK;
    avr_load_firmware(avr, &firmware);
    avr_ioctl(avr, (uint32_t)AVR_IOCTL_UART_GET_FLAGS('0'), &flags);
    flags &= (uint32_t) ~(AVR_UART_FLAG_STDIO | AVR_UART_FLAG_POOL_SLEEP);
    avr_ioctl(avr, (uint32_t)AVR_IOCTL_UART_SET_FLAGS('0'), &flags);
    receiver = avr_io_getirq(avr, uart, UART_IRQ_INPUT);
    avr_irq_register_notify(avr_io_getirq(avr, uart, UART_IRQ_OUTPUT), from_sketch, avr);

    while (avr->cycle < (uint64_t)SECONDS * CLOCK && pin9(avr) != VALUE / 4) {
        int state = avr_run(avr);
        if (state == cpu_Done || state == cpu_Crashed)
            fail("the sketch crashes");
    }
    if (requests < 2 || pin9(avr) != VALUE / 4)
        fail("the sketch does not set pin 9 to the value that it read");
    printf("run_uno: the sketch read %d after a damaged reply, with %u requests\n", VALUE,
           requests);
    return 0;
}
