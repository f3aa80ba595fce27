/* Random lives of two clients with their links, and of two nodes whose lines use the clients'
 * ports. Ports stall and are lost, devices respond late or not at all, `done` and the callback of a
 * link call the library too. In half of the lives the clock jumps.
 *
 * - Each request ends, once, when the clock moves on by what mbm_client_pollDelay returns.
 * - A request that has ended is not sent. Each request has an address of its own, which the other
 *   end of the line finds in the frames that arrive.
 * - Storage that the header says is free is released at once, so that a sanitizer sees each use
 *   after that.
 *
 * MBM_LIVES in the environment is the number of lives of each test, MBM_SEED the first one. */
#include "mbm.h"
#include "test.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { LINES = 2, JOBS = 10, STEPS = 300, IDS = 4096 };

typedef struct line {
    mbm_client *client;
    mbm_link *link;
    uint8_t *frame, *outgoing;
    int has_link, is_suspended, borrower, framing;
    /* The port: open, being opened, or lost; the bytes that it takes at a time. */
    enum { OPEN, OPENING, LOST } state;
    uint16_t takes;
    uint8_t arriving[600], partial[600];
    size_t arriving_count, partial_count;
    unsigned long began; /* when the first byte of the partial frame was written */
} line;

typedef struct job {
    mbm_clientRequest *request;
    uint16_t *words;
    int is_pending, at;
    uint16_t id;
} job;

static line lines[LINES];
static job jobs[JOBS];
static mbm_line *borrowers[2];
static mbm_node *nodes[2];
static uint16_t node_words[2][8], asked_by[2]; /* the address of a node's request, or 0 */
static uint8_t node_frames[2][64];

/* The moment at which each request ended; 0 while it is pending. */
static unsigned long ended[IDS], moment;
static uint16_t next_id;
static uint32_t now, random_state;
static int jumps, inside;
static unsigned long life, completed, lost, sent;

static uint32_t below(uint32_t limit)
{
    random_state ^= random_state << 13;
    random_state ^= random_state >> 17;
    random_state ^= random_state << 5;
    return (random_state >> 4) % limit;
}

static uint8_t byte_below(uint32_t limit)
{
    return (uint8_t)below(limit);
}

/* Fails, and says how to repeat it. */
#define HOLDS(condition)                                                                           \
    do {                                                                                           \
        if (!(condition))                                                                          \
            print_error("MBM_SEED=%lu MBM_LIVES=1\n", life);                                       \
        assert_true(condition);                                                                    \
    } while (0)

static void step(void);

/* --- the other end of a line --- */

static uint16_t big(const uint8_t *bytes)
{
    return (uint16_t)(bytes[0] << 8 | bytes[1]);
}

/* The unit and PDU of the bytes that were written. Returns how many there are so far, and whether
 * the frame is whole. */
static size_t content_of(const line *l, uint8_t *content, int *is_whole)
{
    const uint8_t *bytes = l->partial;
    size_t count = l->partial_count, i;

    switch (l->framing) {
    case MBM_FRAMING_TCP:
        HOLDS(count < 4 || big(bytes + 2) == 0);
        *is_whole = count >= 6 && count >= 6u + big(bytes + 4);
        count = count > 6 ? count - 6 : 0;
        memcpy(content, bytes + 6, count);
        return count;
    case MBM_FRAMING_ASCII:
        HOLDS(bytes[0] == ':');
        *is_whole = bytes[count - 1] == '\n';
        count = (count - 1 - (*is_whole ? 2 : 0)) / 2;
        for (i = 0; i < count; i++) {
            const char digits[] = {(char)bytes[2 * i + 1], (char)bytes[2 * i + 2], '\0'};

            content[i] = (uint8_t)strtoul(digits, NULL, 16);
        }
        return count;
    default:
        memcpy(content, bytes, count);
        *is_whole = count >= 8; /* the length of all requests here */
        return count;
    }
}

/* The device writes the register, and most often says so. */
static void respond(line *l, const uint8_t *content)
{
    uint8_t frame[MBM_MAX_ASCII_FRAME] = {0};
    uint16_t length = 0;

    sent++;
    if (content[0] == 0 || below(4) == 0)
        return;
    if (l->framing == MBM_FRAMING_TCP) {
        memcpy(frame, l->partial, 12);
        length = 12;
    } else {
        memcpy(frame, l->partial, l->partial_count);
        length = (uint16_t)l->partial_count;
    }
    if (below(8) == 0)
        frame[below(length)] ^= 1;
    if (below(8) == 0)
        length = (uint16_t)below(length);
    if (l->arriving_count + length <= sizeof l->arriving) {
        memcpy(l->arriving + l->arriving_count, frame, length);
        l->arriving_count += length;
    }
}

static void take(line *l, uint8_t byte)
{
    uint8_t content[600];
    int is_whole = 0;

    if (l->partial_count == 0)
        l->began = ++moment;
    HOLDS(l->partial_count < sizeof l->partial);
    l->partial[l->partial_count++] = byte;
    if (content_of(l, content, &is_whole) >= 4) {
        const uint16_t id = big(content + 2);

        HOLDS(id > 0 && id < next_id);
        HOLDS(ended[id] == 0 || ended[id] > l->began);
        /* While the client is suspended, the wire is the borrower's. */
        HOLDS(!l->is_suspended || (l->borrower >= 0 && id == asked_by[l->borrower]));
    }
    if (is_whole) {
        respond(l, content);
        l->partial_count = 0;
    }
}

/* --- the port --- */

static int16_t read_bytes(void *context, uint8_t *bytes, uint16_t capacity)
{
    line *l = (line *)context;
    size_t count = l->arriving_count < capacity ? l->arriving_count : capacity;

    if (l->state != OPEN)
        return l->state == OPENING ? 0 : -1;
    memcpy(bytes, l->arriving, count);
    l->arriving_count -= count;
    memmove(l->arriving, l->arriving + count, l->arriving_count);
    return (int16_t)count;
}

static int16_t write_bytes(void *context, const uint8_t *bytes, uint16_t length)
{
    line *l = (line *)context;

    if (l->state != OPEN)
        return l->state == OPENING ? 0 : -1;
    if (length > l->takes)
        length = l->takes;
    for (uint16_t i = 0; i < length; i++)
        take(l, bytes[i]);
    return (int16_t)length;
}

static uint32_t micros(void *context)
{
    (void)context;
    return now;
}

static void driver_on(void *context)
{
    /* A frame that was given up may be incomplete. The next one begins here. */
    ((line *)context)->partial_count = 0;
}

static void renew(line *l, int state)
{
    l->state = state == OPEN ? OPEN : state == OPENING ? OPENING : LOST;
    l->arriving_count = l->partial_count = 0;
}

static void close_line(void *context)
{
    ((line *)context)->state = LOST;
}

static uint8_t open_line(void *context)
{
    line *l = (line *)context;

    renew(l, below(2) ? OPEN : (int)below(3));
    return l->state == OPEN ? MBM_OK : l->state == OPENING ? MBM_PENDING : MBM_LINK_LOST;
}

static uint8_t look_at_line(void *context)
{
    line *l = (line *)context;

    if (l->state == OPENING && below(4) == 0)
        l->state = below(2) ? OPEN : LOST;
    return l->state == OPEN ? MBM_OK : l->state == OPENING ? MBM_PENDING : MBM_LINK_LOST;
}

/* --- the program --- */

static void call_back(void)
{
    if (inside < 2 && below(3) == 0) {
        inside++;
        step();
        inside--;
    }
}

static void ends(uint16_t id)
{
    HOLDS(ended[id] == 0);
    ended[id] = ++moment;
}

static void done(void *context, mbm_clientRequest *request)
{
    job *j = (job *)context;

    HOLDS(j->request == request && j->is_pending);
    HOLDS(request->status != MBM_PENDING);
    if (request->status == MBM_OK)
        completed++;
    else
        lost += request->status == MBM_LINK_LOST;
    j->is_pending = 0;
    ends(j->id);
    call_back();
}

static void changed(void *context, uint8_t event, uint8_t status)
{
    (void)status;
    if (event != MBM_LINK_EVENT_CONNECTED)
        close_line(context);
    call_back();
}

/* Begins the client of a line. The one that it was gives up its requests. */
static void begin(line *l)
{
    mbm_port port = {0};
    const int framing = (int)below(4);
    const uint16_t bytes = (uint16_t)(below(2) ? 520 : 40), more = (uint16_t)(below(2) ? 300 : 20);
    uint8_t status;

    uint8_t *frame = (uint8_t *)malloc(bytes);
    uint8_t *outgoing = (uint8_t *)malloc(more);
    port.context = l;
    port.read = read_bytes;
    port.write = write_bytes;
    port.micros = micros;
    port.preTransmission = driver_on;
    switch (framing) {
    case MBM_FRAMING_RTU: status = mbm_client_beginRtu(l->client, &port, frame, bytes); break;
    case MBM_FRAMING_ASCII: status = mbm_client_beginAscii(l->client, &port, frame, bytes); break;
    case MBM_FRAMING_RTU_OVER_TCP:
        status = mbm_client_beginRtuOverTcp(l->client, &port, frame, bytes);
        break;
    default: status = mbm_client_beginTcp(l->client, &port, frame, bytes, outgoing, more); break;
    }
    HOLDS(status == (l->is_suspended ? MBM_BUSY : MBM_OK));
    if (status != MBM_OK) {
        free(frame);
        free(outgoing);
        return;
    }
    free(l->frame);
    free(l->outgoing);
    l->frame = frame;
    l->outgoing = outgoing;
    l->framing = framing;
    l->has_link = 0;
    renew(l, OPEN);
    for (int i = 0; i < JOBS; i++)
        if (jobs[i].is_pending && &lines[jobs[i].at] == l) {
            HOLDS(jobs[i].request->status == MBM_CANCELLED);
            jobs[i].is_pending = 0;
            ends(jobs[i].id);
        }
    OK(mbm_client_setResponseTimeout(l->client, (uint16_t)below(300)));
}

static void queue(int at)
{
    job *j = &jobs[below(JOBS)];

    if (j->is_pending) {
        HOLDS(mbm_client_readCoils(lines[at].client, j->request, 0, 1) != MBM_PENDING);
        return;
    }
    if (next_id == IDS)
        return;
    if (inside == 0) {
        free(j->request);
        free(j->words);
        j->request = (mbm_clientRequest *)calloc(1, sizeof *j->request);
        j->words = (uint16_t *)calloc(1, sizeof *j->words);
    }
    j->request->done = done;
    j->request->context = j;
    j->request->unit = (uint8_t)(1 + below(3));
    if (lines[at].framing == MBM_FRAMING_RTU && below(8) == 0)
        j->request->unit = 0;
    j->request->timeoutMs = (uint16_t)(below(4) ? 0 : below(500));
    j->request->reply = j->words;
    j->request->replyBytes = sizeof *j->words;
    ended[next_id] = 0;
    j->id = next_id++;
    uint8_t status =
        below(3) == 0 && j->request->unit
            ? mbm_client_readHoldingRegisters(lines[at].client, j->request, j->id, 1)
            : mbm_client_writeSingleRegister(lines[at].client, j->request, j->id, j->id);
    j->is_pending = status == MBM_PENDING;
    j->at = at;
    HOLDS(j->is_pending == (j->request->status == MBM_PENDING));
    if (!j->is_pending)
        ends(j->id);
}

static void cancel(void)
{
    job *j = &jobs[below(JOBS)];
    const uint8_t status = mbm_client_cancel(lines[j->at].client, j->request);

    HOLDS(status == (j->is_pending ? MBM_OK : MBM_NOT_PENDING));
    if (j->is_pending) {
        j->is_pending = 0;
        ends(j->id);
    }
}

static void set(line *l)
{
    const uint16_t ms = (uint16_t)below(200);

    switch (below(7)) {
    case 0: OK(mbm_client_setResponseTimeout(l->client, ms)); break;
    case 1: OK(mbm_client_setQuietTime(l->client, ms)); break;
    case 2: OK(mbm_client_setRetries(l->client, byte_below(3))); break;
    case 3: OK(mbm_client_setBackoff(l->client, byte_below(4), ms, 300)); break;
    case 4: (void)mbm_client_setInFlight(l->client, (uint8_t)(1 + below(16))); break;
    case 5: OK(mbm_client_setBaudRate(l->client, below(2) ? 9600 : 0)); break;
    default: OK(mbm_client_setTurnaroundDelay(l->client, ms)); break;
    }
}

static void use_link(line *l)
{
    const mbm_linkHooks hooks = {l, below(3) ? close_line : NULL, open_line, look_at_line};

    switch (below(4)) {
    case 0:
    case 1:
        if (mbm_link_begin(l->link, l->client, &hooks) != MBM_OK)
            break;
        l->has_link = 1;
        OK(mbm_link_setCallback(l->link, changed, l));
        OK(mbm_link_setRequestsWait(l->link, byte_below(2)));
        OK(mbm_link_setBackoff(l->link, byte_below(4), (uint16_t)below(200), 400));
        OK(mbm_link_setConnectTimeout(l->link, (uint16_t)(1 + below(300))));
        if (below(2))
            OK(mbm_link_setReplaceAfter(l->link, byte_below(101)));
        break;
    case 2:
        if (!l->has_link || mbm_link_end(l->link) != MBM_OK)
            break;
        l->has_link = 0;
        if (inside == 0) {
            free(l->link);
            l->link = (mbm_link *)calloc(1, sizeof *l->link);
        }
        break;
    default:
        if (l->has_link) {
            OK(mbm_link_reconnect(l->link));
        } else if (mbm_client_reconnect(l->client, NULL) == MBM_OK) {
            renew(l, OPEN);
        }
        break;
    }
}

static void lend(line *l)
{
    const int i = (int)below(3);
    mbm_line *borrower = i < 2 ? borrowers[i] : NULL;

    if (borrower && (asked_by[i] || lines[0].borrower == i || lines[1].borrower == i))
        return;
    if (mbm_client_suspend(l->client, borrower) == MBM_OK) {
        l->is_suspended = 1;
        l->borrower = borrower ? i : -1;
    }
}

static void take_back(line *l)
{
    mbm_line *borrower = l->borrower < 0 ? NULL : borrowers[l->borrower];
    mbm_line *other = l->borrower == 0 ? borrowers[1] : borrowers[0];

    IS(MBM_INVALID_ARGUMENT, mbm_client_resume(l->client, other));
    if (!l->is_suspended)
        return;
    if (borrower)
        IS(MBM_INVALID_ARGUMENT, mbm_client_resume(l->client, NULL));
    if (borrower && asked_by[l->borrower]) {
        IS(MBM_BUSY, mbm_client_resume(l->client, borrower));
        return;
    }
    OK(mbm_client_resume(l->client, borrower));
    l->is_suspended = 0;
    l->borrower = -1;
}

/* Polls a node, or makes a request with it; its line may have no port. */
static void use_node(int i)
{
    const int has_line = lines[0].borrower == i || lines[1].borrower == i;

    if (asked_by[i]) {
        if (below(8) == 0)
            OK(mbm_node_cancel(nodes[i]));
        else if (mbm_node_poll(nodes[i]) == MBM_PENDING)
            return;
        ends(asked_by[i]);
        asked_by[i] = 0;
        return;
    }
    if (next_id == IDS)
        return;
    ended[next_id] = 0;
    IS(has_line ? MBM_PENDING : MBM_NOT_INITIALISED,
       mbm_node_writeSingleRegister(nodes[i], next_id, 1));
    if (has_line)
        asked_by[i] = next_id;
    next_id++;
}

/* Ends a client that nothing uses, and begins another one. */
static void replace(line *l)
{
    if (inside || l->has_link || l->is_suspended || mbm_client_pending(l->client) > 0)
        return;
    free(l->client);
    l->client = (mbm_client *)calloc(1, sizeof *l->client);
    begin(l);
}

static void change_port(line *l)
{
    static const uint16_t takes[] = {0, 1, 3, 600, 600, 600};

    switch (below(4)) {
    case 0:
        if (below(4) == 0)
            l->state = LOST;
        break;
    case 1:
        if (l->state == OPENING)
            l->state = OPEN;
        break;
    case 2:
        if (l->state == OPEN && !l->has_link)
            l->state = OPENING;
        break;
    default: l->takes = takes[below(COUNT(takes))]; break;
    }
}

static void pass(uint32_t time)
{
    now += time;
    if (jumps && below(40) == 0)
        now += below(2) ? 0u - below(5000000) : below(2) ? below(3000000000u) : below(UINT32_MAX);
}

static void step(void)
{
    const int at = (int)below(LINES);
    line *l = &lines[at];

    switch (below(20)) {
    case 0:
    case 1:
    case 2:
    case 3: queue(at); break;
    case 4: cancel(); break;
    case 5: set(l); break;
    case 6:
    case 7: use_link(l); break;
    case 8: lend(l); break;
    case 9:
    case 10: take_back(l); break;
    case 11:
    case 12: use_node(at); break;
    case 13:
        if (below(4) == 0)
            begin(l);
        break;
    case 14: replace(l); break;
    case 15:
    case 16: change_port(l); break;
    case 17:
        if (inside == 0)
            pass(below(200000));
        break;
    default:
        if (inside) {
            (void)mbm_client_pollDelay(l->client);
        } else {
            const uint32_t delay = mbm_client_pollDelay(l->client);

            pass(delay < 1000000 ? delay : 1000);
            (void)mbm_client_poll(l->client);
        }
        break;
    }
}

/* Every request ends, whatever the port does. A link that requests wait for is ended before. */
static void all_end(line *l)
{
    uint64_t time = 0;

    if (l->borrower >= 0 && asked_by[l->borrower]) {
        OK(mbm_node_cancel(nodes[l->borrower]));
        ends(asked_by[l->borrower]);
        asked_by[l->borrower] = 0;
    }
    take_back(l);
    if (l->has_link)
        OK(mbm_link_setRequestsWait(l->link, 0));
    OK(mbm_client_setRetries(l->client, 1));
    OK(mbm_client_setBackoff(l->client, MBM_BACKOFF_NONE, 0, 0));
    OK(mbm_client_setResponseTimeout(l->client, 200));
    while (mbm_client_pending(l->client) > 0) {
        const uint32_t delay = mbm_client_pollDelay(l->client);

        /* 16 requests, sent twice each. An attempt takes less than ten seconds. */
        HOLDS(time < 16u * 2 * 10 * 1000000);
        time += delay > 100 ? delay : 100;
        now += delay > 100 ? delay : 100;
        (void)mbm_client_poll(l->client);
    }
}

static void live(void)
{
    random_state = (uint32_t)life * 2654435761u + 1;
    now = below(2) ? 0 : 0u - below(3000000);
    next_id = 1;
    memset(asked_by, 0, sizeof asked_by);
    for (int i = 0; i < JOBS; i++) {
        memset(&jobs[i], 0, sizeof jobs[i]);
        jobs[i].request = (mbm_clientRequest *)calloc(1, sizeof *jobs[i].request);
    }
    for (int i = 0; i < 2; i++) {
        memset(&lines[i], 0, sizeof lines[i]);
        lines[i].client = (mbm_client *)calloc(1, sizeof *lines[i].client);
        lines[i].link = (mbm_link *)calloc(1, sizeof *lines[i].link);
        lines[i].takes = 600;
        lines[i].borrower = -1;
        begin(&lines[i]);
        borrowers[i] = (mbm_line *)calloc(1, sizeof *borrowers[i]);
        nodes[i] = (mbm_node *)calloc(1, sizeof *nodes[i]);
        OK(mbm_line_setFrame(borrowers[i], node_frames[i], 64));
        OK(mbm_node_begin(nodes[i], borrowers[i], 1, node_words[i], 8, NULL, 0));
        OK(mbm_node_setBlocking(nodes[i], 0));
    }
    for (int i = 0; i < STEPS; i++)
        step();
    inside = 2;
    for (int i = 0; i < 2; i++)
        all_end(&lines[i]);
    inside = 0;
    for (int i = 0; i < JOBS; i++) {
        HOLDS(!jobs[i].is_pending);
        free(jobs[i].request);
        free(jobs[i].words);
    }
    for (int i = 0; i < 2; i++) {
        free(lines[i].client);
        free(lines[i].link);
        free(lines[i].frame);
        free(lines[i].outgoing);
    }
    /* Their lines are gone. */
    for (int i = 0; i < 2; i++) {
        IS(MBM_NOT_INITIALISED, mbm_node_readCoils(nodes[i], 0, 1));
        free(nodes[i]);
        free(borrowers[i]);
    }
}

static unsigned long setting(const char *name, unsigned long otherwise)
{
    const char *text = getenv(name);

    return text ? strtoul(text, NULL, 0) : otherwise;
}

static void lives(int with_jumps)
{
    const unsigned long first = setting("MBM_SEED", 1);
    const unsigned long count = setting("MBM_LIVES", getenv("MBM_TRANSACTIONS") ? 50 : 2000);

    jumps = with_jumps;
    completed = lost = sent = 0;
    for (life = first; life < first + count; life++)
        live();
    print_message("%lu lives: %lu frames sent, %lu requests answered, %lu lost with their link\n",
                  count, sent, completed, lost);
    /* The lives are no quiet ones. */
    assert_true(count < 50 || (sent > count && completed > count / 4 && lost > count));
}

TEST(each_request_of_a_life_ends_once_and_is_not_sent_afterwards)
{
    lives(0);
}

TEST(so_it_is_with_a_clock_that_jumps)
{
    lives(1);
}
