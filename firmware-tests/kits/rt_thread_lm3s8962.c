/* The application of RT-Thread's BSP lm3s8962 for scripts/check/real. That BSP has a driver for the
 * console's UART only, and no pin device. This file registers the chip's second UART with
 * RT-Thread's serial framework as "uart2", starts the shell's command read_registers, and says when
 * it has ended.
 *
 * A timer asks the UART for bytes at every tick, because the BSP's table of interrupts has no entry
 * for it. Licence: MIT OR Apache-2.0. */
#include <rtdevice.h>
#include <rtthread.h>

#include <stdbool.h>
#include <stdint.h>

#include <inc/hw_memmap.h>
#include <inc/hw_types.h>

#include <driverlib/sysctl.h>
#include <driverlib/uart.h>

int rt_application_init(void);
void luminaryif_isr(void);
extern int msh_exec(char *command, rt_size_t length);

/* The table of interrupts names it; the network is switched off. */
void luminaryif_isr(void) {}

static struct rt_serial_device uart;
static struct rt_timer ticks;

static rt_err_t set_up(struct rt_serial_device *serial, struct serial_configure *wanted)
{
    static const uint32_t parities[] = {UART_CONFIG_PAR_NONE, UART_CONFIG_PAR_ODD,
                                        UART_CONFIG_PAR_EVEN, UART_CONFIG_PAR_NONE};
    uint32_t stop = wanted->stop_bits == STOP_BITS_2 ? UART_CONFIG_STOP_TWO : UART_CONFIG_STOP_ONE;

    (void)serial;
    UARTConfigSetExpClk(UART1_BASE, SysCtlClockGet(), wanted->baud_rate,
                        UART_CONFIG_WLEN_8 | stop | parities[wanted->parity]);
    return RT_EOK;
}

static rt_err_t control(struct rt_serial_device *serial, int command, void *argument)
{
    (void)serial;
    (void)command;
    (void)argument;
    return RT_EOK;
}

static int put(struct rt_serial_device *serial, char character)
{
    (void)serial;
    while (!UARTCharPutNonBlocking(UART1_BASE, (unsigned char)character))
        ;
    return 1;
}

static int get(struct rt_serial_device *serial)
{
    (void)serial;
    return UARTCharsAvail(UART1_BASE) ? (int)(UARTCharGetNonBlocking(UART1_BASE) & 0xFF) : -1;
}

static void look(void *parameter)
{
    (void)parameter;
    if (UARTCharsAvail(UART1_BASE))
        rt_hw_serial_isr(&uart, RT_SERIAL_EVENT_RX_IND);
}

static void run(void *parameter)
{
    static char command[] = "read_registers";

    (void)parameter;
    msh_exec(command, sizeof command - 1);
    rt_kprintf("read_registers has ended\n");
}

int rt_application_init(void)
{
    static const struct rt_uart_ops operations = {
        .configure = set_up, .control = control, .putc = put, .getc = get};
    static const struct serial_configure usual = RT_SERIAL_CONFIG_DEFAULT;
    rt_thread_t thread;

    SysCtlPeripheralEnable(SYSCTL_PERIPH_UART1);
    uart.ops = &operations;
    uart.config = usual;
    rt_hw_serial_register(&uart, "uart2", RT_DEVICE_FLAG_RDWR | RT_DEVICE_FLAG_INT_RX, RT_NULL);
    rt_timer_init(&ticks, "uart2", look, RT_NULL, 1, RT_TIMER_FLAG_PERIODIC);
    rt_timer_start(&ticks);
    thread = rt_thread_create("run", run, RT_NULL, 4096, 21, 20);
    rt_thread_startup(thread);
    return 0;
}
