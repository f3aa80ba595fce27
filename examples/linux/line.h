/* What the examples with a client share: a place named on the command line, and a client
 * for it.
 *
 *     rtu:/dev/ttyUSB0,19200,E       a serial line; rate 19200 and parity N if left out
 *     ascii:/dev/ttyUSB0,9600,E      the same with ASCII frames and seven bits
 *     tcp:192.168.0.7,502            Modbus TCP; port 502 if left out
 *     rtuovertcp:192.168.0.7,4001    RTU frames in a TCP stream
 *
 * Licence: MIT OR Apache-2.0. */
#ifndef LINE_H
#define LINE_H

#include "mbm_tcp.h"
#include "mbm_tty.h"

#include <signal.h>

/* The description of places, for a usage text. */
#define LINE_HELP                                                                                  \
    "places:\n"                                                                                    \
    "  rtu:PATH[,BAUD[,N|E|O]]     a serial line, 19200 and N if left out\n"                       \
    "  ascii:PATH[,BAUD[,N|E|O]]   the same in ASCII frames and seven bits\n"                      \
    "  tcp:HOST[,PORT]             Modbus TCP, port 502 if left out\n"                             \
    "  rtuovertcp:HOST[,PORT]      RTU frames in a TCP stream\n"                                   \
    "Numbers are decimal, or hexadecimal with 0x in front.\n"

typedef struct line {
    mbm_client client;
    mbm_link kept; /* opens the terminal or connection again when it was lost */
    mbm_counters counters;
    mbm_tty tty;
    mbm_tcp tcp;
    mbm_tcp_addresses addresses;
    uint8_t is_tcp;
    int lost_by;      /* errno of the last loss of the link */
    char status[128]; /* text of line_status */
    uint8_t incoming[1024], outgoing[1024];
} line;

/* Opens a place and begins its client. Returns 0, or -1 after printing the reason to stderr. */
int line_open(line *l, const char *place);
void line_close(line *l);

/* Moves requests on. A terminal or connection that was lost is opened again a second later. */
void line_poll(line *l);

/* Waits until there is a connection. Returns 0, or -1 after printing the reason to stderr. */
int line_connect(line *l);

/* Why the link was last lost. */
const char *line_reason(const line *l);

/* The status of a request that has ended, in words. For a lost link it includes the reason. */
const char *line_status(line *l, const mbm_clientRequest *request);

/* Sleeps until the client has something to do, at most `milliseconds` or a second. */
void line_rest(line *l, uint32_t milliseconds);

/* Prints a usage text: to stdout if `wrong` is 0, else to stderr. Returns the program's
 * exit code. */
int line_usage(int wrong, const char *usage);

/* Returns whether --help or -h is among the arguments. */
int line_wants_help(int argc, char **argv);

/* The time in milliseconds. It wraps. */
uint32_t line_milliseconds(void);

/* Ctrl-C and SIGTERM set this. */
extern volatile sig_atomic_t line_ended;

/* The name of the table that a function from 1 to 4 reads, NULL for any other function. */
const char *line_tables(long function);

/* Queues a read of up to 125 registers or bits by function 1 to 4. */
uint8_t line_read(line *l, mbm_clientRequest *request, long function, uint16_t address,
                  uint16_t quantity);

/* Item `index` of the response to such a read. */
uint16_t line_value(const mbm_clientRequest *request, long function, unsigned index);

/* Reads a number from `least` to `most`. Ends the program if the text is not one. */
long line_number(const char *text, long least, long most);

/* Returns whether `quantity` registers or bits from `address` on end at 65535 or before. If
 * not, prints that to stderr. */
int line_addresses(long address, long quantity);

#endif
