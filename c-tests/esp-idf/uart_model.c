#include "uart_model.h"

#include "driver/gpio.h"
#include "esp_timer.h"
#include "freertos/queue.h"
#include "freertos/task.h"
#include "soc/uart_reg.h"
#include "test.h"

/* An item of the transmit ring has a header. A description of 16 bytes goes before the bytes. */
enum { HEADER = 8, DESCRIPTION = 16, FRAMES = 8, RING = 4096, EVENTS = 1024, VALID_PINS = 34 };

struct QueueDefinition {
    uart_event_t events[EVENTS];
    unsigned first, count, size;
};

static struct driver {
    bool isInstalled, isRs485, isFull, countsFrames, hasOverflow;
    int rxSize, txSize, rts, threshold;
    struct QueueDefinition queue;
    /* Reception: FIFO, ring, and what the ring did not take. */
    uint8_t rxFifo[ESP_FIFO], rxRing[RING], stash[ESP_FIFO];
    unsigned rxFifoCount, rxCount, stashCount;
    /* Transmission. */
    struct {
        uint8_t bytes[600];
        unsigned length, taken;
    } frames[FRAMES];
    unsigned frameCount, txFifoCount;
    uint8_t txFifo[ESP_FIFO];
    int64_t nextAt; /* when the character in the transmitter has left */
} driver;

static bool isDone; /* the last bit of a frame has left, and no interrupt has seen it */
static int64_t replyAt;
static int output;
esp_chip chip;

void esp_chip_reset(void)
{
    memset(&chip, 0, sizeof chip);
    memset(&driver, 0, sizeof driver);
    chip.bits = 11;
    chip.baud = 19200;
    output = -1;
    isDone = false;
    replyAt = 0;
}

bool esp_chip_is_installed(void)
{
    return driver.isInstalled;
}

static int64_t character(void)
{
    return (int64_t)chip.bits * 1000000 / chip.baud;
}

static void drive(bool on)
{
    if (chip.isDriving && !on)
        chip.freeAt = chip.now;
    chip.isDriving = on;
}

/* --- the interrupt */

static void post(uart_event_type_t type)
{
    struct QueueDefinition *queue = &driver.queue;

    if (queue->count < queue->size)
        queue->events[(queue->first + queue->count++) % EVENTS] = (uart_event_t){.type = type};
    if (queue->count > chip.mostWaiting)
        chip.mostWaiting = queue->count;
}

static bool put(const uint8_t *bytes, unsigned count)
{
    if (driver.rxCount + count > (unsigned)driver.rxSize)
        return false;
    memcpy(driver.rxRing + driver.rxCount, bytes, count);
    driver.rxCount += count;
    return true;
}

static void take_received(void)
{
    if (driver.rxFifoCount >= (unsigned)driver.threshold && !driver.isFull) {
        driver.isFull = !put(driver.rxFifo, driver.rxFifoCount);
        if (driver.isFull) {
            memcpy(driver.stash, driver.rxFifo, driver.rxFifoCount);
            driver.stashCount = driver.rxFifoCount;
        }
        driver.rxFifoCount = 0;
        post(driver.isFull ? UART_BUFFER_FULL : UART_DATA);
    }
    if (driver.hasOverflow) {
        driver.rxFifoCount = 0;
        driver.hasOverflow = false;
        post(UART_FIFO_OVF);
    }
}

static void fill_transmitter(void)
{
    while (driver.frameCount > 0 && driver.txFifoCount < ESP_FIFO) {
        if (driver.isRs485 && driver.rts >= 0)
            drive(true);
        if (driver.txFifoCount == 0)
            driver.nextAt = chip.now + character();
        driver.txFifo[driver.txFifoCount++] = driver.frames[0].bytes[driver.frames[0].taken++];
        if (driver.frames[0].taken < driver.frames[0].length)
            continue;
        memmove(driver.frames, driver.frames + 1, sizeof driver.frames - sizeof driver.frames[0]);
        driver.frameCount--;
    }
}

static void interrupt(void)
{
    if (!driver.isInstalled || chip.isMasked)
        return;
    fill_transmitter();
    take_received();
    if (isDone && driver.isRs485) {
        driver.rxFifoCount = 0;
        drive(false);
    }
    isDone = false;
}

/* --- the line */

static void send_character(void)
{
    chip.undriven += !chip.isDriving;
    assert_true(chip.sent < sizeof chip.line);
    chip.line[chip.sent++] = driver.txFifo[0];
    memmove(driver.txFifo, driver.txFifo + 1, --driver.txFifoCount);
    driver.nextAt = chip.now + character();
    chip.sentAt = chip.now;
    if (driver.txFifoCount <= 10)
        interrupt();
    isDone = driver.txFifoCount == 0;
    if (isDone && chip.reply != NULL)
        replyAt = chip.now + 4 * character();
    interrupt();
}

static void work(void)
{
    if (driver.txFifoCount > 0 && chip.isStopped)
        driver.nextAt = chip.now + character();
    else if (driver.txFifoCount > 0 && chip.now >= driver.nextAt)
        send_character();
    if (replyAt != 0 && chip.now >= replyAt) {
        replyAt = 0;
        esp_chip_receive(chip.reply, chip.replyLength);
    }
}

void esp_chip_pass(int64_t micros)
{
    const int64_t end = chip.now + micros;
    const int64_t step = character() / 16;

    while (chip.now < end) {
        chip.now = end - chip.now < step ? end : chip.now + step;
        work();
    }
    if (chip.pass != NULL)
        chip.pass();
}

void esp_chip_receive(const uint8_t *bytes, unsigned length)
{
    for (unsigned i = 0; i < length; i++) {
        chip.now += character();
        if (!driver.isInstalled)
            continue;
        if (driver.rxFifoCount < ESP_FIFO)
            driver.rxFifo[driver.rxFifoCount++] = bytes[i];
        else
            driver.hasOverflow = true;
        interrupt();
    }
}

void esp_chip_receive_faulty(uint8_t byte, uart_event_type_t fault)
{
    esp_chip_receive(&byte, 1);
    if (fault == UART_PARITY_ERR || driver.countsFrames)
        post(fault);
}

void esp_chip_unmask(void)
{
    chip.isMasked = false;
    interrupt();
}

/* --- the driver's functions */

static void is_uart_1(uart_port_t uart)
{
    assert_int_equal(uart, UART_NUM_1);
}

esp_err_t uart_driver_install(uart_port_t uart, int rx_size, int tx_size, int queue_size,
                              QueueHandle_t *queue, int flags)
{
    if (uart >= UART_NUM_MAX || rx_size <= ESP_FIFO || tx_size <= ESP_FIFO || chip.isHeapFull ||
        chip.isForeign)
        return ESP_FAIL;
    is_uart_1(uart);
    assert_false(driver.isInstalled);
    assert_true(rx_size <= RING && queue_size <= EVENTS && flags == 0);
    memset(&driver, 0, sizeof driver);
    driver.isInstalled = true;
    driver.rxSize = rx_size;
    driver.txSize = tx_size;
    driver.threshold = 120;
    driver.rts = UART_PIN_NO_CHANGE;
    driver.queue.size = (unsigned)queue_size;
    if (queue != NULL)
        *queue = queue_size > 0 ? &driver.queue : NULL;
    return ESP_OK;
}

esp_err_t uart_driver_delete(uart_port_t uart)
{
    is_uart_1(uart);
    if (driver.isRs485)
        drive(false);
    memset(&driver, 0, sizeof driver);
    return ESP_OK;
}

bool uart_is_driver_installed(uart_port_t uart)
{
    is_uart_1(uart);
    return driver.isInstalled;
}

esp_err_t uart_enable_intr_mask(uart_port_t uart, uint32_t mask)
{
    is_uart_1(uart);
    assert_true(driver.isInstalled);
    driver.countsFrames = (mask & UART_FRM_ERR_INT_ENA) != 0;
    return ESP_OK;
}

esp_err_t uart_param_config(uart_port_t uart, const uart_config_t *config)
{
    is_uart_1(uart);
    assert_true(config->baud_rate > 0);
    if (config->baud_rate > 5000000)
        return ESP_FAIL;
    chip.baud = config->baud_rate;
    chip.bits = 9 + (config->parity != UART_PARITY_DISABLE) +
                (config->stop_bits == UART_STOP_BITS_2 ? 2 : 1);
    return ESP_OK;
}

static bool is_pin(int pin)
{
    return pin < VALID_PINS;
}

esp_err_t uart_set_pin(uart_port_t uart, int tx, int rx, int rts, int cts)
{
    is_uart_1(uart);
    if (!is_pin(tx) || !is_pin(rx) || !is_pin(rts) || !is_pin(cts))
        return ESP_FAIL;
    driver.rts = rts;
    return ESP_OK;
}

esp_err_t uart_set_mode(uart_port_t uart, uart_mode_t mode)
{
    is_uart_1(uart);
    driver.isRs485 = mode == UART_MODE_RS485_HALF_DUPLEX;
    return ESP_OK;
}

esp_err_t uart_set_rx_timeout(uart_port_t uart, const uint8_t characters)
{
    is_uart_1(uart);
    return characters > 0 ? ESP_OK : ESP_FAIL;
}

esp_err_t uart_set_rx_full_threshold(uart_port_t uart, int bytes)
{
    is_uart_1(uart);
    driver.threshold = bytes;
    return ESP_OK;
}

esp_err_t uart_wait_tx_done(uart_port_t uart, TickType_t ticks)
{
    is_uart_1(uart);
    assert_int_equal(ticks, 0);
    if (!driver.isInstalled)
        return ESP_FAIL;
    return driver.txFifoCount == 0 ? ESP_OK : ESP_ERR_TIMEOUT;
}

static unsigned transmit_ring(void)
{
    unsigned used = 0;

    for (unsigned i = 0; i < driver.frameCount; i++)
        used += DESCRIPTION + HEADER + driver.frames[i].length + HEADER;
    return used;
}

int uart_write_bytes(uart_port_t uart, const void *bytes, size_t length)
{
    is_uart_1(uart);
    if (!driver.isInstalled)
        return -1;
    while (transmit_ring() + DESCRIPTION + HEADER + length + HEADER > (unsigned)driver.txSize) {
        if (chip.isStopped)
            fail_msg("uart_write_bytes waits for ever");
        esp_chip_pass(character());
    }
    memcpy(driver.frames[driver.frameCount].bytes, bytes, length);
    driver.frames[driver.frameCount].length = (unsigned)length;
    driver.frames[driver.frameCount++].taken = 0;
    interrupt();
    return (int)length;
}

int uart_read_bytes(uart_port_t uart, void *bytes, uint32_t capacity, TickType_t ticks)
{
    unsigned count;

    is_uart_1(uart);
    assert_int_equal(ticks, 0);
    if (!driver.isInstalled)
        return -1;
    count = driver.rxCount < capacity ? driver.rxCount : capacity;
    memcpy(bytes, driver.rxRing, count);
    driver.rxCount -= count;
    memmove(driver.rxRing, driver.rxRing + count, driver.rxCount);
    if (driver.isFull && put(driver.stash, driver.stashCount)) {
        driver.isFull = false;
        interrupt();
    }
    return (int)count;
}

/* --- GPIOs, queue, clock and tasks */

esp_err_t gpio_set_level(gpio_num_t pin, uint32_t level)
{
    if ((int)pin < 0 || !is_pin((int)pin))
        return ESP_ERR_INVALID_ARG;
    assert_int_equal(pin, ESP_DRIVER_PIN);
    if ((int)pin == output)
        drive(level != 0);
    return ESP_OK;
}

esp_err_t gpio_config(const gpio_config_t *config)
{
    assert_int_equal(config->mode, GPIO_MODE_OUTPUT);
    if (config->pin_bit_mask >> VALID_PINS != 0)
        return ESP_ERR_INVALID_ARG;
    assert_true(config->pin_bit_mask == 1ull << ESP_DRIVER_PIN);
    output = ESP_DRIVER_PIN;
    return ESP_OK;
}

BaseType_t xQueueReceive(QueueHandle_t queue, void *item, TickType_t ticks)
{
    assert_true(queue == &driver.queue && driver.isInstalled && ticks == 0);
    if (queue->count == 0)
        return 0;
    memcpy(item, &queue->events[queue->first], sizeof queue->events[0]);
    queue->first = (queue->first + 1) % EVENTS;
    queue->count--;
    return 1;
}

UBaseType_t uxQueueSpacesAvailable(QueueHandle_t queue)
{
    assert_true(queue == &driver.queue && driver.isInstalled);
    return queue->size - queue->count;
}

int64_t esp_timer_get_time(void)
{
    esp_chip_pass(1);
    return chip.now;
}

void vTaskDelay(const TickType_t ticks)
{
    chip.delays++;
    esp_chip_pass(ticks * portTICK_PERIOD_MS * 1000);
}
