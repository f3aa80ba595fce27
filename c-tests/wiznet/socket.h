/* The part of WIZnet's ioLibrary that the port uses, played by chip_model.c: the names, numbers and
 * behaviour of its sockets and registers on a W5500. The names of its functions are those of POSIX,
 * so here they get others. */
#ifndef SOCKET_MODEL_H
#define SOCKET_MODEL_H

#include <stdint.h>

#define socket wiz_socket
#define close wiz_close
#define listen wiz_listen
#define connect(number, address, port) wiz_connect(number, address, port)
#define disconnect(number) wiz_disconnect(number)
#define send wiz_send
#define recv wiz_recv
#define ctlsocket wiz_ctlsocket
#define getSn_SR wiz_state
#define getSn_IR wiz_interrupts
#define getSn_RX_RSR wiz_received
#define getSn_TX_FSR wiz_free
#define setSn_KPALVTR(number, value) wiz_keepAlive(number, value)

enum { Sn_MR_TCP = 1, SF_TCP_NODELAY = 0x20, SF_IO_NONBLOCK = 1, Sn_IR_TIMEOUT = 8 };
enum { SOCK_IO_BLOCK = 0, SOCK_IO_NONBLOCK = 1, CS_SET_IOMODE = 0 };
enum { SOCK_BUSY = 0, SOCK_OK = 1 };
enum {
    SOCKERR_SOCKNUM = -1,
    SOCKERR_SOCKINIT = -3,
    SOCKERR_SOCKCLOSED = -4,
    SOCKERR_SOCKMODE = -5,
    SOCKERR_SOCKSTATUS = -7,
    SOCKERR_TIMEOUT = -13,
    SOCKERR_DATALEN = -14
};
enum {
    SOCK_CLOSED = 0x00,
    SOCK_INIT = 0x13,
    SOCK_LISTEN = 0x14,
    SOCK_SYNSENT = 0x15,
    SOCK_SYNRECV = 0x16,
    SOCK_ESTABLISHED = 0x17,
    SOCK_FIN_WAIT = 0x18,
    SOCK_CLOSE_WAIT = 0x1C,
    SOCK_LAST_ACK = 0x1D
};

int8_t wiz_socket(uint8_t number, uint8_t protocol, uint16_t port, uint8_t flags);
int8_t wiz_close(uint8_t number);
int8_t wiz_listen(uint8_t number);
int8_t wiz_connect(uint8_t number, uint8_t *address, uint16_t port);
int8_t wiz_disconnect(uint8_t number);
int32_t wiz_send(uint8_t number, uint8_t *bytes, uint16_t length);
int32_t wiz_recv(uint8_t number, uint8_t *bytes, uint16_t length);
int8_t wiz_ctlsocket(uint8_t number, int type, void *value);
uint8_t wiz_state(uint32_t number);
uint8_t wiz_interrupts(uint32_t number);
uint16_t wiz_received(uint8_t number);
uint16_t wiz_free(uint8_t number);
void wiz_keepAlive(uint32_t number, uint8_t value);

#endif
