/* The reading and writing of a UART that the main loop polls. Before the include, define
 * DATA, the register of received and sent bytes; HAS_BYTE, whether a byte waits to be
 * read; and CAN_SEND, whether DATA accepts a byte. Licence: MIT OR Apache-2.0. */

int16_t uart_read(void *context, uint8_t *bytes, uint16_t capacity)
{
    uint16_t count = 0;

    (void)context;
    while ((count < capacity) && HAS_BYTE) {
        bytes[count] = (uint8_t)DATA;
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
    return (int16_t)count;
}
