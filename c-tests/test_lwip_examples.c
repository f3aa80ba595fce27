/* The programs of examples/lwip, whose `main` has another name here, on a board of this test: each
 * round of their main loop is 10 ms on the wire in memory. */
#include "../examples/lwip/board.h"
#include "lwip_pair.h"
#include "test.h"

#include "lwip/priv/tcp_priv.h"

int example_client(void);
int example_serve(void);

static jmp_buf back;
static char printed[20000];
static void (*turn)(void);
static uint32_t rounds;

void board_begin(void) {}

void board_print(const char *text)
{
    assert_true(strlen(printed) + strlen(text) < sizeof printed);
    strcat(printed, text);
}

void board_printNumber(unsigned long number)
{
    char text[24];

    snprintf(text, sizeof text, "%lu", number);
    board_print(text);
}

void board_poll(void)
{
    rounds++;
    wire_pass(10, turn);
}

static void begin(void)
{
    pair_begin();
    printed[0] = 0;
    rounds = 0;
}

static void end(void)
{
    mbm_lwip_closeListener(&listener);
    /* That of the example. */
    while (tcp_listen_pcbs.listen_pcbs)
        (void)tcp_close((struct tcp_pcb *)tcp_listen_pcbs.listen_pcbs);
    pair_end();
}

fixture each_test = {begin, end};

/* A server, which is reset after five seconds, and is away from the eighth to the tenth. */
static void play_server(void)
{
    serve();
    if (rounds == 500)
        serve_reset();
    if (rounds == 800) {
        mbm_lwip_closeListener(&listener);
        serve_reset();
    }
    if (rounds == 1000)
        OK(mbm_lwip_listen(&listener, NULL, PORT, places, PLACES));
    if (rounds == 1500)
        longjmp(back, 1);
}

TEST(the_client_reads_and_connects_again)
{
    char right[40];
    const char *at;
    static int reads;

    snprintf(right, sizeof right, "%u %u \n", words[100], words[101]);
    turn = play_server;
    if (setjmp(back) == 0)
        (void)example_client();
    for (at = printed; (at = strstr(at, right)); at++)
        reads++;
    assert_true(reads >= 10);
    assert_true(strncmp(printed, "connected\n", 10) == 0);
    assert_non_null(strstr(printed, "the peer refused or reset the connection\n"));
    assert_non_null(strstr(strstr(printed + 1, "the peer refused"), "connected\n"));
    assert_string_equal(printed + strlen(printed) - strlen(right), right);
}

static void stop_at_once(void)
{
    longjmp(back, 1);
}

TEST(the_server_says_why_it_cannot_listen)
{
    turn = stop_at_once;
    if (setjmp(back) == 0)
        (void)example_serve();
    assert_string_equal(printed, "the TCP port is taken");
}

/* A client that writes a register, and then reads it again and again. */
static void play_client(void)
{
    if (rounds == 1) {
        mbm_lwip_open(&device, &the_wire.far, PORT);
        client_start();
        request.unit = 1;
        IS(MBM_PENDING, mbm_client_writeSingleRegister(&client, &request, 9, 4711));
    }
    only_poll();
    if (rounds == 1 || request.status == MBM_PENDING)
        return;
    IS(MBM_OK, request.status);
    if (rounds > 100) {
        assert_int_equal(reply[9], 4711);
        longjmp(back, 1);
    }
    client_queue(10);
}

TEST(the_server_answers)
{
    mbm_lwip_closeListener(&listener);
    turn = play_client;
    if (setjmp(back) == 0)
        (void)example_serve();
    assert_string_equal(printed, "");
}
