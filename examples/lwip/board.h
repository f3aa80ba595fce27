/* What the examples need of a board with a network. Licence: MIT OR Apache-2.0. */
#ifndef BOARD_H
#define BOARD_H

/* Begins lwIP (lwip_init), adds the interface (netif_add) and takes it up. */
void board_begin(void);

/* Hands received packets to lwIP (the driver's netif->input), and runs its timers
 * (sys_check_timeouts). */
void board_poll(void);

void board_print(const char *text);
void board_printNumber(unsigned long number);

#endif
