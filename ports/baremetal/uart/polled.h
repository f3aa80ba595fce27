/* The hooks of a UART that the main loop polls. Before the include, define DATA, the register of
 * sent bytes; take_byte(), which takes a received byte, counts overruns and returns 0 if there is
 * none; CAN_SEND, whether DATA accepts a byte; and IS_DONE, whether the last bit has left.
 * Licence: MIT OR Apache-2.0. */

uint16_t uart_lost(void)
{
    return overruns;
}

int16_t uart_read(void *context, uint8_t *bytes, uint16_t capacity)
{
    uint16_t count = 0;

    (void)context;
    if (take_failure() != 0u) {
        return -1;
    }
    while ((count < capacity) && (take_byte(&bytes[count]) != 0u)) {
        count++;
    }
    return (int16_t)count;
}

int16_t uart_write(void *context, const uint8_t *bytes, uint16_t length)
{
    uint16_t count = 0;

    (void)context;
    while ((count < length) && CAN_SEND) {
        DATA = bytes[count];
        count++;
    }
    return written(count, uart_start);
}

uint8_t uart_flush(void *context)
{
    (void)context;
    return flushed(IS_DONE, uart_start);
}
