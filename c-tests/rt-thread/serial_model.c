#include "serial_model.h"

#include "test.h"

enum { BUFFER = 4096 };

struct rt_device rtt_uart;

/* "uart3", at which nothing happens. */
static struct rt_device other;

static struct serial_configure config;
static rt_err_t (*indicate)(rt_device_t device, rt_size_t size);
/* The framework's receive buffer: version 1 has an index to put and one to get. */
static uint8_t received[BUFFER];
static unsigned put, get, size;
static bool isFull;

/* --- transmission */

#if defined(RT_USING_SERIAL_V2) && !defined(STAND_IN_WITHOUT_TX_TIMEOUT)
/* The interrupt of the transmitter empties the buffer. */
static uint8_t leaving[BUFFER];
static unsigned leavingCount;
static bool isActivated;
static rt_int32_t timeout;
static uint64_t nextAt;

void rtt_framework_work(void)
{
    if (rtt_is_stopped())
        nextAt = chip.now + rtt_character();
    if (leavingCount == 0 || chip.now < nextAt)
        return;
    rtt_send(leaving[0]);
    memmove(leaving, leaving + 1, --leavingCount);
    nextAt = chip.now + rtt_character();
    isActivated = leavingCount > 0;
}

static unsigned transmit(const uint8_t *bytes, unsigned length)
{
    const uint64_t begun = chip.now;
    unsigned done = 0;

    if (isActivated)
        return 0;
    while (done < length) {
        const unsigned part = length - done < config.tx_bufsz ? length - done : config.tx_bufsz;

        memcpy(leaving, bytes + done, part);
        leavingCount = part;
        nextAt = chip.now + rtt_character();
        isActivated = true;
        while (isActivated) {
            if (timeout == RT_WAITING_FOREVER && rtt_is_stopped())
                fail_msg("rt_device_write waits for ever");
            rtt_chip_pass(100);
            if (timeout != RT_WAITING_FOREVER && chip.now - begun >= (unsigned)timeout * 1000ull)
                return done + part - leavingCount;
        }
        done += part;
    }
    return done;
}

static void begin_sending(void)
{
    timeout = RT_WAITING_FOREVER;
    leavingCount = 0;
    isActivated = false;
}
#else
void rtt_framework_work(void) {}

static void begin_sending(void) {}

/* The driver waits for each character. */
static unsigned transmit(const uint8_t *bytes, unsigned length)
{
    unsigned done;

#ifdef RT_USING_SERIAL_V2
    if (config.tx_bufsz != 0 && rtt_is_stopped())
        fail_msg("rt_device_write waits for ever");
#endif
    for (done = 0; done < length && rtt_send_waiting(bytes[done]); done++)
        ;
    return done;
}
#endif

/* --- reception */

/* Version 1 overwrites: a full buffer that gets one more byte has one byte. Version 2 drops the
 * oldest. */
static void keep(uint8_t byte)
{
    received[put] = byte;
    put = (put + 1) % size;
#ifdef RT_USING_SERIAL_V2
    if (isFull)
        get = put;
    isFull = put == get;
#else
    if (put == get)
        isFull = true;
#endif
}

static void interrupt(void)
{
    const unsigned waiting = (put + size - get) % size;

    if (!chip.isMasked && indicate != NULL && waiting > 0)
        (void)indicate(&rtt_uart, waiting);
}

void rtt_framework_receive(uint8_t byte)
{
    if (rtt_uart.ref_count == 0)
        return;
    keep(byte);
    interrupt();
}

/* --- the device */

void rtt_framework_reset(void)
{
    memset(&rtt_uart, 0, sizeof rtt_uart);
    memset(&other, 0, sizeof other);
    memset(&config, 0, sizeof config);
    indicate = NULL;
    put = get = 0;
    isFull = false;
    begin_sending();
}

rt_device_t rt_device_find(const char *name)
{
    if (strcmp(name, "uart3") == 0)
        return &other;
    return strcmp(name, "uart2") == 0 && !chip.isAbsent ? &rtt_uart : NULL;
}

static unsigned buffer_of(const struct serial_configure *wanted)
{
#ifdef RT_USING_SERIAL_V2
    return wanted->rx_bufsz;
#else
    return wanted->bufsz;
#endif
}

rt_err_t rt_device_control(rt_device_t device, int command, void *argument)
{
    const struct serial_configure *wanted = argument;

    if (device == &other)
        return RT_EOK;
    assert_ptr_equal(device, &rtt_uart);
#if defined(RT_USING_SERIAL_V2) && !defined(STAND_IN_WITHOUT_TX_TIMEOUT)
    if (command == RT_SERIAL_CTRL_SET_TX_TIMEOUT) {
        assert_true(config.tx_bufsz > 0 && rtt_uart.ref_count > 0);
        timeout = *(const rt_int32_t *)argument;
        return RT_EOK;
    }
#endif
    assert_int_equal(command, RT_DEVICE_CTRL_CONFIG);
    if (rtt_uart.ref_count > 0 && buffer_of(wanted) != buffer_of(&config))
        return -RT_EBUSY;
    config = *wanted;
    chip.baud = wanted->baud_rate;
    size = buffer_of(&config);
    assert_true(size > 0 && size <= BUFFER);
    return RT_EOK;
}

rt_err_t rt_device_open(rt_device_t device, rt_uint16_t flags)
{
    (void)flags;
    if (device == &other) {
        other.ref_count++;
        return RT_EOK;
    }
    assert_ptr_equal(device, &rtt_uart);
    if (chip.failsToOpen)
        return -RT_ERROR;
    if (rtt_uart.ref_count++ > 0)
        return RT_EOK;
    put = get = 0;
    isFull = false;
    begin_sending();
    return RT_EOK;
}

rt_err_t rt_device_close(rt_device_t device)
{
    if (device == &other) {
        other.ref_count--;
        return RT_EOK;
    }
    assert_ptr_equal(device, &rtt_uart);
    if (rtt_uart.ref_count == 0)
        return -RT_ERROR;
    if (--rtt_uart.ref_count == 0) {
        indicate = NULL;
        begin_sending();
    }
    return RT_EOK;
}

rt_err_t rt_device_set_rx_indicate(rt_device_t device,
                                   rt_err_t (*function)(rt_device_t device, rt_size_t size))
{
    if (device == &other)
        return RT_EOK;
    assert_ptr_equal(device, &rtt_uart);
    indicate = function;
    return RT_EOK;
}

rt_ssize_t rt_device_read(rt_device_t device, rt_off_t position, void *bytes, rt_size_t capacity)
{
    unsigned count = 0;

    assert_ptr_equal(device, &rtt_uart);
    assert_int_equal(position, 0);
    while (rtt_uart.ref_count > 0 && count < capacity && (get != put || isFull)) {
        ((uint8_t *)bytes)[count++] = received[get];
        get = (get + 1) % size;
        isFull = false;
    }
    return count;
}

rt_ssize_t rt_device_write(rt_device_t device, rt_off_t position, const void *bytes,
                           rt_size_t length)
{
    assert_ptr_equal(device, &rtt_uart);
    assert_int_equal(position, 0);
    return rtt_uart.ref_count > 0 ? transmit(bytes, (unsigned)length) : 0;
}

/* --- pins */

void rt_pin_mode(rt_base_t pin, rt_uint8_t mode)
{
    assert_int_equal(mode, PIN_MODE_OUTPUT);
    rtt_pin_mode(pin);
}

void rt_pin_write(rt_base_t pin, rt_ssize_t value)
{
    rtt_pin_write(pin, value == PIN_HIGH);
}

rt_ssize_t rt_pin_read(rt_base_t pin)
{
    return rtt_pin_read(pin);
}
