/* Reads two holding registers of unit 17 on the UART of an MPS2 board, prints them on the console
 * of the debugger, and ends.
 *
 * Licence: MIT OR Apache-2.0. */
#include <mbm.h>

#define REGISTER(address) (*(volatile uint32_t *)(uintptr_t)(address))
/* The UART and a timer of Arm's Cortex-M system design kit. */
#define UART_DATA REGISTER(0x40004000)
#define UART_STATE REGISTER(0x40004004)
#define UART_CONTROL REGISTER(0x40004008)
#define UART_DIVISOR REGISTER(0x40004010)
#define TIMER_CONTROL REGISTER(0x40000000)
#define TIMER_VALUE REGISTER(0x40000004)
#define TIMER_RELOAD REGISTER(0x40000008)
#define COPROCESSORS REGISTER(0xE000ED88)

enum { TX_FULL = 1, RX_FULL = 2, TX_RX_ENABLE = 3, TIMER_ENABLE = 1 };
enum { MHZ = 25, BAUD = 19200, FIRST = 2, COUNT = 2 };
/* Semihosting: print a text, end the simulator. */
enum { PRINT = 0x04, EXIT = 0x18, EXIT_OK = 0x20026, EXIT_ERROR = 0x20023 };

int main(void);
void reset(void);
extern uint32_t stack_top[], data_load[], data_start[], data_end[], bss_start[], bss_end[];

static void debugger(uint32_t operation, uint32_t argument)
{
    register uint32_t r0 __asm__("r0") = operation;
    register uint32_t r1 __asm__("r1") = argument;

    __asm__ volatile("bkpt 0xAB" : "+r"(r0) : "r"(r1) : "memory");
}

static void print(const char *text)
{
    debugger(PRINT, (uint32_t)(uintptr_t)text);
}

static void print_number(uint16_t number)
{
    char digits[6];
    char *at = digits + sizeof digits - 1;

    *at = '\0';
    do
        *--at = (char)('0' + number % 10);
    while (number /= 10);
    print(at);
}

static int16_t uart_read(void *context, uint8_t *bytes, uint16_t capacity)
{
    int16_t count = 0;

    (void)context;
    while (count < (int16_t)capacity && (UART_STATE & RX_FULL))
        bytes[count++] = (uint8_t)UART_DATA;
    return count;
}

static int16_t uart_write(void *context, const uint8_t *bytes, uint16_t length)
{
    int16_t count = 0;

    (void)context;
    while (count < (int16_t)length && !(UART_STATE & TX_FULL))
        UART_DATA = bytes[count++];
    return count;
}

/* The timer counts down from 2^32 in 171 s, which is longer than this program runs. */
static uint32_t clock_micros(void *context)
{
    (void)context;
    return (UINT32_MAX - TIMER_VALUE) / MHZ;
}

static const mbm_port port = {.read = uart_read, .write = uart_write, .micros = clock_micros};
static mbm_line line = MBM_INIT;
static mbm_node meter = MBM_INIT;
static uint16_t response[COUNT];
static uint8_t frame[MBM_FRAME_BYTES(COUNT)];

int main(void)
{
    uint8_t status;

    mbm_line_beginRtu(&line, &port, frame, sizeof frame);
    mbm_line_setBaudRate(&line, BAUD);
    mbm_node_begin(&meter, &line, 17, response, COUNT, NULL, 0);
    status = mbm_node_readHoldingRegisters(&meter, FIRST, COUNT);
    if (status != MBM_OK) {
        print(mbm_status_text(status));
        return 1;
    }
    for (uint8_t i = 0; i < COUNT; i++) {
        print("register ");
        print_number((uint16_t)(FIRST + i));
        print(": ");
        print_number(response[i]);
        print("\n");
    }
    return 0;
}

void reset(void)
{
    const uint32_t *from = data_load;

    COPROCESSORS |= 0xFu << 20; /* the FPU */
    __asm__ volatile("dsb\n isb" ::: "memory");
    for (uint32_t *to = data_start; to < data_end; to++)
        *to = *from++;
    for (uint32_t *to = bss_start; to < bss_end; to++)
        *to = 0;
    TIMER_RELOAD = UINT32_MAX;
    TIMER_VALUE = UINT32_MAX;
    TIMER_CONTROL = TIMER_ENABLE;
    UART_DIVISOR = MHZ * 1000000 / BAUD;
    UART_CONTROL = TX_RX_ENABLE;
    debugger(EXIT, main() == 0 ? EXIT_OK : EXIT_ERROR);
    for (;;) {
    }
}

__attribute__((section(".vectors"), used)) static const struct {
    uint32_t *stack;
    void (*reset)(void);
} vectors = {stack_top, reset};
