/* The port for the Raspberry Pi Pico in the test kit for ports, on a model of its UART, whose TX is
 * wired to RX, and over USB, with a host at the other end. */
#include "mbm_pico.h"
#include "pico_model.h"
#include "porttest.h"
#include "test.h"

enum { DRIVER = 6, BAUD = 9600, BITS = 11, STEP = 2 /* microseconds */ };
/* Microseconds. The FIFO calls the interrupt after 32 bits of silence. */
static const uint32_t character = BITS * 1000000u / BAUD, silence = 32 * 1000000u / BAUD;

static mbm_picoUart line;
static mbm_picoUsb usb;
static mbm_port port, host;
static mbm_portTest test;

/* --- UART */

/* When the character that is leaving has left, and since when nothing has come. */
static uint32_t leaves, came;
static bool isLeaving;

/* Time passes: a character leaves, and comes back. */
static void pass(uint32_t microseconds)
{
    chip.now += microseconds;
    if (!isLeaving && (uart_get_hw(uart1)->fr & UART_UARTFR_BUSY_BITS)) {
        isLeaving = true;
        leaves = chip.now + character;
    }
    while (isLeaving && (int32_t)(chip.now - leaves) >= 0) {
        chip.sent = 0;
        isLeaving = pico_send();
        if (isLeaving)
            pico_receive(chip.line[0]);
        came = leaves;
        leaves += character;
        isLeaving = (uart_get_hw(uart1)->fr & UART_UARTFR_BUSY_BITS) != 0;
    }
    if (chip.now - came >= silence)
        pico_idle();
}

/* The clock goes on while the program looks at it. */
static uint32_t micros(void *context)
{
    (void)context;
    pass(STEP);
    return chip.now;
}

static void pass_some(void)
{
    pass(10 * STEP);
}

static void yield(void *context)
{
    (void)context;
    pass_some();
}

static uint32_t lost(void *context)
{
    (void)context;
    return mbm_picoUart_lost(&line) + line.overruns;
}

static uint8_t driver(void *context)
{
    (void)context;
    return chip.pins[DRIVER];
}

static void disturb(void *context)
{
    (void)context;
    pico_receive(UART_UARTDR_FE_BITS | UART_UARTDR_BE_BITS);
    pass(10 * silence);
}

static uint8_t open_uart(void *context)
{
    (void)context;
    chip.pass = pass_some;
    if (mbm_picoUart_open(&line, &port) != MBM_OK)
        return 1;
    port.micros = micros;
    return 0;
}

static void begin(void)
{
    pico_reset();
    memset(&line, 0, sizeof line);
    memset(&usb, 0, sizeof usb);
    memset(&test, 0, sizeof test);
    isLeaving = false;
    came = 0;
    line.uart = uart1;
    line.baud = BAUD;
    line.parity = UART_PARITY_EVEN;
    line.txPin = 4;
    line.rxPin = 5;
    line.driverPin = DRIVER;
    line.hasDriver = true;
    test.port = &port;
    test.say = porttest_say;
}

fixture each_test = {begin, NULL};

TEST(the_port_for_the_uart_of_a_pico)
{
    assert_int_equal(open_uart(NULL), 0);
    test.isLooped = 1;
    test.bits = BITS;
    test.baud = BAUD;
    test.holds = MBM_MAX_FRAME;
    test.lost = lost;
    test.driver = driver;
    test.begin = open_uart;
    test.disturb = disturb;
    test.yield = yield;
    assert_int_equal(mbm_portTest_run(&test), 0);
    assert_int_equal(test.advice, 0);
    assert_int_equal(test.leftOut, 0);
    assert_int_equal(line.faulty, 1);
}

/* --- USB */

static int16_t host_read(void *context, uint8_t *bytes, uint16_t capacity)
{
    const unsigned length = chip.toHostLength < capacity ? chip.toHostLength : capacity;

    (void)context;
    memcpy(bytes, chip.toHost, length);
    chip.toHostLength -= length;
    memmove(chip.toHost, chip.toHost + length, chip.toHostLength);
    return (int16_t)length;
}

static int16_t host_write(void *context, const uint8_t *bytes, uint16_t length)
{
    (void)context;
    return (int16_t)pico_from_host(bytes, length);
}

static uint32_t usb_micros(void *context)
{
    (void)context;
    return chip.now += STEP;
}

static uint8_t open_usb(void *context)
{
    (void)context;
    if (mbm_picoUsb_open(&usb, &port) != MBM_OK)
        return 1;
    port.micros = usb_micros;
    return 0;
}

TEST(the_port_for_the_usb_of_a_pico)
{
    assert_int_equal(open_usb(NULL), 0);
    host = (mbm_port){.read = host_read, .write = host_write, .micros = usb_micros};
    test.other = &host;
    test.holds = PICO_USB_BUFFER;
    test.begin = open_usb;
    assert_int_equal(mbm_portTest_run(&test), 0);
    assert_in_range(test.checks, 8, 100);
}
