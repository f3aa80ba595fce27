/* RT-Thread's own serial framework and pin device over the UART of c-tests/rt-thread/chip.c, on
 * this machine, for scripts/check/real: the drivers of a BSP, and the few functions of the kernel
 * that they call. Licence: MIT OR Apache-2.0. */
#include "serial_model.h"
#include "test.h"

#include <rthw.h>

enum { FIFO = 512 };

/* The framework's objects begin with their devices. The tests know the first. */
struct rt_serial_device serial[2] __asm__("rtt_uart");
static const char *const names[] = {"uart2", "uart3"};
static uint8_t fifo[FIFO];
static unsigned fifoCount;
static bool isSending; /* by version 2, whose next character has left at nextAt */

/* --- the driver of the UART */

static bool is_uart2(const struct rt_serial_device *device)
{
    return device == &serial[0];
}

static rt_err_t configure(struct rt_serial_device *device, struct serial_configure *wanted)
{
    if (!is_uart2(device))
        return RT_EOK;
    chip.baud = wanted->baud_rate;
    return chip.failsToOpen ? -RT_ERROR : RT_EOK;
}

static rt_err_t control(struct rt_serial_device *device, int command, void *argument)
{
#ifdef RT_USING_SERIAL_V2
    if (command == RT_DEVICE_CHECK_OPTMODE)
        return RT_SERIAL_TX_BLOCKING_BUFFER;
    if (command == RT_DEVICE_CTRL_CLR_INT && argument == (void *)RT_SERIAL_TX_BLOCKING)
        isSending = false;
#endif
    return RT_EOK;
}

static int put(struct rt_serial_device *device, char character)
{
    return !is_uart2(device) || rtt_send_waiting((uint8_t)character) ? 1 : -1;
}

static int get(struct rt_serial_device *device)
{
    const int first = fifo[0];

    if (!is_uart2(device) || fifoCount == 0)
        return -1;
    memmove(fifo, fifo + 1, --fifoCount);
    return first;
}

#ifdef RT_USING_SERIAL_V2
static uint64_t nextAt;

/* The interrupt sends from the framework's buffer. */
static rt_ssize_t transmit(struct rt_serial_device *device, rt_uint8_t *bytes, rt_size_t size,
                           rt_uint32_t flag)
{
    isSending = true;
    nextAt = chip.now + rtt_character();
    return (rt_ssize_t)size;
}

void rtt_framework_work(void)
{
    uint8_t byte;

    if (!isSending || chip.now < nextAt)
        return;
    nextAt = chip.now + rtt_character();
    if (rtt_is_stopped())
        return;
    if (rt_hw_serial_control_isr(&serial[0], RT_HW_SERIAL_CTRL_GETC, &byte) == RT_EOK) {
        rtt_send(byte);
        return;
    }
    isSending = false;
    rt_hw_serial_isr(&serial[0], RT_SERIAL_EVENT_TX_DONE);
}

static void take_byte(void)
{
    uint8_t byte = (uint8_t)get(&serial[0]);

    rt_hw_serial_control_isr(&serial[0], RT_HW_SERIAL_CTRL_PUTC, &byte);
}
#else
void rtt_framework_work(void) {}

/* rt_hw_serial_isr calls `get` itself. */
static void take_byte(void) {}
#endif

void rtt_framework_receive(uint8_t byte)
{
    if (serial[0].serial_rx == NULL)
        return;
    assert_true(fifoCount < FIFO);
    fifo[fifoCount++] = byte;
    if (chip.isMasked)
        return;
    do {
        take_byte();
        rt_hw_serial_isr(&serial[0], RT_SERIAL_EVENT_RX_IND);
    } while (fifoCount > 0);
}

/* --- the driver of pins */

static void pin_mode(struct rt_device *device, rt_base_t pin, rt_uint8_t mode)
{
    assert_int_equal(mode, PIN_MODE_OUTPUT);
    rtt_pin_mode(pin);
}

static void pin_write(struct rt_device *device, rt_base_t pin, rt_uint8_t value)
{
    rtt_pin_write(pin, value == PIN_HIGH);
}

static rt_ssize_t pin_read(struct rt_device *device, rt_base_t pin)
{
    return rtt_pin_read(pin);
}

void rtt_framework_reset(void)
{
    static const struct rt_pin_ops pins = {
        .pin_mode = pin_mode, .pin_write = pin_write, .pin_read = pin_read};
    static const struct rt_uart_ops uarts = {.configure = configure,
                                             .control = control,
                                             .putc = put,
                                             .getc = get,
#ifdef RT_USING_SERIAL_V2
                                             .transmit = transmit
#endif
    };

    memset(serial, 0, sizeof serial);
    fifoCount = 0;
    isSending = false;
    for (int i = 0; i < 2; i++) {
        serial[i].ops = &uarts;
        assert_int_equal(rt_hw_serial_register(&serial[i], names[i],
                                               RT_DEVICE_FLAG_RDWR | RT_DEVICE_FLAG_INT_RX, NULL),
                         RT_EOK);
    }
    assert_int_equal(rt_device_pin_register("pin", &pins, NULL), 0);
}

/* --- the kernel */

rt_object_t rt_object_find(const char *name, rt_uint8_t type)
{
    for (int i = 0; i < 2; i++)
        if (strcmp(name, serial[i].parent.parent.name) == 0 && !(i == 0 && chip.isAbsent))
            return &serial[i].parent.parent;
    return NULL;
}

void rt_object_init(struct rt_object *object, enum rt_object_class_type type, const char *name)
{
    strncpy(object->name, name, RT_NAME_MAX - 1);
}

void rt_object_detach(rt_object_t object) {}

rt_bool_t rt_object_is_systemobject(rt_object_t object)
{
    return RT_TRUE;
}

rt_uint8_t rt_object_get_type(rt_object_t object)
{
    return RT_Object_Class_Device;
}

void rt_completion_init(struct rt_completion *completion)
{
    memset(completion, 0, sizeof *completion);
}

void rt_completion_done(struct rt_completion *completion)
{
    completion->susp_thread_n_flag = 1;
}

rt_err_t rt_completion_wait(struct rt_completion *completion, rt_int32_t timeout)
{
    const uint64_t begun = chip.now;

    while (completion->susp_thread_n_flag == 0) {
        if (timeout == RT_WAITING_FOREVER && rtt_is_stopped())
            fail_msg("the framework waits for ever");
        if (timeout != RT_WAITING_FOREVER && chip.now - begun >= (unsigned)timeout * 1000ull)
            return -RT_ETIMEOUT;
        rtt_chip_pass(100);
    }
    completion->susp_thread_n_flag = 0;
    return RT_EOK;
}

rt_tick_t rt_tick_get_delta(rt_tick_t begun)
{
    return rt_tick_get() - begun;
}

rt_thread_t rt_thread_self(void)
{
    static struct rt_thread thread;

    return &thread;
}

rt_device_t rt_console_get_device(void)
{
    return NULL;
}

void rt_assert_handler(const char *text, const char *function, rt_size_t line)
{
    fail_msg("%s in %s, line %lu", text, function, (unsigned long)line);
}

void *rt_malloc(rt_size_t size)
{
    return malloc(size);
}

void rt_free(void *memory)
{
    free(memory);
}

void *rt_memset(void *memory, int byte, rt_ubase_t size)
{
    return memset(memory, byte, size);
}

void *rt_memcpy(void *to, const void *from, rt_ubase_t size)
{
    return memcpy(to, from, size);
}

void rt_set_errno(rt_err_t error) {}

void rt_spin_lock_init(struct rt_spinlock *lock) {}

rt_base_t rt_spin_lock_irqsave(struct rt_spinlock *lock)
{
    return 0;
}

void rt_spin_unlock_irqrestore(struct rt_spinlock *lock, rt_base_t level) {}

rt_base_t rt_hw_interrupt_disable(void)
{
    return 0;
}

void rt_hw_interrupt_enable(rt_base_t level) {}
