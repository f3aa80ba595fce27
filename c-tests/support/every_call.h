/* Functions of one kind: each is called with arguments that are right, and must return `status`. */
#ifndef EVERY_CALL_H
#define EVERY_CALL_H

#include "mbm.h"

/* Every function of a node that makes a request. They write to address 3. */
void every_node_request_returns(uint8_t status, mbm_node *n);

/* Every function of a line, except begin and setFrame. */
void every_line_call_returns(uint8_t status, mbm_line *l);

/* Every setting of a client, except its delimiter. */
void every_client_setting_returns(uint8_t status, mbm_client *c);

/* Every function of a client that makes a request. One that is pending is cancelled. */
void every_client_request_returns(uint8_t status, mbm_client *c, mbm_clientRequest *r);

/* Begin a client or a server in a framing of MBM_FRAMING_. Only a client of TCP frames has outgoing
 * bytes. */
uint8_t client_begin(mbm_client *c, unsigned framing, const mbm_port *port, uint8_t *incoming,
                     uint16_t in, uint8_t *outgoing, uint16_t out);
uint8_t server_begin(mbm_server *s, unsigned framing, const mbm_port *port, mbm_unit *units,
                     uint8_t count, uint8_t *frame, uint16_t bytes);

/* The same with whole arrays. */
#define CLIENT_BEGIN(client, framing, port, incoming, outgoing)                                    \
    client_begin(client, (unsigned)(framing), port, incoming, sizeof(incoming), outgoing,          \
                 sizeof(outgoing))

#endif
