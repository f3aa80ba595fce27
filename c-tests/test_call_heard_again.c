/* mbm_call on a terminal, with limits of its own, after the device has lost one reply. The clock of
 * the program is the test's, so that no load of the machine changes a result. */
#define _GNU_SOURCE
#include "crc.h"
#include "mbm_call.h"
#include "pty.h"
#include "test.h"

#include <poll.h>
#include <sys/syscall.h>
#include <unistd.h>

enum { UNIT = 17, MS = 1000, PROMPT = 3 * MS, RESPONSE_TIMEOUT_MS = 2000, CALLS = 30 };

/* The test's clock, in microseconds; 0: the machine's. */
static int64_t clock_now;

/* Takes the place of the C library's, in the whole program. */
int clock_gettime(clockid_t id, struct timespec *time)
{
    if (clock_now == 0)
        return (int)syscall(SYS_clock_gettime, id, time);
    time->tv_sec = (time_t)(clock_now / 1000000);
    time->tv_nsec = (long)(clock_now % 1000000) * 1000;
    clock_now += 2;
    return 0;
}

static pty line;
static mbm_tty tty;
static mbm_port port, port_of_tty;
static mbm_client client;
static mbm_clientRequest request;
static mbm_caller caller;
static uint8_t incoming[MBM_MAX_FRAME];
static uint16_t word;

/* The device at the other end of the terminal: what was sent to it, and its reply. */
static unsigned sent, received, requests, lost;
static uint8_t frame[8], reply[7];
static int64_t reply_at; /* 0: no reply is due */

static int16_t count_written(void *context, const uint8_t *bytes, uint16_t length)
{
    int16_t written = port_of_tty.write(context, bytes, length);

    if (written > 0)
        sent += (unsigned)written;
    return written;
}

/* The device takes what was sent, all of it, and prepares its reply. */
static void serve(void)
{
    while (received < sent) {
        const ssize_t count = read(line.ours, frame + received % sizeof frame,
                                   sizeof frame - received % sizeof frame);

        assert_true(count > 0);
        received += (unsigned)count;
        if (received % sizeof frame == 0 && ++requests != lost) {
            reply[0] = UNIT;
            reply[1] = 3;
            reply[2] = 2;
            reply[3] = frame[2]; /* the value of a register is its address */
            reply[4] = frame[3];
            (void)seal(reply, 5);
            reply_at = clock_now + PROMPT;
        }
    }
}

/* Lets time pass: until the reply arrives, for at most `longest` microseconds. */
static int pass(void *context, uint32_t longest)
{
    struct pollfd end = {line.theirs, POLLIN, 0};

    serve();
    if (reply_at == 0 || reply_at > clock_now + longest) {
        clock_now += longest;
        return 0;
    }
    if (reply_at > clock_now)
        clock_now = reply_at;
    reply_at = 0;
    assert_int_equal(write(line.ours, reply, sizeof reply), sizeof reply);
    assert_int_equal(poll(&end, 1, -1), 1);
    return 1;
}

static void begin(void)
{
    memset(&client, 0, sizeof client);
    memset(&request, 0, sizeof request);
    memset(&tty, 0, sizeof tty);
    sent = received = requests = lost = 0;
    reply_at = 0;
    pty_open(&line);
    assert_int_equal(mbm_tty_attach(&tty, line.theirs), 0);
    clock_now = 1000000;
    port = port_of_tty = mbm_tty_port(&tty);
    port.write = count_written;
    OK(mbm_client_beginRtu(&client, &port, incoming, sizeof incoming));
    OK(mbm_client_setBaudRate(&client, 115200));
    OK(mbm_client_setResponseTimeout(&client, RESPONSE_TIMEOUT_MS));
    caller = mbm_call_overTty(&tty, &client, &request);
    caller.wait = pass;
    request.unit = UNIT;
    request.reply = &word;
    request.replyBytes = sizeof word;
}

static void end(void)
{
    clock_now = 0;
    mbm_tty_detach(&tty);
    pty_close(&line);
}

static uint8_t reads(uint16_t address)
{
    const uint8_t status =
        mbm_call(&caller, mbm_client_readHoldingRegisters(&client, &request, address, 1));

    if (status == MBM_OK)
        assert_int_equal(word, address);
    return status;
}

/* Microseconds from the call whose reply is lost to the first good value. */
static int64_t time_to_hear_it_again(void)
{
    uint16_t address;

    for (address = 0; address < 5; address++)
        OK(reads(address));
    lost = requests + 1;
    int64_t began = clock_now;
    IS(MBM_RESPONSE_TIMED_OUT, reads(address++));
    while (reads(address++) != MBM_OK)
        assert_true(address < 1000);
    began = clock_now - began;
    for (address = 0; address < CALLS; address++)
        OK(reads(address));
    return began;
}

TEST(after_one_lost_reply_a_device_is_heard_again_within_five_limits)
{
    static const uint32_t limits[] = {50, 200, 500, 1000};

    for (unsigned i = 0; i < COUNT(limits); i++) {
        begin();
        caller.timeoutMs = limits[i];
        /* Two limits of silence and the quiet time, 100 ms. */
        assert_in_range(time_to_hear_it_again(), 2 * limits[i] * MS,
                        limits[i] >= 200 ? 5 * limits[i] * MS : 3 * limits[i] * MS + 150 * MS);
        end();
    }
}

TEST(the_timeout_of_a_request_is_as_before_after_the_call)
{
    static const uint32_t own[] = {0, 150, 5000};

    for (unsigned i = 0; i < COUNT(own); i++) {
        begin();
        caller.timeoutMs = 200;
        request.timeoutMs = own[i];
        OK(reads(1));
        assert_int_equal(request.timeoutMs, own[i]);
        lost = requests + 1;
        IS(MBM_RESPONSE_TIMED_OUT, reads(2));
        assert_int_equal(request.timeoutMs, own[i]);
        end();
    }
}

/* The request then ends by the response timeout, so its next reply is held for that. */
TEST(a_limit_longer_than_the_response_timeout_changes_nothing)
{
    static const uint32_t limits[] = {0, 5000, MBM_CALL_FOREVER};
    int64_t times[COUNT(limits)];

    for (unsigned i = 0; i < COUNT(limits); i++) {
        begin();
        caller.timeoutMs = limits[i];
        times[i] = time_to_hear_it_again();
        end();
        assert_in_range(times[i], 2 * RESPONSE_TIMEOUT_MS * MS,
                        (2 * RESPONSE_TIMEOUT_MS + 150) * MS);
        assert_in_range(times[i], times[0] - MS, times[0] + MS);
    }
}
