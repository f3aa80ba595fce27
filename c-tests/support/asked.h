/* What libmodbus's client finds of a server of ours: the same on every line. */
#ifndef ASKED_H
#define ASKED_H

#include "served.h"

#include <modbus.h>

/* Every function that the client has, at its edges. */
void asked_reads(modbus_t *client);
void asked_writes(modbus_t *client, served *s);
void asked_edges(modbus_t *client);
void asked_refusals(modbus_t *client, served *s);

/* Sends bytes and collects what comes back, up to 600 bytes: waits for so many as are
 * expected, and a while for more, which should not come. Returns how many. */
size_t asked_bytes(int fd, const uint8_t *bytes, size_t length, uint8_t *answer, size_t expected);

/* Asks a unit for its exception status over TCP, and expects a response that ends with
 * this byte; 0 if the connection, for which there is no place, was closed instead. */
int asked_is_served(int fd, uint8_t unit, uint8_t last);

/* Sends the frame of a PDU to a unit, and expects the frame of another, or none
 * if that is of no bytes. */
void asked_frames(int fd, int framing, uint8_t unit, const uint8_t *pdu, size_t length,
                  const uint8_t *response, size_t expected);

/* The functions that libmodbus's client does not have. */
void asked_functions(int fd, int framing, served *s);

/* Counts that lie, quantities out of order, too much and too little: refused, and
 * no cell changes. */
void asked_lies(int fd, int framing, served *s);

#endif
