/* Tables of functions: each is called with arguments that are right, and must return `status`. */
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

#endif
