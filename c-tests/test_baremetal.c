/* Faults of the UARTs of ports/baremetal/uart, whose registers are played here: the receiver
 * overruns, and the transmitter takes nothing, or keeps what it has. QEMU's UARTs do neither. */
#include "registers.h"
#include "board.h"
#include "crc.h"
#include "machine.h"
#include "mbm.h"
#include "test.h"

enum { UNIT = 17, BY_READING_BYTE = 0, BY_READING_STATUS, BY_ONE };
enum {
    UNREAD = 0x0EAD0000
}; /* what a register of 32 bits without a byte has: a write changes it */

/* What differs between the chips. A bit is 0 if the chip has none for it. */
typedef struct chip {
    const char *name;
    uint32_t receive, transmit, status, errors; /* offsets of the registers */
    uint32_t hasByte, hasNone, canSend, isFull, isDone, isBusy;
    uint32_t overrun;   /* in `errors`, or in the received byte's register */
    uint8_t isCleared;  /* how */
    uint8_t isEventful; /* a byte that has left is an event, and no bit of the status */
    mbm_port port;
    void (*start)(void);
    uint16_t (*lost)(void), (*stalled)(void);
    void (*interrupt)(void);
} chip;

#define DECLARE(prefix)                                                                            \
    void prefix##_uart_start(void);                                                                \
    int16_t prefix##_uart_read(void *context, uint8_t *bytes, uint16_t capacity);                  \
    int16_t prefix##_uart_write(void *context, const uint8_t *bytes, uint16_t length);             \
    uint8_t prefix##_uart_flush(void *context);                                                    \
    uint16_t prefix##_uart_lost(void);                                                             \
    uint16_t prefix##_uart_stalled(void);
#define FUNCTIONS(prefix)                                                                          \
    .name = #prefix, .start = prefix##_uart_start, .lost = prefix##_uart_lost,                     \
    .stalled = prefix##_uart_stalled,                                                              \
    .port = {.read = prefix##_uart_read,                                                           \
             .write = prefix##_uart_write,                                                         \
             .flush = prefix##_uart_flush,                                                         \
             .micros = clock_micros}

DECLARE(u_16550)
DECLARE(u_cmsdk)
DECLARE(u_nrf51)
DECLARE(u_pl011)
DECLARE(u_pl011_interrupt)
DECLARE(u_stm32f4)
void u_pl011_interrupt_uart_interrupt(void);

#define OF_PL011                                                                                   \
    .receive = 0, .transmit = 0, .status = 0x18, .errors = 0, .hasNone = 1 << 4, .isFull = 1 << 5, \
    .isBusy = 1 << 3, .overrun = 1 << 11

static const chip chips[] = {
    {FUNCTIONS(u_16550), .receive = 0, .transmit = 0, .status = 5, .errors = 5, .hasByte = 1,
     .canSend = 1 << 5, .isDone = 1 << 6, .overrun = 2, .isCleared = BY_READING_STATUS},
    {FUNCTIONS(u_cmsdk), .receive = 0, .transmit = 0, .status = 4, .errors = 4, .hasByte = 2,
     .isFull = 1, .overrun = 8, .isCleared = BY_ONE},
    {FUNCTIONS(u_nrf51), .receive = 0x518, .transmit = 0x51C, .status = 0x108, .errors = 0x480,
     .hasByte = 1, .overrun = 1, .isCleared = BY_ONE, .isEventful = 1},
    {FUNCTIONS(u_pl011), OF_PL011},
    {FUNCTIONS(u_pl011_interrupt), OF_PL011, .interrupt = u_pl011_interrupt_uart_interrupt},
    {FUNCTIONS(u_stm32f4), .receive = 4, .transmit = 4, .status = 0, .errors = 0, .hasByte = 1 << 5,
     .canSend = 1 << 7, .isDone = 1 << 6, .overrun = 8},
};

static const chip *now_played;
static uint32_t slot, last;
static uint8_t waiting[64], sent[256];
static unsigned waitingCount, sentCount, stuck;
static int hasOverrun, isStopped;
static uint32_t now;

static void device(void);

/* Each look at the clock takes 100 microseconds. */
uint32_t clock_micros(void *context)
{
    now += 100;
    device();
    if (now_played->interrupt != NULL && waitingCount > 0)
        now_played->interrupt();
    return now;
}

static void take_first(void)
{
    waitingCount--;
    memmove(waiting, waiting + 1, waitingCount);
}

/* What the last access did. A register for both directions is read while bytes wait. */
static void settle(void)
{
    const chip *c = now_played;
    /* The data register of the 16550 has 8 bits, and is not read without a byte. */
    const int isRead = slot == UNREAD && c->isCleared != BY_READING_STATUS;

    if ((last == c->errors && c->isCleared == BY_READING_STATUS) ||
        (last == c->errors && c->isCleared == BY_ONE && slot == c->overrun) ||
        (last == c->receive && c->isCleared == BY_READING_BYTE &&
         (waitingCount > 0 || slot == UNREAD)))
        hasOverrun = 0;
    if (last == c->receive && waitingCount > 0)
        take_first();
    else if (last == c->transmit && !isRead && isStopped)
        stuck++;
    else if (last == c->transmit && !isRead)
        sent[sentCount++ % sizeof sent] = (uint8_t)slot;
    last = UINT32_MAX;
}

static uint32_t status_now(void)
{
    const chip *c = now_played;
    const int isFull = isStopped && stuck > 0;
    uint32_t bits = waitingCount > 0 ? c->hasByte : c->hasNone;

    bits |= isFull ? c->isFull : c->canSend;
    bits |= isFull ? c->isBusy : c->isDone;
    if (hasOverrun && c->errors == c->status)
        bits |= c->overrun;
    return bits;
}

volatile uint32_t *register_at(uint32_t address)
{
    const chip *c = now_played;
    const uint32_t offset = address - UART_BASE;

    settle();
    last = offset;
    slot = 0;
    if (offset == c->receive && waitingCount > 0)
        slot = waiting[0] | (hasOverrun && c->errors == c->receive ? c->overrun : 0);
    else if (offset == c->status)
        slot = status_now();
    else if (offset == c->errors)
        slot = hasOverrun ? c->overrun : 0;
    else if (c->isEventful && offset == 0x11C)
        slot = !isStopped;
    else
        slot = UNREAD;
    return &slot;
}

/* --- the device at the other end */

static int isMute;

static void put(uint8_t *bytes, size_t length)
{
    length = seal(bytes, length);
    memcpy(waiting, bytes, length);
    waitingCount = (unsigned)length;
}

static void device(void)
{
    uint8_t reply[16] = {UNIT, 3, 4, 0, 7, 0, 8};

    if (isMute || sentCount < 8)
        return;
    sentCount = 0;
    put(reply, 7);
}

/* --- the program */

static mbm_line line;
static mbm_node node;
static uint16_t words[2];
static uint8_t frame[64];

static void start(const chip *c)
{
    now_played = c;
    waitingCount = stuck = 0;
    hasOverrun = isStopped = isMute = 0;
    last = UINT32_MAX;
    c->start();
    settle();
    sentCount = 0;
}

static void is_right(void)
{
    memset(words, 0, sizeof words);
    OK(mbm_node_readHoldingRegisters(&node, 0, 2));
    assert_int_equal(words[1], 8);
}

/* Calls a test with a master on each chip. */
static void on_each(void (*test)(const chip *c))
{
    for (size_t i = 0; i < COUNT(chips); i++) {
        static mbm_port port;

        print_message("%s\n", chips[i].name);
        start(&chips[i]);
        port = chips[i].port;
        memset(&line, 0, sizeof line);
        memset(&node, 0, sizeof node);
        OK(mbm_line_beginRtu(&line, &port, frame, sizeof frame));
        OK(mbm_line_setBaudRate(&line, BAUD));
        OK(mbm_node_begin(&node, &line, UNIT, words, 2, NULL, 0));
        is_right();
        test(&chips[i]);
        is_right();
    }
}

static void overruns(const chip *c)
{
    const uint16_t before = c->lost();

    for (uint16_t i = 1; i <= 3; i++) {
        settle();
        hasOverrun = 1;
        is_right();
        assert_int_equal(c->lost() - before, i);
    }
    is_right();
    assert_int_equal(c->lost() - before, 3);
}

TEST(an_overrun_of_the_uart_is_counted_and_the_next_request_works)
{
    on_each(overruns);
}

static void stands_still(const chip *c)
{
    const uint16_t before = c->stalled();

    isStopped = 1;
    for (uint16_t i = 1; i <= 2; i++) {
        const uint32_t began = now;

        IS(MBM_LINK_LOST, mbm_node_readHoldingRegisters(&node, 0, 2));
        assert_int_equal(c->stalled() - before, i);
        assert_in_range(now - began, 500000, 600000);
    }
    isStopped = 0;
    stuck = 0;
    sentCount = 0;
    is_right();
    assert_int_equal(c->stalled() - before, 2);
}

TEST(a_transmitter_that_stands_still_is_a_lost_link_and_then_works)
{
    on_each(stands_still);
}

static uint16_t cells[10];

static void poll_for(mbm_server *server, uint32_t micros)
{
    const uint32_t began = now;

    while (now - began < micros)
        (void)mbm_server_poll(server);
    settle();
}

/* Sends a request to the server after a silence, and polls it for a second. Returns how many bytes
 * it has sent. */
static unsigned answered(mbm_server *server)
{
    uint8_t request[8] = {UNIT, 3, 0, 0, 0, 10};

    poll_for(server, 100000);
    sentCount = 0;
    put(request, 6);
    poll_for(server, 1000000);
    return sentCount;
}

static void served(const chip *c)
{
    static mbm_server server;
    static mbm_unit unit;
    static mbm_registerTable holding;

    isMute = 1;
    memset(&server, 0, sizeof server);
    unit = (mbm_unit){.id = UNIT};
    holding = (mbm_registerTable){.words = cells, .size = COUNT(cells)};
    OK(mbm_unit_serveHoldingRegisters(&unit, &holding));
    OK(mbm_server_beginRtu(&server, &c->port, &unit, 1, frame, sizeof frame));
    OK(mbm_server_setBaudRate(&server, BAUD));
    assert_int_equal(answered(&server), 25);
    isStopped = 1;
    assert_int_equal(answered(&server), 0);
    isStopped = 0;
    stuck = 0;
    assert_int_equal(answered(&server), 25);
    isMute = 0;
    sentCount = 0;
}

TEST(a_server_whose_transmitter_stands_still_gives_its_response_up_and_answers_again)
{
    on_each(served);
}

/* Of the UART with an interrupt: 300 bytes arrive while the main loop is away. */
TEST(bytes_that_find_no_place_in_the_ring_are_counted)
{
    const chip *c = &chips[4];
    const uint16_t before = c->lost();
    uint8_t bytes[300];

    start(c);
    for (unsigned i = 0; i < 300; i++) {
        waitingCount = 1;
        c->interrupt();
        settle();
    }
    assert_int_equal(c->port.read(NULL, bytes, sizeof bytes), MBM_MAX_FRAME);
    assert_int_equal((uint16_t)(c->lost() - before), 300 - MBM_MAX_FRAME);
}
