/* See mbm_esp_idf.h. Licence: MIT OR Apache-2.0. */
#include "mbm_esp_idf.h"

#include <stdbool.h>

#include "driver/gpio.h"
#include "esp_timer.h"
#include "freertos/FreeRTOS.h"
#include "freertos/task.h"
#include "soc/uart_reg.h"

/* The UART driver wants a receive buffer above the length of its FIFO, 128 bytes. The transmit
 * buffer, once it is empty, takes the longest frame, so that uart_write_bytes does not wait. The
 * driver makes an event for each character: the queue takes those of the longest frame. */
enum { RX_BUFFER = 1024, TX_BUFFER = 1024, EVENTS = MBM_MAX_FRAME };

/* The driver hands over what it has received after this many characters of silence. Its own value
 * of 10 would delay each reply. */
enum { RX_SILENCE = 2 };

/* It hands them over after this many bytes too. Its own value of 120 would hide the silences
 * between frames, and delay them by up to 120 characters. */
enum { RX_THRESHOLD = 1 };

/* Microseconds after its time until a frame that does not leave is given up. The request of a
 * master has ended before. */
enum { PATIENCE = 3000000 };

static uart_stop_bits_t stop_bits(const mbm_espIdfLine *line)
{
    if (line->stopBits != 0)
        return (uart_stop_bits_t)line->stopBits;
    return line->parity == UART_PARITY_DISABLE ? UART_STOP_BITS_2 : UART_STOP_BITS_1;
}

/* --- the driver */

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
        .stop_bits = stop_bits(line),
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
    /* The driver leaves the interrupt for a wrong stop bit off. */
    if (error == ESP_OK)
        error = uart_enable_intr_mask(line->uart, UART_FRM_ERR_INT_ENA);
    if (error == ESP_OK && line->driver != MBM_ESP_IDF_NO_DRIVER)
        error = set_driver(line);
    return error;
}

static esp_err_t install(mbm_espIdfLine *line)
{
    QueueHandle_t events;
    esp_err_t error = uart_driver_install(line->uart, RX_BUFFER, TX_BUFFER, EVENTS, &events, 0);

    if (error != ESP_OK)
        return error;
    error = set_line(line);
    if (error == ESP_OK)
        line->events = events;
    else
        uart_driver_delete(line->uart);
    return error;
}

/* Installs the driver again that could not be installed, or that the program has removed. */
static bool is_ready(mbm_espIdfLine *line)
{
    return line->isOpen && (uart_is_driver_installed(line->uart) || install(line) == ESP_OK);
}

/* --- the hooks */

static void count_events(mbm_espIdfLine *line)
{
    uart_event_t event;

    if (uxQueueSpacesAvailable(line->events) == 0)
        line->overruns++;
    while (xQueueReceive(line->events, &event, 0)) {
        if (event.type == UART_FIFO_OVF)
            line->overruns++;
        else if (event.type == UART_FRAME_ERR || event.type == UART_PARITY_ERR)
            line->faulty++;
    }
}

static int16_t line_read(void *context, uint8_t *bytes, uint16_t capacity)
{
    mbm_espIdfLine *line = context;

    if (!is_ready(line))
        return -1;
    /* A full buffer that is read goes on by itself. */
    count_events(line);
    return (int16_t)uart_read_bytes(line->uart, bytes, capacity < INT16_MAX ? capacity : INT16_MAX,
                                    0);
}

/* Half a character is added, for rates and clocks that are not exact. The device's reply begins
 * after more than three. */
static int64_t sending_micros(const mbm_espIdfLine *line, uint16_t length)
{
    const int bits =
        line->parity == UART_PARITY_DISABLE && stop_bits(line) == UART_STOP_BITS_1 ? 10 : 11;

    return (int64_t)(2 * length + 1) * bits * 500000 / line->baud;
}

/* uart_wait_tx_done alone would not do: before the UART's interrupt, perhaps on the other core,
 * has taken the first bytes from the transmit buffer, it finds an idle transmitter. */
static bool has_left(const mbm_espIdfLine *line)
{
    return esp_timer_get_time() >= line->sentAtUs &&
           uart_wait_tx_done(line->uart, 0) != ESP_ERR_TIMEOUT;
}

static int16_t line_write(void *context, const uint8_t *bytes, uint16_t length)
{
    mbm_espIdfLine *line = context;

    if (!is_ready(line))
        return -1;
    if (!has_left(line))
        return 0;
    length = length < MBM_MAX_FRAME ? length : MBM_MAX_FRAME;
    line->sentAtUs = esp_timer_get_time() + sending_micros(line, length);
    return (int16_t)uart_write_bytes(line->uart, bytes, length);
}

static uint32_t line_micros(void *context)
{
    (void)context;
    return (uint32_t)esp_timer_get_time();
}

/* A server waits for this alone. */
static uint8_t line_flush(void *context)
{
    const mbm_espIdfLine *line = context;

    return !line->isOpen || has_left(line) || esp_timer_get_time() >= line->sentAtUs + PATIENCE;
}

static void driver_on(void *context)
{
    mbm_espIdfLine *line = context;

    gpio_set_level((gpio_num_t)line->driverPin, 1);
}

/* What has not left by now must not leave later. Only a new driver forgets it. */
static void end_transmission(void *context)
{
    mbm_espIdfLine *line = context;

    if (line->driver == MBM_ESP_IDF_DRIVER_BY_PIN)
        gpio_set_level((gpio_num_t)line->driverPin, 0);
    if (!line->isOpen || has_left(line))
        return;
    line->stalled++;
    line->sentAtUs = 0;
    uart_driver_delete(line->uart);
    (void)install(line);
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

/* --- begin and end */

/* A negative number would be no error of uart_set_pin, and no pin either. */
static bool has_pin(const mbm_espIdfLine *line)
{
    return line->driver == MBM_ESP_IDF_NO_DRIVER ||
           (line->driverPin >= 0 && line->driverPin < GPIO_NUM_MAX);
}

esp_err_t mbm_espIdf_open(mbm_espIdfLine *line, mbm_port *port)
{
    static const mbm_port hooks = {.read = line_read,
                                   .write = line_write,
                                   .micros = line_micros,
                                   .flush = line_flush,
                                   .postTransmission = end_transmission,
                                   .idle = line_idle};
    esp_err_t error;

    if (line == NULL || port == NULL || line->baud <= 0 || !has_pin(line))
        return ESP_ERR_INVALID_ARG;
    if (line->isOpen)
        return ESP_ERR_INVALID_STATE;
    error = install(line);
    if (error != ESP_OK)
        return error;
    line->overruns = line->faulty = line->stalled = 0;
    line->sentAtUs = 0;
    *port = hooks;
    port->context = line;
    if (line->driver == MBM_ESP_IDF_DRIVER_BY_PIN)
        port->preTransmission = driver_on;
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
