/* Requests of libmodbus's client to an mbm server, with checks of the responses. They are
 * the same on every line. */
#ifndef ASKED_H
#define ASKED_H

#include "served.h"

#include <modbus.h>

/* Connects a client, for requests to a unit. Returns 0, or -1 if that fails. */
int asked_connect(modbus_t *client, int unit);

/* Calls every function that the client has, at the limits of its quantities. */
void asked_reads(modbus_t *client);
void asked_writes(modbus_t *client, served *s);
void asked_edges(modbus_t *client);
void asked_refusals(modbus_t *client, served *s);

/* Sends bytes, then collects up to 600 received bytes: waits until `expected` bytes have
 * arrived, then a short time for more, which should not come. Returns how many arrived. */
size_t asked_bytes(int fd, const uint8_t *bytes, size_t length, uint8_t *answer, size_t expected);

/* Reads the exception status of a unit over TCP and expects a response that ends with the
 * byte `last`. Returns 0 if the server closed the connection instead, because it had no
 * place for it. */
int asked_is_served(int fd, uint8_t unit, uint8_t last);

/* Sends the frame of a PDU to a unit and expects the frame of another PDU. A PDU of 0 bytes
 * expects no response. */
void asked_frames(int fd, int framing, uint8_t unit, const uint8_t *pdu, size_t length,
                  const uint8_t *response, size_t expected);

/* Calls the functions that libmodbus's client does not have. */
void asked_functions(int fd, int framing, served *s);

/* Sends wrong byte counts, quantities out of range, too many and too few bytes. The server
 * must refuse all of them and change no register or bit. */
void asked_lies(int fd, int framing, served *s);

#endif
