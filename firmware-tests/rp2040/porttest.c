/* The port of a Pico's UART in the test kit for ports, with pico-sdk, in the emulator rp2040js:
 * GPIO 4 is wired to GPIO 5. The emulator's UART sends at once and is never busy, so no time on the
 * wire is judged. UART 0 is the console. */
#include "mbm_pico.h"
#include "mbm_porttest.h"

#include "hardware/gpio.h"
#include "pico/stdlib.h"

enum { DRIVER = 6 };

static mbm_picoUart line;
static mbm_port port;

static void print(const char *text)
{
    uart_puts(uart0, text);
}

static void say(void *context, mbm_portFinding kind, const char *sentence)
{
    (void)context;
    print(mbm_portFinding_name(kind));
    print(": ");
    print(sentence);
    print("\n");
}

static uint32_t lost(void *context)
{
    (void)context;
    return mbm_picoUart_lost(&line) + line.overruns;
}

static uint8_t driver(void *context)
{
    (void)context;
    return gpio_get_out_level(DRIVER);
}

static uint8_t begin(void *context)
{
    (void)context;
    return mbm_picoUart_open(&line, &port) != MBM_OK;
}

int main(void)
{
    static mbm_portTest test = MBM_INIT;

    uart_init(uart0, 115200);
    gpio_set_function(0, GPIO_FUNC_UART);
    line.uart = uart1;
    line.baud = 115200;
    line.parity = UART_PARITY_EVEN;
    line.txPin = 4;
    line.rxPin = 5;
    line.driverPin = DRIVER;
    line.hasDriver = true;
    if (begin(NULL))
        print("the UART does not begin\n");
    test.port = &port;
    test.isLooped = 1;
    test.holds = MBM_MAX_FRAME;
    test.say = say;
    test.lost = lost;
    test.driver = driver;
    test.begin = begin;
    print(mbm_portTest_run(&test) == 0 ? "the port passes\n" : "the port does not pass\n");
    for (;;)
        tight_loop_contents();
}
