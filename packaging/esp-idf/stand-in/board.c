/* Plays ESP-IDF's UART driver, GPIOs and tasks on a line in memory, and starts the example. The
 * program ends when the device has answered four requests and ignored one.
 * Licence: MIT OR Apache-2.0. */
#include "driver/gpio.h"
#include "driver/uart.h"
#include "esp_timer.h"
#include "freertos/task.h"
#include "line.h"
#include "mbm_esp_idf.h"
#include "sdkconfig.h"
#include "soc/uart_reg.h"

#include <stdio.h>

void app_main(void);

/* The receiver's FIFO. It hands its bytes over once it has `threshold` of them, or when no other
 * has arrived for the time of `silence` characters. The values are those of the driver. */
static struct {
    int threshold, silence;
    uint32_t byte_us;
    uint16_t arrived, ready; /* of the bytes that the program has not read */
    uint32_t last_us;        /* when the last one arrived */
} fifo = {.threshold = 120, .silence = 10};

static int is_installed, is_even, rts = UART_PIN_NO_CHANGE, is_rs485, is_output;

/* In this mode the UART switches the driver itself. */
static void drive(bool on)
{
    if (is_rs485)
        line_drive(on);
}

void line_interrupt(void)
{
    if (line_unsent() == 0)
        drive(false);
}

esp_err_t uart_driver_install(uart_port_t uart, int rx_size, int tx_size, int queue_size,
                              QueueHandle_t *queue, int flags)
{
    line_expect(!is_installed && uart == CONFIG_METER_UART,
                "the driver is installed for another UART");
    line_expect(rx_size > 128 && tx_size > 2 * MBM_MAX_FRAME, "the buffers are too small");
    line_expect(queue_size >= MBM_MAX_FRAME && queue != NULL && flags == 0,
                "the driver is installed without a queue for the events of a frame");
    *queue = NULL;
    is_installed = 1;
    return ESP_OK;
}

esp_err_t uart_driver_delete(uart_port_t uart)
{
    line_expect(is_installed && uart == CONFIG_METER_UART, "another driver is removed");
    is_installed = 0;
    return ESP_OK;
}

bool uart_is_driver_installed(uart_port_t uart)
{
    line_expect(uart == CONFIG_METER_UART, "another driver is looked for");
    return is_installed != 0;
}

esp_err_t uart_enable_intr_mask(uart_port_t uart, uint32_t mask)
{
    line_expect(uart == CONFIG_METER_UART && is_installed && mask == UART_FRM_ERR_INT_ENA,
                "another interrupt is enabled");
    return ESP_OK;
}

/* On this line nothing is lost, and nothing is damaged. */
BaseType_t xQueueReceive(QueueHandle_t queue, void *item, TickType_t ticks)
{
    (void)queue;
    (void)item;
    line_expect(is_installed && ticks == 0, "the port waits for an event");
    return 0;
}

UBaseType_t uxQueueSpacesAvailable(const QueueHandle_t queue)
{
    (void)queue;
    return MBM_MAX_FRAME;
}

esp_err_t uart_param_config(uart_port_t uart, const uart_config_t *config)
{
    line_expect(uart == CONFIG_METER_UART && config->data_bits == UART_DATA_8_BITS, "the format");
    line_expect(config->stop_bits ==
                    (config->parity == UART_PARITY_DISABLE ? UART_STOP_BITS_2 : UART_STOP_BITS_1),
                "a character does not have 11 bits");
    is_even = config->parity == UART_PARITY_EVEN;
    fifo.byte_us = 11000000u / (uint32_t)config->baud_rate;
    line_begin((uint32_t)config->baud_rate);
    return ESP_OK;
}

esp_err_t uart_set_pin(uart_port_t uart, int tx, int rx, int rts_pin, int cts)
{
    line_expect(uart == CONFIG_METER_UART && tx == CONFIG_METER_TX_PIN && rx == CONFIG_METER_RX_PIN,
                "the pins");
    line_expect(cts == UART_PIN_NO_CHANGE, "CTS has a pin");
    rts = rts_pin;
    return ESP_OK;
}

esp_err_t uart_set_mode(uart_port_t uart, uart_mode_t mode)
{
    line_expect(uart == CONFIG_METER_UART && mode == UART_MODE_RS485_HALF_DUPLEX, "the mode");
    is_rs485 = 1;
    line_has_driver();
    return ESP_OK;
}

esp_err_t uart_set_rx_timeout(uart_port_t uart, const uint8_t characters)
{
    (void)uart;
    if (characters == 0 || characters > 10)
        return ESP_FAIL;
    fifo.silence = characters;
    return ESP_OK;
}

esp_err_t uart_set_rx_full_threshold(uart_port_t uart, int bytes)
{
    line_expect(uart == CONFIG_METER_UART && is_installed, "no driver has a threshold");
    if (bytes < 1 || bytes > 127)
        return ESP_FAIL;
    fifo.threshold = bytes;
    return ESP_OK;
}

esp_err_t uart_wait_tx_done(uart_port_t uart, TickType_t ticks)
{
    line_expect(uart == CONFIG_METER_UART && ticks == 0, "the port waits");
    return line_unsent() == 0 ? ESP_OK : ESP_ERR_TIMEOUT;
}

int uart_write_bytes(uart_port_t uart, const void *bytes, size_t length)
{
    line_expect(uart == CONFIG_METER_UART && is_installed, "no driver to write to");
    drive(true);
    line_expect(line_write(bytes, (uint16_t)length) == length, "the transmit buffer is full");
    return (int)length;
}

static uint16_t take_from_fifo(void *bytes, uint16_t capacity)
{
    const uint32_t now = line_micros();
    const uint16_t arrived = line_received();
    uint16_t count;

    if (arrived != fifo.arrived)
        fifo.last_us = now;
    fifo.arrived = arrived;
    if (arrived - fifo.ready >= fifo.threshold ||
        now - fifo.last_us >= (uint32_t)fifo.silence * fifo.byte_us)
        fifo.ready = arrived;
    count = line_read(bytes, fifo.ready < capacity ? fifo.ready : capacity);
    fifo.ready = (uint16_t)(fifo.ready - count);
    fifo.arrived = (uint16_t)(fifo.arrived - count);
    return count;
}

int uart_read_bytes(uart_port_t uart, void *bytes, uint32_t capacity, TickType_t ticks)
{
    line_expect(uart == CONFIG_METER_UART && is_installed && ticks == 0, "the port waits");
    return take_from_fifo(bytes, (uint16_t)(capacity < UINT16_MAX ? capacity : UINT16_MAX));
}

#if defined CONFIG_METER_DRIVER_PIN
#define DRIVER_PIN CONFIG_METER_DRIVER_PIN
#else
#define DRIVER_PIN UART_PIN_NO_CHANGE
#endif

esp_err_t gpio_set_level(gpio_num_t pin, uint32_t level)
{
    line_expect((int)pin == DRIVER_PIN, "another GPIO is set");
    line_drive(level != 0);
    return ESP_OK;
}

esp_err_t gpio_config(const gpio_config_t *config)
{
    line_expect(DRIVER_PIN >= 0 && config->pin_bit_mask == 1ull << DRIVER_PIN &&
                    config->mode == GPIO_MODE_OUTPUT,
                "another GPIO is set up");
    is_output = 1;
    line_has_driver();
    return ESP_OK;
}

int64_t esp_timer_get_time(void)
{
    return line_micros();
}

void vTaskDelay(const TickType_t ticks)
{
    static int is_checked;

    line_expect(is_even && (DRIVER_PIN < 0 || is_output || (is_rs485 && rts == DRIVER_PIN)),
                "the line is not set");
    line_expect(fifo.threshold == 1, "the FIFO holds bytes back");
    if (!is_checked)
        printf("driver: %s\n", is_rs485 ? "by the UART" : is_output ? "by a pin" : "none");
    is_checked = 1;
    line_sleep(ticks * portTICK_PERIOD_MS * 1000);
}

int main(void)
{
    line_ignore_after(2);
    line_end_after(4);
    app_main();
    return 1;
}
