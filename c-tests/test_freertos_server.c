/* A task of FreeRTOS that serves, with libmodbus as its master. Tasks are threads: see
 * test_freertos.c. */
#include "freertos.h"
#include "await.h"
#include "must.h"
#include "pty.h"
#include "uart.h"

#include <modbus.h>

enum { UNIT = 17, SLOW = 0x41, LONG = 20000 /* ms */, SHORT = 40 /* ms */ };

static uint16_t words[10];
static uint8_t frame[MBM_MAX_FRAME];
static pty served;
static modbus_t *client;
static mbm_server responder;
static mbm_unit unit;
static mbm_registerTable holding;
static mbm_custom slow;
static volatile uint16_t slow_reply;
static volatile unsigned polls;
static volatile int is_over;
static pthread_t serving;

static uint16_t serve_slowly(void *context, const mbm_request *request, uint8_t *response,
                             uint16_t capacity)
{
    return slow_reply;
}

static void *serve(void *context)
{
    while (!is_over) {
        (void)mbm_server_poll(&responder);
        polls++;
        mbm_freertos_wait(&uart.line, mbm_server_pollDelay(&responder));
    }
    return NULL;
}

static void setup(void)
{
    pty_open(&served);
    uart_settings();
    OK(mbm_freertos_open(&uart, &port));
    uart_start(served.ours);
    memset(&responder, 0, sizeof responder);
    unit = (mbm_unit){.id = UNIT};
    holding = (mbm_registerTable){.words = words, .base = 100, .size = 10};
    slow = (mbm_custom){.code = SLOW, .serve = serve_slowly};
    OK(mbm_unit_serveHoldingRegisters(&unit, &holding));
    OK(mbm_unit_serveCustom(&unit, &slow));
    OK(mbm_server_beginRtu(&responder, &port, &unit, 1, frame, sizeof frame));
    OK(mbm_server_setBaudRate(&responder, UART_BAUD));
    client = modbus_new_rtu(served.path, UART_BAUD, 'N', 8, 1);
    assert_int_equal(modbus_set_slave(client, UNIT), 0);
    assert_int_equal(modbus_connect(client), 0);
    modbus_set_response_timeout(client, LONG / 1000, 0);
    is_over = 0;
    polls = 0;
    freertos_sleeps = freertos_yields = freertos_given = 0;
    assert_int_equal(pthread_create(&serving, NULL, serve, NULL), 0);
}

static void teardown(void)
{
    is_over = 1;
    mbm_freertos_wake(&uart.line);
    pthread_join(serving, NULL);
    modbus_close(client);
    modbus_free(client);
    uart_stop();
    pty_close(&served);
}

fixture each_test = {setup, teardown};

static void serves_right(uint16_t value)
{
    uint16_t read[10] = {0};

    assert_int_equal(modbus_write_register(client, 105, value), 1);
    assert_int_equal(modbus_read_registers(client, 100, 10, read), 10);
    assert_int_equal(read[5], value);
}

TEST(a_server_task_sleeps_until_bytes_come)
{
    AWAIT(uart.line.waiting != NULL);
    for (uint16_t i = 1; i <= 20; i++)
        serves_right(i);
    /* 40 requests of 8 bytes; for each the silence, the frame that leaves, and its echo. */
    assert_in_range(freertos_sleeps, 20, 40 * 16);
    assert_in_range(polls, 20, 40 * 24);
}

TEST(a_server_with_a_pending_function_sleeps_although_bytes_wait)
{
    uint8_t request[] = {UNIT, SLOW}, noise[40] = {0};
    unsigned polled, slept;

    slow_reply = MBM_REPLY_PENDING;
    assert_true(modbus_send_raw_request(client, request, sizeof request) > 0);
    AWAIT(polls > 0 && mbm_server_pollDelay(&responder) == 1000);
    must(write(served.theirs, noise, sizeof noise) == sizeof noise, "noise");
    AWAIT(mbm_ring_available(&uart.ring) == sizeof noise);
    polled = polls;
    slept = freertos_sleeps;
    AWAIT(polls > polled + 50);
    assert_true(freertos_sleeps - slept >= polls - polled - 10);
    slow_reply = 0;
    /* The noise came after the request, which therefore gets no answer; and a request that follows
     * it without a silence is lost with it. */
    modbus_set_response_timeout(client, 0, 1000 * SHORT);
    AWAIT(modbus_write_register(client, 105, 6) == 1);
    modbus_set_response_timeout(client, LONG / 1000, 0);
    serves_right(7);
}

TEST(a_server_whose_uart_stops_answers_again_once_it_works)
{
    uint16_t read;

    serves_right(1);
    chip.is_started = 0;
    modbus_set_response_timeout(client, 0, 1000 * SHORT);
    assert_int_equal(modbus_read_registers(client, 100, 1, &read), -1);
    AWAIT(mbm_freertos_stalled(&uart) == 1);
    chip.is_started = 1;
    modbus_set_response_timeout(client, LONG / 1000, 0);
    serves_right(2);
    assert_int_equal(mbm_freertos_stalled(&uart), 1);
}
