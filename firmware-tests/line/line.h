/* A serial line in memory, with a device at its other end and a clock of its own. For tests of
 * a port on an operating system that is played: its UART calls these functions.
 *
 * Every byte takes the time of 11 bits. The program ends with a message if a byte leaves while
 * the driver is off, or arrives while it is on, if the line has one.
 * Licence: MIT OR Apache-2.0. */
#ifndef LINE_H
#define LINE_H

#include <stdbool.h>
#include <stdint.h>

/* The device: unit 17, holding registers 100 and 101 with 2301 and 50. */
enum { LINE_UNIT = 17, LINE_ADDRESS = 100, LINE_FIRST = 2301, LINE_SECOND = 50 };

void line_begin(uint32_t baud);

/* The line has a transceiver whose driver is switched. It is off. */
void line_has_driver(void);

/* The device answers so many requests, then ignores one, and so on. */
void line_ignore_after(unsigned requests);

/* Returns the time in microseconds. Every call takes one. */
uint32_t line_micros(void);

/* Lets time pass. */
void line_sleep(uint32_t micros);

/* Queues bytes to send, at most so many that 512 wait. Returns how many. */
uint16_t line_write(const uint8_t *bytes, uint16_t length);

/* Returns how many bytes wait, with the one that is being sent. */
uint16_t line_unsent(void);

/* Returns received bytes. */
uint16_t line_read(uint8_t *bytes, uint16_t capacity);
uint16_t line_received(void);

/* Switches the transceiver's driver. */
void line_drive(bool on);
bool line_is_driving(void);

/* Called whenever a byte has left or arrived. The player of the operating system defines it. */
void line_interrupt(void);

/* Replaces the device by a function, before line_begin. The line calls it with the time in
 * microseconds, at least once for each byte. It reads what the program has sent, and writes. */
void line_replace_device(void (*step)(uint32_t now));
uint16_t line_read_as_device(uint8_t *bytes, uint16_t capacity);
uint16_t line_write_as_device(const uint8_t *bytes, uint16_t length);

/* Ends the program with this message unless the fact is true. */
void line_expect(bool fact, const char *what);

/* The transmitter stands still, or goes on. What it has stays in it. */
void line_stop(bool stops);

/* Drops the bytes that have not left. */
void line_drop_unsent(void);

/* A line as at the program's begin, but for the time and the device. For several tests in one
 * program. */
void line_reset(void);

/* Ends the program with success in the first sleep of half a second or more after the device has
 * answered so many requests. */
void line_end_after(unsigned wanted);

#endif
