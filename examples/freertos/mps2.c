/* See mps2.h: start-up, console, and the registers of the line's UART. For another chip, write the
 * functions of the line anew: mps2_startLine, start_sending and the two interrupts. Licence: MIT OR
 * Apache-2.0. */
#include "mps2.h"

#define REGISTER(address) (*(volatile uint32_t *)(uintptr_t)(address))
#define CONSOLE 0x40004000u
#define LINE 0x40005000u
#define DATA(uart) REGISTER((uart) + 0x00u)
#define STATE(uart) REGISTER((uart) + 0x04u)
#define CONTROL(uart) REGISTER((uart) + 0x08u)
#define INTERRUPT_CLEAR(uart) REGISTER((uart) + 0x0Cu)
#define DIVISOR(uart) REGISTER((uart) + 0x10u)
#define NVIC_ENABLE REGISTER(0xE000E100u)
#define NVIC_DISABLE REGISTER(0xE000E180u)
#define NVIC_PEND REGISTER(0xE000E200u)
#define NVIC_PRIORITY(number) (*(volatile uint8_t *)(uintptr_t)(0xE000E400u + (number)))

enum { TX_FULL = 1, RX_FULL = 2, RX_OVERRUN = 8 };                 /* STATE */
enum { TX_ON = 1, RX_ON = 2, TX_INTERRUPT = 4, RX_INTERRUPT = 8 }; /* CONTROL */
enum { TX_DONE = 1, RX_DONE = 2 };                                 /* INTERRUPT_CLEAR */
enum { RX_NUMBER = 2, TX_NUMBER = 3 };                             /* UART1's interrupts */
enum { TASKS = 6, STACK = 200 };

/* --- the line */

static uint8_t received[MBM_MAX_FRAME + 1], to_send[MBM_MAX_FRAME];

/* The transmitter interrupts when it takes a byte, and not for the first one: so the program makes
 * the interrupt pending itself. */
static void start_sending(void *context)
{
    (void)context;
    NVIC_PEND = 1u << TX_NUMBER;
}

mbm_freertosUart mps2_line = {.startSending = start_sending,
                              .baud = 19200,
                              .received = received,
                              .receivedBytes = sizeof received,
                              .toSend = to_send,
                              .toSendBytes = sizeof to_send,
                              .hasNoSentInterrupt = 1};

void mps2_startLine(void)
{
    DIVISOR(LINE) = configCPU_CLOCK_HZ / mps2_line.baud;
    CONTROL(LINE) = TX_ON | RX_ON | TX_INTERRUPT | RX_INTERRUPT;
    NVIC_PRIORITY(RX_NUMBER) = configMAX_SYSCALL_INTERRUPT_PRIORITY;
    NVIC_PRIORITY(TX_NUMBER) = configMAX_SYSCALL_INTERRUPT_PRIORITY;
    NVIC_ENABLE = 1u << RX_NUMBER | 1u << TX_NUMBER;
}

void mps2_stopLine(void)
{
    NVIC_DISABLE = 1u << RX_NUMBER | 1u << TX_NUMBER;
    CONTROL(LINE) = 0;
}

static void receive_handler(void)
{
    BaseType_t woken = pdFALSE;

    INTERRUPT_CLEAR(LINE) = RX_DONE;
    if (STATE(LINE) & RX_OVERRUN) {
        STATE(LINE) = RX_OVERRUN;
        mbm_freertos_overrunFromISR(&mps2_line);
    }
    while (STATE(LINE) & RX_FULL) {
        const uint8_t byte = (uint8_t)DATA(LINE);

        mbm_freertos_receivedFromISR(&mps2_line, &byte, 1, &woken);
    }
    portYIELD_FROM_ISR(woken);
}

static void send_handler(void)
{
    BaseType_t woken = pdFALSE;
    uint8_t byte;

    INTERRUPT_CLEAR(LINE) = TX_DONE;
    while (!(STATE(LINE) & TX_FULL)) {
        if (!mbm_freertos_nextFromISR(&mps2_line, &byte)) {
            mbm_freertos_sentFromISR(&mps2_line, &woken);
            break;
        }
        DATA(LINE) = byte;
    }
    portYIELD_FROM_ISR(woken);
}

/* --- the console */

void mps2_print(const char *text)
{
    for (; *text != '\0'; text++) {
        while (STATE(CONSOLE) & TX_FULL) {
        }
        DATA(CONSOLE) = (uint8_t)*text;
    }
}

void mps2_printNumber(uint32_t number)
{
    char digits[11];
    char *first = digits + sizeof digits - 1;

    *first = '\0';
    do {
        *--first = (char)('0' + number % 10u);
        number /= 10u;
    } while (number > 0);
    mps2_print(first);
}

/* --- tasks */

TaskHandle_t mps2_task(TaskFunction_t run, const char *name, void *parameter, UBaseType_t priority)
{
    static StackType_t stacks[TASKS][STACK];
    static StaticTask_t tasks[TASKS];
    static unsigned used;

    configASSERT(used < TASKS);
    used++;
    return xTaskCreateStatic(run, name, STACK, parameter, priority, stacks[used - 1],
                             &tasks[used - 1]);
}

void vApplicationGetIdleTaskMemory(StaticTask_t **task, StackType_t **stack, uint32_t *words)
{
    static StackType_t idle_stack[configMINIMAL_STACK_SIZE];
    static StaticTask_t idle_task;

    *task = &idle_task;
    *stack = idle_stack;
    *words = configMINIMAL_STACK_SIZE;
}

static void stop(void)
{
    taskDISABLE_INTERRUPTS();
    for (;;) {
    }
}

void mps2_assert(const char *file, int line)
{
    mps2_print(file);
    mps2_print(":");
    mps2_printNumber((uint32_t)line);
    mps2_print(": assertion failed\n");
    stop();
}

void vApplicationStackOverflowHook(TaskHandle_t task, char *name);
void vApplicationStackOverflowHook(TaskHandle_t task, char *name)
{
    (void)task;
    mps2_print(name);
    mps2_print(": stack overflow\n");
    stop();
}

/* --- start-up */

void svc_handler(void);
void pendsv_handler(void);
void systick_handler(void);

static void fault_handler(void)
{
    mps2_print("fault\n");
    stop();
}

/* Symbols of the linker script. */
extern uint32_t stack_top[], data_load[], data_start[], data_end[], bss_start[], bss_end[];

void reset_handler(void);
void reset_handler(void)
{
    const uint32_t *from = data_load;
    uint32_t *to;

    for (to = data_start; to < data_end; to++)
        *to = *from++;
    for (to = bss_start; to < bss_end; to++)
        *to = 0;
    DIVISOR(CONSOLE) = configCPU_CLOCK_HZ / 115200u;
    CONTROL(CONSOLE) = TX_ON;
    (void)main();
    stop();
}

#define NONE fault_handler
struct vectors {
    uint32_t *stack;
    void (*handlers[15])(void);
    void (*interrupts[4])(void);
};
__attribute__((section(".vectors"), used)) static const struct vectors vectors = {
    stack_top,
    {reset_handler, NONE, NONE, NONE, NONE, NONE, NONE, NONE, NONE, NONE, svc_handler, NONE, NONE,
     pendsv_handler, systick_handler},
    {NONE, NONE, receive_handler, send_handler}};
