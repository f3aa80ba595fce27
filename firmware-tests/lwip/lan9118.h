/* The Ethernet controller LAN9118 of an MPS2 board, as lwIP's interface under FreeRTOS. */
#ifndef LAN9118_H
#define LAN9118_H

#include "lwip/netif.h"

/* For netif_add. Starts the controller. */
err_t lan9118_init(struct netif *netif);

/* Hands one received frame to lwIP. Returns 0 if there is none. */
int lan9118_receive(struct netif *netif);

/* Returns whether a cable is plugged in. */
int lan9118_hasLink(void);

/* Switches the interrupt for received frames on or off. */
void lan9118_interrupt(int on);

extern volatile unsigned lan9118_lost; /* frames for which lwIP had no memory, or damaged ones */

#endif
