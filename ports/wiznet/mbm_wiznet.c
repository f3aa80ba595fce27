/* See mbm_wiznet.h. Licence: MIT OR Apache-2.0. */
#include "mbm_wiznet.h"

#include "socket.h"

/* Values of mbm_wiznet.state. CLOSING: the last bytes and the end of the stream are being sent. */
enum { UNUSED, CONNECTING, CONNECTED, LISTENING, CLOSING, LOST };

/* Local ports of clients, one after the other: a peer may still have the last connection of a port.
 */
enum { FIRST_LOCAL_PORT = 49152, LAST_LOCAL_PORT = 65279 };

/* The chip probes a silent peer every three times five seconds. */
enum { KEEP_ALIVE = 3 };

/* What the registers of a chip that is not there read as: no state has this number. */
enum { NO_CHIP = 0xFF };

/* The most bytes that a hook moves, since its result is an int16_t. */
enum { MOST = 0x7FFF };

static uint16_t server_port(const mbm_wiznet *chip)
{
    return chip->port != 0 ? chip->port : MBM_WIZNET_PORT;
}

static uint8_t state_of(const mbm_wiznet *chip)
{
    return getSn_SR((uint32_t)chip->number);
}

/* The chip forgets the connection, with what was not acknowledged. ioLibrary waits for the chip's
 * answer to a command, and so for ever if there is no chip. */
static void leave(mbm_wiznet *chip, int8_t error)
{
    if (state_of(chip) != NO_CHIP)
        (void)close(chip->number);
    chip->state = LOST;
    chip->error = error;
}

static int8_t reason_of(const mbm_wiznet *chip)
{
    return getSn_IR((uint32_t)chip->number) & Sn_IR_TIMEOUT ? SOCKERR_TIMEOUT : SOCKERR_SOCKCLOSED;
}

static int open_socket(mbm_wiznet *chip, uint16_t port, uint8_t mode)
{
    int8_t opened = SOCKERR_SOCKINIT;

    if (state_of(chip) != NO_CHIP)
        opened = socket(chip->number, Sn_MR_TCP, port, (uint8_t)(SF_TCP_NODELAY | mode));
    if (opened == (int8_t)chip->number)
        return 0;
    chip->state = LOST;
    chip->error = opened < 0 ? opened : SOCKERR_SOCKNUM;
    return -1;
}

/* ioLibrary's recv returns nothing in its non-blocking mode, on a W5500 for one. So a connection is
 * in the blocking mode, and is only asked for bytes that are there. */
static void set_mode(const mbm_wiznet *chip, uint8_t mode)
{
    (void)ctlsocket(chip->number, CS_SET_IOMODE, &mode);
}

static void enter_connected(mbm_wiznet *chip)
{
    set_mode(chip, SOCK_IO_BLOCK);
#ifdef setSn_KPALVTR
    setSn_KPALVTR((uint32_t)chip->number, KEEP_ALIVE);
#endif
    chip->state = CONNECTED;
    chip->error = 0;
    chip->activeUs = chip->micros(chip->context);
}

/* Looks at the chip. A peer that has closed its side is connected until its bytes are read. */
static uint8_t progress(mbm_wiznet *chip)
{
    uint8_t seen;

    if (chip->state != CONNECTING && chip->state != CONNECTED)
        return MBM_LINK_LOST;
    seen = state_of(chip);
    switch (seen) {
    case SOCK_ESTABLISHED: break;
    case SOCK_CLOSE_WAIT:
        if (chip->state == CONNECTED && getSn_RX_RSR(chip->number) == 0)
            return MBM_LINK_LOST;
        break;
    case NO_CHIP: leave(chip, SOCKERR_SOCKINIT); return MBM_LINK_LOST;
    default:
        if (chip->state == CONNECTING && seen != SOCK_CLOSED)
            return MBM_PENDING;
        leave(chip, reason_of(chip));
        return MBM_LINK_LOST;
    }
    if (chip->state == CONNECTING)
        enter_connected(chip);
    return MBM_OK;
}

/* --- the client */

uint8_t mbm_wiznet_connect(void *context)
{
    mbm_wiznet *chip = (mbm_wiznet *)context;
    int8_t begun;

    if (chip->localPort < FIRST_LOCAL_PORT || chip->localPort >= LAST_LOCAL_PORT)
        chip->localPort = FIRST_LOCAL_PORT;
    else
        chip->localPort++;
    if (open_socket(chip, chip->localPort, SF_IO_NONBLOCK) != 0)
        return MBM_LINK_LOST;
    begun = connect(chip->number, chip->address, server_port(chip));
    if (begun != SOCK_BUSY && begun != SOCK_OK) {
        leave(chip, begun);
        return MBM_LINK_LOST;
    }
    chip->state = CONNECTING;
    chip->error = SOCKERR_TIMEOUT;
    return MBM_PENDING;
}

void mbm_wiznet_disconnect(void *context)
{
    mbm_wiznet *chip = (mbm_wiznet *)context;

    if (chip->state != UNUSED && chip->state != LOST)
        leave(chip, chip->state == CONNECTING ? SOCKERR_TIMEOUT : SOCKERR_SOCKCLOSED);
}

uint8_t mbm_wiznet_status(void *context)
{
    mbm_wiznet *chip = (mbm_wiznet *)context;
    const uint8_t status = progress(chip);

    if (status != MBM_LINK_LOST)
        return status;
    if (chip->state == CONNECTED)
        leave(chip, SOCKERR_SOCKCLOSED);
    return chip->error == SOCKERR_TIMEOUT ? MBM_CONNECT_TIMED_OUT : MBM_LINK_LOST;
}

/* --- the hooks */

static int16_t wiznet_read(void *context, uint8_t *bytes, uint16_t capacity)
{
    mbm_wiznet *chip = (mbm_wiznet *)context;
    const uint8_t status = progress(chip);
    uint16_t count;
    int32_t got;

    if (status != MBM_OK || capacity == 0)
        return (int16_t)(status == MBM_LINK_LOST ? -1 : 0);
    count = getSn_RX_RSR(chip->number);
    if (count == 0)
        return 0;
    count = count < capacity ? count : capacity;
    got = recv(chip->number, bytes, count < MOST ? count : MOST);
    if (got < 0) {
        leave(chip, SOCKERR_SOCKCLOSED);
        return -1;
    }
    chip->activeUs = chip->micros(chip->context);
    return (int16_t)got;
}

/* ioLibrary takes no bytes until the peer has acknowledged the last ones. */
static int16_t wiznet_write(void *context, const uint8_t *bytes, uint16_t length)
{
    mbm_wiznet *chip = (mbm_wiznet *)context;
    uint8_t status = progress(chip);
    uint16_t count;
    int32_t taken;

    /* A response still leaves if the peer has closed its side. */
    if (status == MBM_LINK_LOST && chip->state == CONNECTED)
        status = MBM_OK;
    if (status != MBM_OK || length == 0)
        return (int16_t)(status == MBM_LINK_LOST ? -1 : 0);
    count = getSn_TX_FSR(chip->number);
    count = count < length ? count : length;
    if (count == 0)
        return 0;
    taken = send(chip->number, (uint8_t *)(uintptr_t)bytes, count < MOST ? count : MOST);
    if (taken < 0) {
        leave(chip, taken == SOCKERR_TIMEOUT ? SOCKERR_TIMEOUT : SOCKERR_SOCKCLOSED);
        return -1;
    }
    if (taken > 0)
        chip->activeUs = chip->micros(chip->context);
    return (int16_t)taken;
}

static uint32_t wiznet_micros(void *context)
{
    const mbm_wiznet *chip = (const mbm_wiznet *)context;

    return chip->micros(chip->context);
}

mbm_port mbm_wiznet_port(mbm_wiznet *chip)
{
    mbm_port port = {.context = chip, .read = wiznet_read, .write = wiznet_write};

    port.micros = wiznet_micros;
    return port;
}

/* --- the server */

static int listen_again(mbm_wiznet *chip)
{
    int8_t begun;

    if (open_socket(chip, server_port(chip), 0) != 0)
        return -1;
    begun = listen(chip->number);
    if (begun != SOCK_OK) {
        leave(chip, begun);
        return -1;
    }
    chip->state = LISTENING;
    chip->error = 0;
    return 0;
}

static int look_for_client(mbm_wiznet *chip)
{
    switch (state_of(chip)) {
    case SOCK_ESTABLISHED:
    case SOCK_CLOSE_WAIT: enter_connected(chip); return 1;
    case SOCK_LISTEN:
    case SOCK_SYNRECV: return 0;
    default: return listen_again(chip);
    }
}

/* The peer has closed its side, and has its responses or will get them: closes the other side. The
 * chip gives up by itself if the peer does not acknowledge that. */
static void close_softly(mbm_wiznet *chip)
{
    set_mode(chip, SOCK_IO_NONBLOCK);
    (void)disconnect(chip->number);
    chip->state = CLOSING;
}

static int look_at_connection(mbm_wiznet *chip)
{
    if (progress(chip) == MBM_LINK_LOST) {
        if (chip->state != CONNECTED)
            return listen_again(chip);
        close_softly(chip);
        return 0;
    }
    if (chip->idleTimeMs != 0 &&
        chip->micros(chip->context) - chip->activeUs >= chip->idleTimeMs * 1000u) {
        leave(chip, SOCKERR_TIMEOUT);
        return listen_again(chip);
    }
    return 2;
}

int mbm_wiznet_serve(mbm_wiznet *chip)
{
    switch (chip->state) {
    case LISTENING: return look_for_client(chip);
    case CONNECTED: return look_at_connection(chip);
    case CLOSING:
        if (state_of(chip) == SOCK_LAST_ACK)
            return 0;
        return listen_again(chip);
    default: return listen_again(chip);
    }
}
