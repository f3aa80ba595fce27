#define _GNU_SOURCE
#include "faults.h"
#include "crc.h"
#include "test.h"

#include <poll.h>
#include <sys/ioctl.h>
#include <unistd.h>

enum { UNIT = FAULT_UNIT, REGISTERS = FAULT_REGISTERS, MOST = 260 };

static const fault *playing;
static mbm_port line_port;
static volatile int link_dies;

uint16_t fault_value(unsigned address)
{
    return (uint16_t)(address * 7919u + 1u);
}

size_t fault_right_reply(uint8_t *frame, const uint8_t *request)
{
    unsigned address = (unsigned)request[2] << 8 | request[3];
    unsigned quantity = (unsigned)request[4] << 8 | request[5];

    memcpy(frame, request, 6);
    if (request[1] == 6 || request[1] == 8)
        return seal(frame, 6);
    frame[2] = (uint8_t)(2 * quantity);
    for (unsigned i = 0; i < quantity; i++) {
        frame[3 + 2 * i] = (uint8_t)(fault_value(address + i) >> 8);
        frame[4 + 2 * i] = (uint8_t)fault_value(address + i);
    }
    return seal(frame, 3 + 2 * quantity);
}

/* Sends bytes and, in one piece with them, the right reply. */
static void reply_after(responder *r, const uint8_t *request, const void *bytes, size_t length)
{
    uint8_t all[2 * MOST];

    memcpy(all, bytes, length);
    responder_send(r, all, length + fault_right_reply(all + length, request));
}

static void right(responder *r, const uint8_t *request)
{
    reply_after(r, request, "", 0);
}

static void leading_zero(responder *r, const uint8_t *request)
{
    reply_after(r, request, "\0", 1);
}

static void five_bytes_of_noise(responder *r, const uint8_t *request)
{
    reply_after(r, request, "\xFF\x00\x55\x01\x99", 5);
}

static void noise_like_our_header(responder *r, const uint8_t *request)
{
    const uint8_t header[] = {UNIT, 3, 2 * REGISTERS};

    reply_after(r, request, header, sizeof header);
}

/* Sends the right reply to another request, then the right reply to ours. */
static void reply_after_reply_to(responder *r, const uint8_t *request, uint8_t unit,
                                 uint8_t function, uint16_t quantity)
{
    const uint8_t other[] = {unit, function, 3, 0x21, (uint8_t)(quantity >> 8), (uint8_t)quantity};
    uint8_t frame[MOST];

    reply_after(r, request, frame, fault_right_reply(frame, other));
}

static void foreign_reply(responder *r, const uint8_t *request)
{
    reply_after_reply_to(r, request, UNIT + 1, 3, REGISTERS);
}

static void reply_of_another_function(responder *r, const uint8_t *request)
{
    reply_after_reply_to(r, request, UNIT, 4, REGISTERS);
}

static void local_echo(responder *r, const uint8_t *request)
{
    reply_after(r, request, request, 8);
}

static void late_reply_of_another_length(responder *r, const uint8_t *request)
{
    reply_after_reply_to(r, request, UNIT, 3, REGISTERS - 1);
}

static void late_reply_to_another_write(responder *r, const uint8_t *request)
{
    reply_after_reply_to(r, request, UNIT, 6, 0x5AA5);
}

static void late_exception_of_another_function(responder *r, const uint8_t *request)
{
    uint8_t frame[5] = {UNIT, 0x90, 2};

    reply_after(r, request, frame, seal(frame, 3));
}

static void a_byte_every_5_ms(responder *r, const uint8_t *request)
{
    uint8_t frame[MOST];
    size_t length = fault_right_reply(frame, request);

    for (size_t i = 0; i < length; i++) {
        responder_send(r, frame + i, 1);
        responder_pause(r, 5);
    }
}

static void a_pause_inside(responder *r, const uint8_t *request)
{
    uint8_t frame[MOST];
    size_t length = fault_right_reply(frame, request);

    responder_send(r, frame, length / 2);
    responder_pause(r, 30);
    responder_send(r, frame + length / 2, length - length / 2);
}

static void reply_twice(responder *r, const uint8_t *request)
{
    uint8_t frame[MOST];

    reply_after(r, request, frame, fault_right_reply(frame, request));
}

static void one_byte_too_long(responder *r, const uint8_t *request)
{
    uint8_t frame[MOST];
    size_t length = fault_right_reply(frame, request);

    frame[length] = 0x7E;
    responder_send(r, frame, length + 1);
}

static void noise_of_300_bytes(responder *r)
{
    uint8_t noise[10];
    unsigned i, piece, state = 12345;

    for (piece = 0; piece < 30; piece++) {
        for (i = 0; i < sizeof noise; i++) {
            state = state * 1103515245u + 12345u;
            noise[i] = (uint8_t)(state >> 16);
        }
        responder_send(r, noise, sizeof noise);
        responder_pause(r, 1);
    }
}

static void reply_after_300_bytes_of_noise(responder *r, const uint8_t *request)
{
    noise_of_300_bytes(r);
    right(r, request);
}

static void only_300_bytes_of_noise(responder *r, const uint8_t *request)
{
    noise_of_300_bytes(r);
}

static void bad_crc(responder *r, const uint8_t *request)
{
    uint8_t frame[MOST];
    size_t length = fault_right_reply(frame, request);

    frame[length - 1] ^= 0x40;
    responder_send(r, frame, length);
}

static void truncated(responder *r, const uint8_t *request)
{
    uint8_t frame[MOST];

    responder_send(r, frame, fault_right_reply(frame, request) - 7);
}

static void one_byte_lost(responder *r, const uint8_t *request)
{
    uint8_t frame[MOST];
    size_t length = fault_right_reply(frame, request);

    memmove(frame + 8, frame + 9, length - 9);
    responder_send(r, frame, length - 1);
}

static void wrong_byte_count(responder *r, const uint8_t *request)
{
    uint8_t shorter[8], frame[MOST];

    memcpy(shorter, request, 6);
    shorter[5] = 1;
    responder_send(r, frame, fault_right_reply(frame, shorter));
}

static void echo_of_another_address(responder *r, const uint8_t *request)
{
    uint8_t frame[MOST];

    fault_right_reply(frame, request);
    frame[3] ^= 1;
    responder_send(r, frame, seal(frame, 6));
}

static size_t exception_of(uint8_t *frame, const uint8_t *request, uint8_t code)
{
    frame[0] = UNIT;
    frame[1] = request[1] | 0x80;
    frame[2] = code;
    return seal(frame, 3);
}

static void exception_with_bad_crc(responder *r, const uint8_t *request)
{
    uint8_t frame[5];
    size_t length = exception_of(frame, request, 0x02);

    frame[4] ^= 0x10;
    responder_send(r, frame, length);
}

static void no_reply(responder *r, const uint8_t *request) {}

/* The device takes so long that the master has given up and sent its next request, which
 * waits meanwhile. The device answers this request first, then the next one. */
static void later_than_the_timeout(responder *r, const uint8_t *request)
{
    responder_pause_until_request(r);
    right(r, request);
}

static void send_exception(responder *r, const uint8_t *request, uint8_t code)
{
    uint8_t frame[5];

    responder_send(r, frame, exception_of(frame, request, code));
}

static void acknowledge(responder *r, const uint8_t *request)
{
    send_exception(r, request, 0x05);
}

static void device_busy(responder *r, const uint8_t *request)
{
    send_exception(r, request, 0x06);
}

static void no_response_of_the_target(responder *r, const uint8_t *request)
{
    send_exception(r, request, 0x0B);
}

static void link_dies_inside(responder *r, const uint8_t *request)
{
    uint8_t frame[MOST];

    fault_right_reply(frame, request);
    responder_send(r, frame, 9);
    responder_pause(r, 20);
    link_dies = 1;
}

const fault faults[] = {
    {"no fault", right, 3, 0, ".....", MBM_OK, "....."},
    {"leading 0x00", leading_zero, 3, 0, ".....", MBM_OK, "....."},
    {"5 bytes of noise before the reply", five_bytes_of_noise, 3, 0, ".....", MBM_OK, "....."},
    {"noise that looks like our header", noise_like_our_header, 3, 0, ".....", MBM_OK, "....."},
    {"a foreign unit's reply, then ours", foreign_reply, 3, 0, ".....", MBM_OK, "....."},
    {"a reply of another function, then ours", reply_of_another_function, 3, 0, ".....", MBM_OK,
     "....."},
    {"local echo, then ours (read)", local_echo, 3, 1, ".....", MBM_OK, "....."},
    {"local echo, then ours (write)", local_echo, 6, 1, ".....", MBM_OK, "....."},
    {"late exception of another function, then ours", late_exception_of_another_function, 3, 0,
     ".....", MBM_OK, "....."},
    {"late reply of another length, then ours", late_reply_of_another_length, 3, 0, ".....", MBM_OK,
     "....."},
    {"late reply to another write, then ours", late_reply_to_another_write, 6, 0, ".....", MBM_OK,
     "....."},
    {"one byte every 5 ms", a_byte_every_5_ms, 3, 0, ".....", MBM_OK, "....."},
    {"cut in two by a pause longer than t3.5", a_pause_inside, 3, 0, ".....", MBM_OK, "....."},
    {"the reply twice without a pause", reply_twice, 3, 0, ".....", MBM_OK, "....."},
    {"one byte too long", one_byte_too_long, 3, 0, ".....", MBM_OK, "....."},
    {"300 bytes of continuous noise, then ours", reply_after_300_bytes_of_noise, 3, 0, ".....",
     MBM_OK, "....."},
    {"300 bytes of continuous noise, no reply", only_300_bytes_of_noise, 3, 0, "F....",
     MBM_RESPONSE_TIMED_OUT, "....."},
    {"no reply", no_reply, 3, 0, "F....", MBM_RESPONSE_TIMED_OUT, "....."},
    {"bad CRC", bad_crc, 3, 0, "F....", MBM_INVALID_CRC, "....."},
    {"truncated", truncated, 3, 0, "F....", MBM_RESPONSE_TIMED_OUT, "....."},
    {"one byte lost", one_byte_lost, 3, 0, "F....", MBM_RESPONSE_TIMED_OUT, "....."},
    {"wrong byte count with right CRC", wrong_byte_count, 3, 0, "F....", MBM_MALFORMED_REPLY,
     "....."},
    {"echo of a write with a wrong address", echo_of_another_address, 6, 0, "F....",
     MBM_MALFORMED_REPLY, "....."},
    {"a reply later than the timeout, from a device that answers in order", later_than_the_timeout,
     3, 0, "F....", MBM_RESPONSE_TIMED_OUT, "....."},
    {"a reply to a write later than the timeout, from such a device", later_than_the_timeout, 6, 0,
     "F....", MBM_RESPONSE_TIMED_OUT, "....."},
    {"exception 05 (acknowledge)", acknowledge, 3, 0, "F....", 0x05, "F...."},
    {"exception 06 (device busy)", device_busy, 3, 0, "F....", 0x06, "F...."},
    {"exception 0B (gateway target gave no response)", no_response_of_the_target, 3, 0, "F....",
     0x0B, "F...."},
    {"exception with bad CRC", exception_with_bad_crc, 3, 0, "F....", MBM_INVALID_CRC, "....."},
    {"the link dies inside the reply", link_dies_inside, 3, 0, "F....", MBM_LINK_LOST, "F...."},
};

const unsigned fault_count = COUNT(faults);

static void play(responder *r, const uint8_t *request, unsigned number)
{
    if (number == 1)
        playing->play(r, request);
    else if (playing->echo)
        local_echo(r, request);
    else
        right(r, request);
}

void fault_start(responder *device, const fault *f)
{
    playing = f;
    link_dies = 0;
    responder_start(device, play);
}

/* The line's read function. It reports a lost link when a script says so. */
static int16_t read_or_die(void *context, uint8_t *bytes, uint16_t capacity)
{
    if (link_dies) {
        link_dies = 0;
        return -1;
    }
    return line_port.read(context, bytes, capacity);
}

mbm_port fault_port(responder *device, const mbm_port *line)
{
    mbm_port port = line_port = held_clock_port(&device->clock, line);

    port.read = read_or_die;
    return port;
}

int fault_as_good(const char *found, const char *expected)
{
    return strspn(found, ".F") == FAULT_TRANSACTIONS &&
           !(strchr(found, 'F') && strcmp(found, expected) != 0);
}

int fault_report(const fault *f, const char *plain, const char *retried, uint8_t status)
{
    printf("%-46s %s  %s  %s\n", f->name, plain, retried,
           status == MBM_OK ? "" : mbm_status_text(status));
    if (fault_as_good(plain, f->expected) && fault_as_good(retried, f->retried) &&
        status == f->status)
        return 0;
    printf("    worse: expected %s %s %s\n", f->expected, f->retried, mbm_status_text(f->status));
    return 1;
}

/* --- the responder --- */

void responder_send(responder *r, const uint8_t *bytes, size_t length)
{
    while (length > 0) {
        ssize_t sent = write(r->line.theirs, bytes, length);

        if (sent < 0)
            abort();
        bytes += sent;
        length -= (size_t)sent;
    }
}

void responder_pause(responder *r, unsigned milliseconds)
{
    int untaken = 0;
    unsigned naps = 0;

    /* Waits until the master has read the bytes that were sent before the pause. */
    while (ioctl(r->line.ours, FIONREAD, &untaken) == 0 && untaken > 0 && naps++ < 1000)
        usleep(1000);
    held_clock_pass(&r->clock, 1000 * (int64_t)milliseconds);
    usleep(milliseconds * 1000);
}

void responder_pause_until_request(responder *r)
{
    struct pollfd wait = {r->line.theirs, POLLIN, 0};
    unsigned pauses = 0;

    do {
        if (pauses++ == 2000)
            abort();
        held_clock_pass(&r->clock, 10000);
    } while (poll(&wait, 1, 10) == 0);
}

static void *respond(void *argument)
{
    responder *r = (responder *)argument;
    uint8_t request[8];
    size_t have = 0;
    unsigned number = 0;

    for (;;) {
        struct pollfd waits[2] = {{r->line.theirs, POLLIN, 0}, {r->stop[0], POLLIN, 0}};
        ssize_t count;

        poll(waits, 2, -1);
        if (waits[1].revents)
            return NULL;
        count = read(r->line.theirs, request + have, sizeof request - have);
        if (count < 0)
            abort();
        have += (size_t)count;
        if (have == sizeof request) {
            have = 0;
            r->script(r, request, ++number);
            held_clock_done(&r->clock, 0, sizeof request);
        }
    }
}

void responder_start(responder *r, responder_script script)
{
    r->script = script;
    pty_open(&r->line);
    held_clock_start(&r->clock);
    if (pipe(r->stop) || pthread_create(&r->thread, NULL, respond, r))
        abort();
}

void responder_stop(responder *r)
{
    if (write(r->stop[1], "", 1) != 1)
        abort();
    pthread_join(r->thread, NULL);
    close(r->stop[0]);
    close(r->stop[1]);
    pty_close(&r->line);
}
