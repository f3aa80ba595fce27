#define _GNU_SOURCE
#include "uart.h"
#include "freertos.h"
#include "must.h"
#include "test.h"

#include <poll.h>
#include <unistd.h>

struct uart_chip chip;
mbm_freertosUart uart;
mbm_port port;

static uint8_t received[UART_RING], to_send[MBM_MAX_FRAME];

static void start_sending(void *context)
{
    if (chip.is_started)
        must(write(chip.to_do[1], "s", 1) == 1, "start_sending");
}

static uint8_t set_driver(void *context, uint8_t on)
{
    if (chip.pin_fails)
        return 0;
    chip.driver = on;
    chip.driver_was_on |= on;
    if (!on && pthread_equal(pthread_self(), chip.thread))
        chip.driver_in_interrupt++;
    return 1;
}

static void send_interrupt(void)
{
    BaseType_t woken = pdFALSE;
    uint8_t byte;

    for (;;) {
        int more;

        freertos_enter();
        more = mbm_freertos_nextFromISR(&uart, &byte);
        if (!more)
            mbm_freertos_sentFromISR(&uart, &woken);
        freertos_exit();
        if (!more)
            return;
        must(write(chip.fd, &byte, 1) == 1, "send");
    }
}

static void receive_interrupt(void)
{
    BaseType_t woken = pdFALSE;
    uint8_t bytes[16];
    const ssize_t count = read(chip.fd, bytes, sizeof bytes);

    must(count > 0, "receive");
    freertos_enter();
    mbm_freertos_receivedFromISR(&uart, bytes, (uint16_t)count, &woken);
    freertos_exit();
}

static void *interrupts(void *context)
{
    for (;;) {
        struct pollfd waits[2] = {{chip.to_do[0], POLLIN, 0}, {chip.fd, POLLIN, 0}};
        char what;

        poll(waits, 2, -1);
        if (waits[0].revents) {
            must(read(chip.to_do[0], &what, 1) == 1, "interrupts");
            if (what == 'q')
                return NULL;
            send_interrupt();
        }
        if (waits[1].revents & POLLIN)
            receive_interrupt();
    }
}

void uart_start(int fd)
{
    memset(&chip, 0, sizeof chip);
    chip.fd = fd;
    chip.is_started = 1;
    must(pipe(chip.to_do) == 0, "pipe");
    must(pthread_create(&chip.thread, NULL, interrupts, NULL) == 0, "pthread_create");
}

void uart_stop(void)
{
    must(write(chip.to_do[1], "q", 1) == 1, "uart_stop");
    pthread_join(chip.thread, NULL);
    close(chip.to_do[0]);
    close(chip.to_do[1]);
}

void uart_settings(void)
{
    memset(&uart, 0, sizeof uart);
    uart.startSending = start_sending;
    uart.setDriver = set_driver;
    uart.baud = UART_BAUD;
    uart.received = received;
    uart.receivedBytes = sizeof received;
    uart.toSend = to_send;
    uart.toSendBytes = sizeof to_send;
}
