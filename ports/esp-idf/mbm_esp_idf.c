/* See mbm_esp_idf.h. Licence: MIT OR Apache-2.0. */
#include "mbm_esp_idf.h"

#include "driver/gpio.h"
#include "esp_timer.h"
#include "freertos/FreeRTOS.h"
#include "freertos/task.h"

/* The UART driver wants a receive buffer above the length of its FIFO, 128 bytes. The transmit
 * buffer holds more than the longest frame, so that uart_write_bytes never waits. */
enum { RX_BUFFER = 1024, TX_BUFFER = 1024 };

/* The driver hands over what it has received after this many characters of silence. Its own value
 * of 10 would delay each reply. */
enum { RX_SILENCE = 2 };

/* It hands them over after this many bytes too. Its own value of 120 would hide the silences
 * between frames, and delay them by up to 120 characters. */
enum { RX_THRESHOLD = 1 };

/* The bits of a character: start, data, parity or a second stop bit, stop. */
enum { BITS = 11 };

static int16_t line_read(void *context, uint8_t *bytes, uint16_t capacity)
{
    mbm_espIdfLine *line = context;
    int count;

    if (!line->isOpen)
        return -1;
    count = uart_read_bytes(line->uart, bytes, capacity < INT16_MAX ? capacity : INT16_MAX, 0);
    return (int16_t)count;
}

/* Half a character is added, for rates and clocks that are not exact. The device's reply begins
 * after more than three. */
static int64_t sending_micros(const mbm_espIdfLine *line, uint16_t length)
{
    return (int64_t)(2 * length + 1) * BITS * 500000 / line->baud;
}

static int16_t line_write(void *context, const uint8_t *bytes, uint16_t length)
{
    mbm_espIdfLine *line = context;

    if (!line->isOpen)
        return -1;
    length = length < MBM_MAX_FRAME ? length : MBM_MAX_FRAME;
    line->sentAtUs = esp_timer_get_time() + sending_micros(line, length);
    return (int16_t)uart_write_bytes(line->uart, bytes, length);
}

static uint32_t line_micros(void *context)
{
    (void)context;
    return (uint32_t)esp_timer_get_time();
}

/* uart_wait_tx_done alone would not do: before the UART's interrupt, perhaps on the other core,
 * has taken the first bytes from the transmit buffer, it finds an idle transmitter. */
static uint8_t line_flush(void *context)
{
    mbm_espIdfLine *line = context;

    if (!line->isOpen)
        return 1;
    return esp_timer_get_time() >= line->sentAtUs &&
           uart_wait_tx_done(line->uart, 0) != ESP_ERR_TIMEOUT;
}

static void driver_on(void *context)
{
    mbm_espIdfLine *line = context;

    gpio_set_level((gpio_num_t)line->driverPin, 1);
}

static void driver_off(void *context)
{
    mbm_espIdfLine *line = context;

    gpio_set_level((gpio_num_t)line->driverPin, 0);
}

void mbm_espIdf_wait(uint32_t timeoutUs)
{
    if (timeoutUs >= portTICK_PERIOD_MS * 1000)
        vTaskDelay(1);
}

static void line_idle(void *context, mbm_node *node)
{
    (void)context;
    mbm_espIdf_wait(mbm_node_pollDelay(node));
}

static esp_err_t set_driver(const mbm_espIdfLine *line)
{
    const gpio_config_t output = {.pin_bit_mask = 1ull << line->driverPin,
                                  .mode = GPIO_MODE_OUTPUT,
                                  .intr_type = GPIO_INTR_DISABLE};
    esp_err_t error;

    if (line->driver == MBM_ESP_IDF_DRIVER_BY_UART)
        return uart_set_mode(line->uart, UART_MODE_RS485_HALF_DUPLEX);
    error = gpio_set_level((gpio_num_t)line->driverPin, 0);
    return error == ESP_OK ? gpio_config(&output) : error;
}

static esp_err_t set_line(const mbm_espIdfLine *line)
{
    const uart_config_t config = {
        .baud_rate = line->baud,
        .data_bits = UART_DATA_8_BITS,
        .parity = line->parity,
        .stop_bits = line->parity == UART_PARITY_DISABLE ? UART_STOP_BITS_2 : UART_STOP_BITS_1,
        .flow_ctrl = UART_HW_FLOWCTRL_DISABLE,
        .source_clk = UART_SCLK_DEFAULT,
    };
    int rts = line->driver == MBM_ESP_IDF_DRIVER_BY_UART ? line->driverPin : UART_PIN_NO_CHANGE;
    esp_err_t error = uart_param_config(line->uart, &config);

    if (error == ESP_OK)
        error = uart_set_pin(line->uart, line->txPin, line->rxPin, rts, UART_PIN_NO_CHANGE);
    if (error == ESP_OK)
        error = uart_set_rx_timeout(line->uart, RX_SILENCE);
    if (error == ESP_OK)
        error = uart_set_rx_full_threshold(line->uart, RX_THRESHOLD);
    if (error == ESP_OK && line->driver != MBM_ESP_IDF_NO_DRIVER)
        error = set_driver(line);
    return error;
}

esp_err_t mbm_espIdf_open(mbm_espIdfLine *line, mbm_port *port)
{
    static const mbm_port hooks = {.read = line_read,
                                   .write = line_write,
                                   .micros = line_micros,
                                   .flush = line_flush,
                                   .idle = line_idle};
    esp_err_t error;

    if (line == NULL || port == NULL)
        return ESP_ERR_INVALID_ARG;
    if (line->isOpen)
        return ESP_ERR_INVALID_STATE;
    error = uart_driver_install(line->uart, RX_BUFFER, TX_BUFFER, 0, NULL, 0);
    if (error != ESP_OK)
        return error;
    error = set_line(line);
    if (error != ESP_OK) {
        uart_driver_delete(line->uart);
        return error;
    }
    *port = hooks;
    port->context = line;
    if (line->driver == MBM_ESP_IDF_DRIVER_BY_PIN) {
        port->preTransmission = driver_on;
        port->postTransmission = driver_off;
    }
    line->isOpen = 1;
    return ESP_OK;
}

void mbm_espIdf_close(mbm_espIdfLine *line)
{
    if (line == NULL || !line->isOpen)
        return;
    line->isOpen = 0;
    if (line->driver == MBM_ESP_IDF_DRIVER_BY_PIN)
        gpio_set_level((gpio_num_t)line->driverPin, 0);
    uart_driver_delete(line->uart);
}
